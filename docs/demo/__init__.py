# SPDX-License-Identifier: GPL-3.0-or-later
"""The demo: its scene, and the script behind `python run.py demo`."""
