# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles, the rays between them, where both meet, and trees of points."""
