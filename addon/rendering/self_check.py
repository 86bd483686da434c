# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether an installation renders and writes what it should: a box whose image is known, and a file read back."""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ..output.frame import FrameImages
from ..solver import Camera, Material, Scene, Settings

KELVIN = 300.0
_BANDS = np.array([8.0, 10.0, 12.0])  # um
# By chance the mean over the image errs by 0.05 K (spread over seeds); a tenth of the light amiss would be 6 K.
_PHOTONS_MAY_ERR = 1.0  # K


def run_checks() -> Iterator[tuple[str, str]]:
    """(what was looked at, what is wrong with it or an empty text), one after the other."""
    for check in CHECKS:
        yield check.__doc__, _problem(check)


def _problem(check: Callable[[], str]) -> str:
    try:
        return check()
    except Exception as error:  # whatever it is, the artist has to read it
        return f"{type(error).__name__}: {error}"


def _libraries() -> str:
    """Bundled libraries load"""
    for name in ("embreex", "numba", "OpenEXR"):
        importlib.import_module(name)
    return ""


def _black() -> str:
    """A closed box at one temperature looks like a blackbody"""
    found = _render(subtract=True)
    error = float(np.max(np.abs(found - KELVIN)))
    return "" if error < 1e-3 else f"off by {error:.3g} K"  # nothing is random here


def _photons() -> str:
    """So it does by photons alone"""
    error = float(np.mean(_render(subtract=False), dtype=float)) - KELVIN
    return "" if abs(error) < _PHOTONS_MAY_ERR else f"off by {error:.3g} K in the mean"


def _file() -> str:
    """Band images are read back from a file to the last bit"""
    import OpenEXR

    from ..output.exr import channel_name, write_band_exr

    image = np.random.default_rng(0).normal(300.0, 10.0, (3, 5)).astype(np.float32)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "check.exr"
        write_band_exr(path, FrameImages([image, image], _BANDS, image, image, image))
        with OpenEXR.File(str(path)) as file:
            read = file.channels()[channel_name("Temperature")].pixels[::-1].copy()
    return "" if np.array_equal(read, image) else "other values were read than written"


def _render(subtract: bool) -> np.ndarray:
    """(24, 32) float32 apparent temperature, K, seen from the middle of a grey box."""
    from ..solver import render

    vertices = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    faces = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    triangles = np.array([corner for a, b, c, d in faces for corner in ((a, b, c), (a, c, d))], np.int32)
    temperature = np.full(len(triangles), KELVIN, np.float32)
    camera = Camera(32, 24, np.eye(4), frame=(-0.8, 0.8, -0.6, 0.6))
    material = np.zeros(len(triangles), np.int32)
    scene = Scene(vertices, triangles, material, temperature, (Material("grey", 0.5),), camera, _BANDS)
    return render(scene, Settings(passes=8, photons_per_pass=20_000, reference_subtraction=subtract)).temperature()


CHECKS = (_libraries, _black, _photons, _file)  # the docstring of each says what is looked at
