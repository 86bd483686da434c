# SPDX-License-Identifier: GPL-3.0-or-later
"""What measuring tools read in a picture of temperatures. This knows nothing of Blender."""
