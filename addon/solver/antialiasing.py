# SPDX-License-Identifier: GPL-3.0-or-later
"""How many camera rays a pixel sends in a pass: more where what it sees differs within.

A few rays of a sequence of their own look at every pixel before the first pass, so the mean does not depend on them.
The error of an edge falls as n^-3/2 in variance, as only n^1/2 of n strata lie on it (Mitchell 1996); a further ray
pays where it saves as much variance as one of a final gather does (see splitting).
"""

from collections import deque
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from .camera import Eye, empty_eye_rays, eye_rays
from .kernels import KERNEL, njit
from .radiometry import Radiometry, excess
from .splitting import Splitting
from .surfaces import Surfaces, Tracer, facing_side, sheet_count, temperature_at

FEWEST, IN_MIRRORS, MOST = 4, 16, 128  # rays of a pixel in a pass; powers of two: each pass is stratified
_MEAN = 32.0  # of a pixel at most, where little but edges is noisy
_LOOKS = 8  # rays that look at a pixel
_AROUND = 1.0 / 16.0  # of the variance in the pixels around that a pixel may hold without having been seen to
_TOGETHER = 1 << 11  # pixels that are looked at together


def choose_samples(
    surfaces: Surfaces,
    tracer: Tracer,
    radiometry: Radiometry,
    surroundings: np.ndarray,
    eye: Eye,
    key: int,
    splitting: Splitting | None,
    threads: int,
) -> np.ndarray:
    """(pixels,) uint16 rays of every pixel of the window in a pass.

    surroundings: (b,) float64, their excess radiance. key: of the rays that look. splitting: None without photons.
    """
    x0, y0, x1, y1 = (int(edge) for edge in eye.window)
    width, height = x1 - x0, y1 - y0
    price, reflected = 0.0, np.zeros(sheet_count(surfaces))
    if splitting is not None:
        price, reflected = splitting.price, splitting.reflected
    variance, mirrors = np.empty(width * height), np.empty(width * height, np.bool_)

    def look(first: int) -> None:
        pixels = np.arange(first, min(first + _TOGETHER, len(variance)))
        rays = empty_eye_rays(_LOOKS * len(pixels))
        eye_rays(eye, key, 0, np.full(len(pixels), _LOOKS, np.uint16), pixels, *rays)
        hits, emitted = tracer.trace(*rays), np.empty(len(surroundings))
        seen, specular = np.empty(len(rays[0])), np.zeros(len(rays[0]), np.bool_)
        _see(surfaces, radiometry, surroundings.sum(), reflected, *hits, rays[1], seen, specular, emitted)
        mirrors[pixels] = specular.reshape(-1, _LOOKS).any(axis=1)
        variance[pixels] = seen.reshape(-1, _LOOKS).var(axis=1, ddof=1)

    with ThreadPoolExecutor(threads) as pool:
        deque(pool.map(look, range(0, len(variance), _TOGETHER)), 0)
    around = np.pad(variance.reshape(height, width), 1)
    around = sum(around[y : y + height, x : x + width] for y in range(3) for x in range(3)).ravel()
    variance = np.maximum(variance, _AROUND * around)
    prices = max(variance.max(), 1e-300) * np.geomspace(1e-9, 1.0, 30)
    least = next((each for each in prices if _samples(variance, each).mean() <= _MEAN), prices[-1])
    samples = _samples(variance, max(price, least))
    return np.where(mirrors, np.maximum(samples, IN_MIRRORS), samples)


def _samples(variance: np.ndarray, price: float) -> np.ndarray:
    """Rays n at which a further one saves what it costs: d(variance n^-3/2)/dn = -price, rounded to powers of two."""
    best = (1.5 * variance / max(price, 1e-300)) ** 0.4
    return (2 ** np.rint(np.log2(np.clip(best, FEWEST, MOST)))).astype(np.uint16)


@njit(**KERNEL)
def _see(surfaces, radiometry, surroundings, reflected, triangle, u, v, direction, seen, specular, emitted):
    """Fill in the excess radiance (n,) of all bands, W m-2 sr-1, that rays see, its reflected part as the sheet's mean.

    What mirrors show is not looked at; specular (n,) bool tells where there are some. emitted: (b,) room.
    """
    known, known_kelvin = -1, -1.0  # material and temperature whose excess `emitted` holds
    for i in range(triangle.size):
        t = triangle[i]
        if t < 0:
            seen[i] = surroundings
            continue
        material, kelvin = surfaces.material[t], temperature_at(surfaces.temperature, t, u[i], v[i])
        if material != known or kelvin != known_kelvin:
            excess(radiometry, material, kelvin, 1.0, emitted)
            known, known_kelvin = material, kelvin
        specular[i] = radiometry.specular[material] > 0.0
        diffuse = (1.0 - radiometry.specular[material]) * radiometry.reflectance[material].mean()
        seen[i] = emitted.sum() + diffuse * reflected[surfaces.sheet[t, facing_side(surfaces, t, direction, i)]]
