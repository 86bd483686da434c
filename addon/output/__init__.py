# SPDX-License-Identifier: GPL-3.0-or-later
"""What leaves a render beside Blender's own output: files for tools that measure, and pictures in a palette."""
