# SPDX-License-Identifier: GPL-3.0-or-later
"""From the camera's rays to the pixels of one pass."""
