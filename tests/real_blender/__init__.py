# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs inside a real Blender, by launch.py, for test_real_blender.py and for the pictures of the pages."""
