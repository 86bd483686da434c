# SPDX-License-Identifier: GPL-3.0-or-later
"""Random numbers, sequences that lie evenly, and the warps that make points and directions of them."""
