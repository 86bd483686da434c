# SPDX-License-Identifier: GPL-3.0-or-later
"""What bands lose between parallel plates of library materials: for test_band_partition.py and measure_bands.py.

The spectral error of a division into bands is the sum over bands of |radiance of the band - reference| over the sum of
the reference. The reference has 512 bands: each band cut into as many equal ones as make at least 512.
"""

import math
from functools import lru_cache

import numpy as np

from addon.solver.physics import library
from addon.solver.physics.band_partition import choose_bands
from addon.solver.physics.radiometry import excess_emissivity
from addon.solver.physics.spectrum import band_radiance, uniform_edges

FINE = 512  # bands of a reference
HOT, COLD = 340.0, 293.0  # K, of the plates
GLASS, QUARTZ, ANODISED = "Glass, window", "Fused silica", "Aluminium, anodised black"
GREEN, LACQUER = "Paint, dark green on metal", "Paint, lacquer on aluminium"
SETS = {
    "glass": (GLASS,),
    "quartz": (QUARTZ,),
    "anodised": (ANODISED, "Aluminium, anodised grey"),
    "glass, quartz": (GLASS, QUARTZ),
    "paints": (GREEN, LACQUER, "Paint, ultra-flat black"),
    "all": (GLASS, QUARTZ, ANODISED, GREEN, LACQUER),
}


def curve(name):
    """Wavelengths (um) and emissivities of a library material."""
    return tuple(library.find(name).T)


def finer(edges, count=FINE):
    """The edges of the reference, of `count` bands or a few more: those of the bands are among them."""
    parts = math.ceil(count / (len(edges) - 1))
    return np.interp(np.arange(parts * (len(edges) - 1) + 1) / parts, np.arange(len(edges)), edges)


def summed(fine, edges):
    """Values (..., f) of the bands of finer(edges), summed over each band."""
    return fine.reshape(*fine.shape[:-1], len(edges) - 1, -1).sum(axis=-1)


@lru_cache(maxsize=256)
def plate(name, edges, weight):
    """Excess of what a plate at HOT emits over what it emits at COLD, (b,) W m-2 sr-1, and its reflectance, (b,).

    Both as the solver has them. edges: as bytes. weight: see plates.
    """
    edges = np.frombuffer(edges)
    emitted = band_radiance(edges, np.array([COLD, HOT]), curve(name))
    return emitted[1] - emitted[0], 1.0 - weight(edges, HOT, COLD, curve(name))


def plates(hot, cold, edges, weight=excess_emissivity):
    """Radiance of two infinite parallel plates of library materials at HOT and COLD, (2, b) W m-2 sr-1.

    With the excess e over B(COLD) and one reflectance r for each band, 1 - weight(edges, HOT, COLD, curve), it is
    e / (1 - r1 r2) for the hot plate and r2 e / (1 - r1 r2) for the other (Modest, chapter 5).
    """
    (emitted, r1), (_, r2) = (plate(name, edges.tobytes(), weight) for name in (hot, cold))
    return np.array([emitted, r2 * emitted]) / (1.0 - r1 * r2) + band_radiance(edges, COLD)


def spectral_error(bands, fine, edges):
    """Of radiances (..., b) against those of finer(edges), (...,); see above."""
    reference = summed(fine, edges)
    return np.abs(bands - reference).sum(axis=-1) / reference.sum(axis=-1)


def plate_errors(names, edges, weight=excess_emissivity):
    """Spectral errors of the plates in all pairs of materials, (pairs, 2)."""
    pairs = [(hot, cold) for hot in names for cold in names]
    return np.array(
        [spectral_error(plates(*pair, edges, weight), plates(*pair, finer(edges)), edges) for pair in pairs]
    )


def compared(names, low, high, count):
    """Spectral errors of plates in uniform and in adaptive bands, (pairs, 2) each."""
    adaptive = choose_bands(low, high, [curve(name) for name in names], (COLD, HOT), count=count).edges
    return plate_errors(names, uniform_edges(low, high, count)), plate_errors(names, adaptive)
