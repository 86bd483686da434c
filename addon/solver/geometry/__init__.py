# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry: triangles, rays and the segments between them, interactions of both, and trees of points."""
