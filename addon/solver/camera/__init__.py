# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera: from camera rays to the pixels of one pass."""
