# SPDX-License-Identifier: GPL-3.0-or-later
"""What leaves a render beside Blender's own output: band EXR files and pictures in a thermal palette."""
