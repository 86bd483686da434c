# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperature groups: the panel, and recombining a finished render for other temperatures, without new photons.

blender -b scene.blend --command infrared_recombine groups.exr out_####.exr --series temperatures.csv
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty
from bpy.types import Operator, Panel

from ...output.formats import layer_suffixes
from ...rendering.last_render import finished_groups
from ...rendering.render_files import group_path
from ...solver.physics.spectrum import LIBRARY_MISSING
from ...solver.scene import SceneError
from ..exporter import Exporter
from ..panel_base import RenderSettingsPanel

SOURCES = (
    ("CURRENT", "Current Frame", "The temperatures that the objects have now", 0),
    ("ANIMATION", "Animation", "Those of each frame of the scene's range, as they are keyed or driven", 1),
    ("SERIES", "Table", "Those in a table: a CSV file with a column for each group, in kelvin", 2),
)


def recombine(context, groups: Path, target: str, source: str, series: str = "", pictures: bool = False) -> list[Path]:
    """As `rendering.recombine.recombine`, which is loaded here because it needs the solver and OpenEXR.

    Raises SceneError as well if one of their libraries is missing.
    """
    try:
        from ...rendering.recombine import recombine as write_images
    except ImportError as error:
        raise SceneError(LIBRARY_MISSING.format(error)) from error
    return write_images(context, groups, target, source, series, pictures)


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

    def invoke(self, context, event):
        first_choice(context.scene, self)
        return super().invoke(context, event)

    def execute(self, context):
        files = {"": Path(bpy.path.abspath(self.groups))} if self.groups else dict(finished_groups)
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


def first_choice(scene, dialog) -> None:
    """Let the dialog of INFRARED_OT_recombine begin with the file of groups that a scene writes, if no render of this
    session has any, and with a name after it."""
    written = scene.infrared.group_exr_path and group_path(scene, "", False)
    if written and written.is_file() and not (dialog.groups or finished_groups):
        dialog.groups = scene.infrared.group_exr_path
    if written and not dialog.filepath:
        dialog.filepath = str(written.with_name(f"{written.stem}_recombined{dialog.filename_ext}"))


class INFRARED_PT_temperature_groups(RenderSettingsPanel, Panel):
    bl_label = "Temperature Groups"
    bl_context = "output"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        column.prop(infrared, "group_exr_path")
        column.operator("infrared.recombine", text="Recombine...", icon="TEMP")


def recombine_by_command(arguments: list[str]) -> int:
    """`blender --command infrared_recombine`: the exit status."""
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
        prog="blender -b [scene.blend] --command infrared_recombine",
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


register, unregister = bpy.utils.register_classes_factory((INFRARED_OT_recombine, INFRARED_PT_temperature_groups))
