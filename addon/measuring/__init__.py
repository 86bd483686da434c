# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring in a finished picture: numpy alone, nothing of Blender."""
