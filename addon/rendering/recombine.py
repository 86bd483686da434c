# SPDX-License-Identifier: GPL-3.0-or-later
"""Recombining a finished render: its images for other temperatures of its groups, without new photons."""

from __future__ import annotations

import csv
import logging
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import bpy

from ..heat_settings import read_scale, scene_unit
from ..output.formats import numbered, replaced
from ..output.group_exr import read_group_exr, write_recombined
from ..output.heat_picture import write_picture
from ..reading.groups import read_group_temperatures
from ..solver.image.recombine import read_series
from ..solver.scene import SceneError
from .painting import keep_picture, thermal_picture, working_primaries

log = logging.getLogger(__name__)

PICTURE = "Recombined"  # Blender's image of the last one

Moment = tuple[int, Mapping[str, float]]  # number of a frame, and temperatures (K) by group


def moments(context, source: str, series: str, known: Iterable[str]) -> Iterator[Moment]:
    """The temperatures of each frame.

    source: "CURRENT" takes those that the objects have now, "ANIMATION" those in each frame of the scene's range, which
    it goes through; "SERIES" those in a table, whose path is series. known: names of the groups that a table may have.
    Raises SceneError or OSError, naming the table, for what makes no sense or cannot be read.
    """
    scene = context.scene
    if source == "SERIES":
        path = Path(bpy.path.abspath(series))
        try:
            rows = read_series(path.read_text(encoding="utf-8-sig"), list(known))
        except SceneError as error:
            raise SceneError(f"'{path}': {error}") from error
        except (OSError, ValueError, csv.Error) as error:  # no file, no text, a value of more than 100,000 letters
            raise OSError(f"Cannot read the series '{path}': {error}") from error
        yield from rows
    elif source == "CURRENT":
        yield scene.frame_current, read_group_temperatures(scene)
    else:
        shown, between = scene.frame_current, scene.frame_subframe
        try:
            for frame in range(scene.frame_start, scene.frame_end + 1, scene.frame_step):
                scene.frame_set(frame)
                yield frame, read_group_temperatures(scene)
        finally:
            scene.frame_set(shown, subframe=between)


def recombine(context, groups: Path, target: str, source: str, series: str = "", pictures: bool = False) -> list[Path]:
    """Write the band images of a render for other temperatures, and show the last one as an image in Blender.

    groups: the file of its groups. target: path of the images; '####' is the number of the frame, and is added if there
    are several frames. source, series: see `moments`. pictures: also write PNG files, as Heat Display says.
    Returns the paths of the images. Raises SceneError or OSError, naming the file; before the first image is written if
    a temperature is wrong.
    """
    image, facts = read_group_exr(groups)
    wanted = list(moments(context, source, series, image.temperatures))
    told = bpy.path.abspath(series) if source == "SERIES" else groups
    for frame, temperatures in wanted:
        try:
            image.factors(temperatures)
        except SceneError as error:
            raise SceneError(f"'{told}', frame {frame}: {error}") from error
    scale, unit = read_scale(context.scene.infrared), scene_unit(context.scene)
    paths = [numbered(bpy.path.abspath(target), ".exr", frame, len(wanted) > 1) for frame, _ in wanted]
    if replaced(paths, [groups]):
        raise SceneError(f"'{groups}' is read, and would be replaced: give the images another path")
    for path, (_, temperatures) in zip(paths, wanted, strict=True):
        temperature = write_recombined(path, image, temperatures, facts)
        if pictures:
            write_picture(path.with_suffix(".png"), temperature, scale, unit)
        log.info("%s: %s", path, ", ".join(f"{name} {kelvin:g} K" for name, kelvin in temperatures.items()))
    keep_picture(PICTURE, thermal_picture(temperature, scale, working_primaries()))
    return paths
