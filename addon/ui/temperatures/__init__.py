# SPDX-License-Identifier: GPL-3.0-or-later
"""Giving temperatures to surfaces, and seeing them: tools, groups, maps, the colour bar, the spot meter."""
