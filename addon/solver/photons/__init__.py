# SPDX-License-Identifier: GPL-3.0-or-later
"""From what emits to irradiance: the emission of photons, their flight, the photon map and the irradiance cache."""
