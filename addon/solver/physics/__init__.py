# SPDX-License-Identifier: GPL-3.0-or-later
"""Planck's law, materials, their lobes, sensors and bands."""
