# SPDX-License-Identifier: GPL-3.0-or-later
"""Data sets of pairs: each frame by this engine and by one of Blender's own, with labels."""
