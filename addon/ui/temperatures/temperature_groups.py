# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperature groups: the panel, and recombining a finished render for other temperatures, without new photons.

blender -b scene.blend --command infrared_recombine groups.exr out_####.exr --series temperatures.csv
"""

from __future__ import annotations

import argparse
import csv
import logging
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy.types import Operator, Panel

from ...rendering.last_render import last_render
from ...rendering.render_paths import Exporter, layer_suffixes
from ...solver.physics.spectrum import LIBRARY_MISSING
from ..panels import RenderSettingsPanel

log = logging.getLogger(__name__)

COMMAND = "infrared_recombine"
PICTURE = "Recombined"  # Blender's image of the last one
SOURCES = (
    ("CURRENT", "Current Frame", "The temperatures that the objects have now", 0),
    ("ANIMATION", "Animation", "Those of each frame of the scene's range, as they are keyed or driven", 1),
    ("SERIES", "Table", "Those in a table: a CSV file with a column for each group, in kelvin", 2),
)

Moment = tuple[int, Mapping[str, float]]  # number of a frame, and temperatures (K) by group


def last_group_files() -> dict[str, Path]:
    """The files of the last render's groups, by view layer; none without a render in this session."""
    return last_render("finished_groups")


def moments(context, source: str, series: str, known: Iterable[str]) -> Iterator[Moment]:
    """The temperatures of each frame, see SOURCES. series: path of the table. known: names of the groups.

    Raises SceneError or OSError, naming the table, for what makes no sense or cannot be read. It may change the
    scene's frame.
    """
    from ...reading.scene_reader import SceneError, read_group_temperatures
    from ...solver.image.recombine import read_series

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
        shown = scene.frame_current
        try:
            for frame in range(scene.frame_start, scene.frame_end + 1, scene.frame_step):
                scene.frame_set(frame)
                yield frame, read_group_temperatures(scene)
        finally:
            scene.frame_set(shown)


def recombine(context, groups: Path, target: str, source: str, series: str = "", pictures: bool = False) -> list[Path]:
    """Write the band images of a render for other temperatures, and show the last one as an image in Blender.

    groups: the file of its groups. target: path of the images; '####' is the number of the frame, and several frames
    get one if there is none. source, series: see `moments`. pictures: also write PNG files, as Heat Display says.
    Returns the paths of the images. Raises SceneError or OSError, naming the file, before the first image if a
    temperature is wrong; SceneError as well if a library is missing.
    """
    from ...reading.scene_reader import SceneError

    try:
        from ...heat_settings import read_scale, scene_unit
        from ...output.formats import numbered
        from ...output.group_exr import read_group_exr, write_recombined
        from ...output.heat_picture import write_picture
        from ...rendering.final_render import thermal_picture, working_primaries
    except ImportError as error:
        raise SceneError(LIBRARY_MISSING.format(error)) from error

    image, facts = read_group_exr(groups)
    wanted = list(moments(context, source, series, image.temperatures))
    told = bpy.path.abspath(series) if source == "SERIES" else groups
    for frame, temperatures in wanted:
        try:
            image.factors(temperatures)
        except SceneError as error:
            raise SceneError(f"'{told}', frame {frame}: {error}") from error
    scale, unit, paths = read_scale(context.scene.infrared), scene_unit(context.scene), []
    for frame, temperatures in wanted:
        path = numbered(bpy.path.abspath(target), ".exr", frame, len(wanted) > 1)
        temperature = write_recombined(path, image, temperatures, facts)
        if pictures:
            write_picture(path.with_suffix(".png"), temperature, scale, unit)
        log.info("%s: %s", path, ", ".join(f"{name} {kelvin:g} K" for name, kelvin in temperatures.items()))
        paths.append(path)
    _show(thermal_picture(temperature, scale, working_primaries()))
    return paths


def _show(picture) -> None:
    """Keep a picture (h, w, 4) as an image that Blender's editors can show."""
    height, width, _ = picture.shape
    shown = bpy.data.images.get(PICTURE)
    if shown is None or tuple(shown.size) != (width, height):
        if shown is not None:
            bpy.data.images.remove(shown)
        shown = bpy.data.images.new(PICTURE, width, height, float_buffer=True)
    shown.pixels.foreach_set(picture.ravel())
    shown.update()


class INFRARED_OT_recombine(Operator, Exporter):
    """Write a render's images for other temperatures of its groups, without tracing it again"""

    bl_idname = "infrared.recombine"
    bl_label = "Recombine"

    filename_ext = ".exr"
    extensions = (filename_ext,)
    filter_glob: StringProperty(default="*.exr", options={"HIDDEN"})
    source: EnumProperty(name="Temperatures", description="Where the temperatures come from", items=SOURCES)
    series: StringProperty(
        name="Table",
        description="CSV file: a line of titles (frame or time, then names of groups), then temperatures in kelvin",
        subtype="FILE_PATH",
    )
    groups: StringProperty(
        name="Groups",
        description="File of a render's groups; empty takes that of the last render",
        subtype="FILE_PATH",
    )
    pictures: BoolProperty(name="Pictures", description="Write a PNG in the colors of Heat Display, too", default=True)

    def execute(self, context):
        from ...reading.scene_reader import SceneError

        files = {"": Path(bpy.path.abspath(self.groups))} if self.groups else last_group_files()
        if not files:
            self.report({"ERROR"}, "There is no render with temperature groups yet: render one, or choose its file")
            return {"CANCELLED"}
        suffixes, paths, options = layer_suffixes(files), [], (self.source, self.series, self.pictures)
        try:
            for layer, groups in files.items():
                paths += recombine(context, groups, self.target(suffixes[layer]), *options)
        except (SceneError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{len(paths)} images written, the last one to '{paths[-1]}'")
        return {"FINISHED"}


class INFRARED_PT_temperature_groups(RenderSettingsPanel, Panel):
    bl_label = "Temperature Groups"
    bl_context = "output"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        column.prop(infrared, "group_exr_path")
        column.operator("infrared.recombine", text="Recombine...", icon="TEMP")


def command(arguments: list[str]) -> int:
    """`blender --command infrared_recombine`: the exit status."""
    from ...reading.scene_reader import SceneError

    options = parse(arguments)
    source = "SERIES" if options.series else "ANIMATION" if options.animation else "CURRENT"
    try:
        paths = recombine(bpy.context, options.groups, options.images, source, options.series or "", options.pictures)
    except (SceneError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    print(f"{len(paths)} images written, the last one to '{paths[-1]}'")
    return 0


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options of the command."""
    parser = argparse.ArgumentParser(
        prog=f"blender -b [scene.blend] --command {COMMAND}",
        description="Images of a finished render for other temperatures of its groups. Without a table the open scene "
        "says which: those of its current frame.",
    )
    parser.add_argument("groups", type=Path, help="file of the render's groups")
    parser.add_argument("images", help="band images to write; #### is the number of the frame")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--series", metavar="CSV", help="table with a column for each group, in kelvin")
    which.add_argument("--animation", action="store_true", help="the scene's frames, as temperatures are keyed")
    parser.add_argument("--pictures", action="store_true", help="also write PNG files in the scene's palette")
    return parser.parse_args(arguments)


_register, _unregister = bpy.utils.register_classes_factory((INFRARED_OT_recombine, INFRARED_PT_temperature_groups))
_handles = []


def register():
    _register()
    _handles.append(bpy.utils.register_cli_command(COMMAND, command))


def unregister():
    bpy.utils.unregister_cli_command(_handles.pop())
    _unregister()
