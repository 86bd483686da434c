# SPDX-License-Identifier: GPL-3.0-or-later
"""Sampling: random numbers, low-discrepancy points, and warps that turn numbers into points and directions."""
