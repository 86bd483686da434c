# SPDX-License-Identifier: GPL-3.0-or-later
"""Gases of materials and of the world: their panels, the library of mixtures, and pictures of what they let through."""
