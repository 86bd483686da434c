# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the demo: an emissive mirror ring on a diffuse plane, and the caustic that a point light throws into it.

Writes to the output folder:
    demo.exr        every pass, Blender's multilayer OpenEXR
    demo-bands.exr  every band with its edges and units, the add-on's own OpenEXR
    demo.png        the apparent temperature in the scene's palette, with a colour bar
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import bpy
import numpy as np
import OpenEXR

from addon.heat_settings import read_scale, scene_unit
from addon.output.exr import channel_name
from addon.output.heat_picture import write_picture
from addon.rendering.render_job import process_memory
from docs.tools.blender import open_demo, registered
from docs.tools.paths import ROOT


def main(arguments: list[str] | None = None) -> None:
    """Render as the command line says; leaves with a message if that fails."""
    options = parse(arguments)
    try:
        with registered():
            options.output.mkdir(parents=True, exist_ok=True)
            scene = open_demo()
            seconds = render(scene, options)
            header, temperature, noise = read(options.output / "demo-bands.exr")
            write_picture(options.output / "demo.png", temperature, read_scale(scene.infrared), scene_unit(scene))
    except (OSError, RuntimeError) as error:  # Blender raises what an engine reports as RuntimeError
        sys.exit(str(error))
    print(
        f"{int(header['passes'])} passes, {int(header['photons']):,} photons, {seconds:.1f} s, "
        f"{process_memory():.0f} MB at most (with Blender), "
        f"noise {np.median(noise):.3f} K (median), {np.percentile(noise, 95):.3f} K (95 % of the pixels are below)"
    )


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """The options; None stands for what the demo's file says."""
    parser = argparse.ArgumentParser(
        prog="run.py demo", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--passes", type=positive, help="number of passes")
    parser.add_argument("--photons", type=positive, help="photons in each pass")
    parser.add_argument("--resolution", type=resolution, metavar="WIDTHxHEIGHT", help="pixels, such as 320x240")
    parser.add_argument("--output", type=Path, default=ROOT / "render", help="folder, made if need be (%(default)s)")
    options = parser.parse_args(arguments)
    options.output = options.output.resolve()
    return options


def positive(text: str) -> int:
    """A whole number above 0."""
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"{number} is not above 0")
    return number


def resolution(text: str) -> tuple[int, int]:
    """Width and height in pixels of '320x240'."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) > 0 and int(height) > 0):
        raise argparse.ArgumentTypeError(f"'{text}' is not a width and a height such as 320x240")
    return int(width), int(height)


def render(scene, options: argparse.Namespace) -> float:
    """Render the scene as F12 does and write both EXR files; returns the seconds it took."""
    infrared, picture = scene.infrared, scene.render
    infrared.passes = options.passes or infrared.passes
    infrared.photons_per_pass = options.photons or infrared.photons_per_pass
    if options.resolution:
        picture.resolution_x, picture.resolution_y = options.resolution
    infrared.band_exr_path = str(options.output / "demo-bands.exr")
    picture.filepath = str(options.output / "demo.exr")
    if hasattr(picture.image_settings, "media_type"):  # Blender 5.0 and later
        picture.image_settings.media_type = "MULTI_LAYER_IMAGE"
    picture.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    picture.image_settings.color_depth = "32"
    begin = time.monotonic()
    bpy.ops.render.render(write_still=True)
    return time.monotonic() - begin


def read(path: Path) -> tuple[dict, np.ndarray, np.ndarray]:
    """Header, apparent temperature and noise (h, w) in K, row 0 at the bottom, of a band EXR."""
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        temperature, noise = (channels[channel_name(name)].pixels[::-1] for name in ("Temperature", "Noise"))
        return dict(file.header()), temperature, noise  # a copy: closing the file empties its own


if __name__ == "__main__":
    main()
