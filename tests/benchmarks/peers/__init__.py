# SPDX-License-Identifier: GPL-3.0-or-later
"""Other renderers on the scenes of the benchmark, each in a process of its own: see problem.py and __main__.py."""
