# SPDX-License-Identifier: GPL-3.0-or-later
"""From what emits to irradiance: photons' emission, flight, map and cache."""
