# SPDX-License-Identifier: GPL-3.0-or-later
"""What a final render does before the passes: functions like the solver's `render` that do more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import takewhile

from ..solver import render
from ..solver.geometry.surfaces import Geometry, build_geometry
from .coarse import coarser, hasty, steps

LEAST_STEP = 4  # pixels on each side of one of a first picture: finer ones take more than a sixteenth of a pass


def solver_with_first_pictures(solve: Callable) -> Callable:
    """A function like `render` that first calls on_pass with films of large pixels, and with how large they are (step).

    The first pass of a large image takes long; these films are there at once.
    """

    def look_and_solve(scene, settings, on_pass, cancelled, image_copies, geometry=None):
        for step in takewhile(lambda step: step >= LEAST_STEP, steps(scene.camera)):
            geometry = build_geometry(scene, geometry)
            coarse = replace(scene, camera=coarser(scene.camera, step), moments=())
            render(coarse, hasty(settings, step), partial(on_pass, step=step), cancelled, geometry=geometry)
        return solve(scene, settings, on_pass, cancelled, image_copies=image_copies, geometry=geometry)

    return look_and_solve


def solver_after(solve: Callable, look: Callable) -> Callable:
    """A function like `render` that first calls look(scene, geometry, threads, cancelled), which fills images of what
    the camera sees."""

    def look_and_solve(scene, settings, on_pass, cancelled, image_copies, geometry=None):
        geometry = build_geometry(scene, geometry)
        look(scene, geometry, settings.workers, cancelled)
        return solve(scene, settings, on_pass, cancelled, image_copies=image_copies, geometry=geometry)

    return look_and_solve


def solver_with_kept_geometry(solve: Callable, geometries: dict[str, Geometry], layer: str) -> Callable:
    """A function like `render` that reuses a layer's geometry if no vertex and no triangle differs.

    geometries: by view layer, those of earlier views and renders; this one's is added.
    """

    def solve_and_keep(scene, settings, on_pass, cancelled, image_copies):
        geometry = geometries[layer] = build_geometry(scene, geometries.get(layer))
        return solve(scene, settings, on_pass, cancelled, image_copies=image_copies, geometry=geometry)

    return solve_and_keep
