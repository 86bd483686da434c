# SPDX-License-Identifier: GPL-3.0-or-later
"""Load the meshes of a time series, as `convert` writes them, as one mesh whose temperatures change with the frame.

The mesh keeps the temperatures of each step as an attribute. Geometry nodes mix those of two neighbouring steps into
the attribute `temperature`, at the step that a keyed value says. So any frame and subframe has its temperatures without
handlers, drivers and files, also in Blender without a window.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from bpy.props import CollectionProperty, EnumProperty, FloatProperty, IntProperty, StringProperty
from bpy.types import Operator, OperatorFileListElement
from bpy.utils import register_classes_factory
from bpy_extras.io_utils import ImportHelper

from ...convert import by_number
from ...reading.arrays import read_values
from ...reading.surface_temperature import NAME
from ...reading.temperature_fields import TemperatureError, check_kelvin

GROUP = "Temperature Series"  # name of the modifier and of its nodes
STEP = "Step"  # label of the node with the keyed value
_HEADER = 1 << 12  # bytes of a file in which its comments are looked for


class SeriesError(ValueError):
    """A series cannot be loaded; the message names the file and says why."""


def import_step(path: Path):
    """A new object of a PLY file and its temperatures, (vertices,) float32 K. Raises SeriesError."""
    before = set(bpy.data.objects)
    try:
        bpy.ops.wm.ply_import(filepath=str(path), import_attributes=True)
    except RuntimeError as error:
        raise SeriesError(f"'{path.name}': {str(error).strip()}") from None
    new = [obj for obj in bpy.data.objects if obj not in before]
    try:
        if not new:
            raise SeriesError(f"'{path.name}' holds no mesh")
        attribute = new[0].data.attributes.get(NAME)
        if attribute is None or (attribute.data_type, attribute.domain) != ("FLOAT", "POINT"):
            raise SeriesError(f"'{path.name}' has no property '{NAME}' at its vertices")
        kelvin = read_values(attribute.data, "value", np.float32)
        check_kelvin(kelvin, f"'{path.name}'")
    except (SeriesError, TemperatureError) as error:
        remove(new)
        raise SeriesError(str(error)) from None
    return new[0], kelvin


def remove(objects: Sequence) -> None:
    """Delete objects that were just imported, with their meshes."""
    for obj in objects:
        mesh = obj.data
        bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(mesh)


def load_series(paths: Sequence[Path]):
    """One object with the temperatures of all steps. It is that of the first file. Raises SeriesError if a file has
    none, or another mesh; nothing is left then."""
    obj, kelvin = import_step(paths[0])
    try:
        shape = topology(obj.data)
        _store(obj.data, 1, kelvin)
        for number, path in enumerate(paths[1:], 2):
            other, kelvin = import_step(path)
            same = all(map(np.array_equal, shape, topology(other.data)))
            remove([other])
            if not same:
                raise SeriesError(f"'{path.name}' has another mesh than '{paths[0].name}', not only other temperatures")
            _store(obj.data, number, kelvin)
    except SeriesError:
        remove([obj])
        raise
    return obj


def topology(mesh) -> tuple[np.ndarray, np.ndarray]:
    """What steps of a series have in common: the vertices of all corners, and the first corner of each face."""
    return read_values(mesh.loops, "vertex_index", np.int32), read_values(mesh.polygons, "loop_start", np.int32)


def _store(mesh, number: int, kelvin: np.ndarray) -> None:
    mesh.attributes.new(f"{NAME}_{number}", "FLOAT", "POINT").data.foreach_set("value", kelvin)


def series_nodes(steps: int):
    """New geometry nodes that set the attribute of temperatures to that of a step from 1 to `steps`, mixed between two,
    which the node STEP says."""
    group = bpy.data.node_groups.new(GROUP, "GeometryNodeTree")
    group.is_modifier = True
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")

    def node(kind: str, column: int, row: int, **settings):
        made = group.nodes.new(kind)
        made.location = 180.0 * column, -160.0 * row
        for name, value in settings.items():
            setattr(made, name, value)
        return made

    def joined(made, *sources):
        for i, source in enumerate(sources):
            if isinstance(source, (int, float)):
                made.inputs[i].default_value = source
            else:
                group.links.new(source, made.inputs[i])
        return made.outputs[0]

    def math(operation: str, column: int, row: int, *sources):
        return joined(node("ShaderNodeMath", column, row, operation=operation), *sources)

    def temperatures(number, row: int):
        """The field of the step of this number."""
        text = node("FunctionNodeValueToString", 4, row, data_type="INT")
        join, prefix = node("GeometryNodeStringJoin", 5, row), node("FunctionNodeInputString", 4, row + 1)
        prefix.string = f"{NAME}_"
        whole = joined(node("FunctionNodeFloatToInt", 3, row, rounding_mode="ROUND"), number)
        group.links.new(joined(text, whole), join.inputs["Strings"])
        group.links.new(prefix.outputs[0], join.inputs["Strings"])  # the last link comes first
        return joined(node("GeometryNodeInputNamedAttribute", 6, row, data_type="FLOAT"), join.outputs[0])

    step = node("ShaderNodeValue", -1, 1, name=STEP, label=STEP).outputs[0]
    step.default_value = 1.0
    low = math("MINIMUM", 2, 1, math("MAXIMUM", 1, 1, math("FLOOR", 0, 1, step), 1.0), float(steps))
    high = math("MINIMUM", 3, 3, math("ADD", 2, 3, low, 1.0), float(steps))
    share = math("SUBTRACT", 3, 5, step, low)
    mix = node("ShaderNodeMix", 7, 1, data_type="FLOAT", clamp_factor=True)
    store = node("GeometryNodeStoreNamedAttribute", 8, 0, data_type="FLOAT", domain="POINT")
    store.inputs["Name"].default_value = NAME
    for source, target in zip((share, temperatures(low, 1), temperatures(high, 3)), (0, 2, 3), strict=True):
        group.links.new(source, mix.inputs[target])
    group.links.new(mix.outputs[0], store.inputs["Value"])
    group.links.new(node("NodeGroupInput", -1, 0).outputs[0], store.inputs["Geometry"])
    group.links.new(store.outputs[0], node("NodeGroupOutput", 9, 0).inputs[0])
    return group


def key_steps(group, frames: Sequence[float]) -> None:
    """Key the value STEP of series_nodes: step i at frames[i - 1], linear between."""
    socket = group.nodes[STEP].outputs[0]
    for number, frame in enumerate(frames, 1):
        socket.default_value = float(number)
        socket.keyframe_insert("default_value", frame=frame)
    animation = group.animation_data
    (curve,) = animation.action.layers[0].strips[0].channelbag(animation.action_slot).fcurves
    for point in curve.keyframe_points:
        point.interpolation = "LINEAR"
    curve.update()


def told_time(path: Path) -> float | None:
    """Time of a file's step, s, from the comment that `convert` writes; None if there is none."""
    with path.open("rb") as file:
        found = re.search(rb"^comment time (\S+)\s*$", file.read(_HEADER).partition(b"end_header")[0], re.MULTILINE)
    try:
        return float(found[1]) if found else None
    except ValueError:
        return None


class INFRARED_OT_temperature_series(ImportHelper, Operator):
    """Load PLY files of one mesh at several times as an object whose temperatures change with the frame"""

    bl_idname = "infrared.temperature_series"
    bl_label = "Load Temperature Series"
    bl_options = {"REGISTER", "UNDO"}

    filename_ext = ".ply"
    filter_glob: StringProperty(default="*.ply", options={"HIDDEN"})
    files: CollectionProperty(type=OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    frame_start: IntProperty(name="Start Frame", description="Frame of the first step", default=1)
    spacing: EnumProperty(
        name="Spacing",
        description="At which frames the steps are",
        items=(
            ("FRAMES", "Frames", "All steps are as many frames apart"),
            ("TIMES", "Times", "Steps are at the times that their files tell, at the frame rate of the scene"),
        ),
    )
    frames_per_step: FloatProperty(
        name="Frames per Step", description="Between two files", default=1.0, min=0.01, soft_max=100.0
    )
    speed: FloatProperty(
        name="Speed", description="Seconds of the simulation in a second of the animation", default=1.0, min=1e-6
    )

    def draw(self, _context):
        column = self.layout.column()
        column.use_property_split = True
        column.prop(self, "frame_start")
        column.prop(self, "spacing")
        column.prop(self, "frames_per_step" if self.spacing == "FRAMES" else "speed")

    def execute(self, context):
        names = [each.name for each in self.files if each.name]
        paths = [Path(self.directory, name) for name in names] or [Path(self.filepath)]
        paths.sort(key=lambda path: by_number(path.name))
        try:
            frames = self._frames(paths, context.scene.render)
            obj = load_series(paths)
        except (SeriesError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        modifier = obj.modifiers.new(GROUP, "NODES")
        modifier.node_group = series_nodes(len(paths))
        key_steps(modifier.node_group, frames)
        obj.name = re.sub(r"[\d_#]+$", "", paths[0].stem) or paths[0].stem
        obj.select_set(True)
        context.view_layer.objects.active = obj
        self.report({"INFO"}, f"'{obj.name}': {len(paths)} steps from frame {frames[0]:g} to {frames[-1]:g}")
        return {"FINISHED"}

    def _frames(self, paths: Sequence[Path], render) -> list[float]:
        """The frame of each file. Raises SeriesError, naming a file that does not tell its time."""
        if self.spacing == "FRAMES":
            return [self.frame_start + i * self.frames_per_step for i in range(len(paths))]
        times = [told_time(path) for path in paths]
        if None in times:
            raise SeriesError(f"'{paths[times.index(None)].name}' does not tell its time")
        if any(later <= earlier for earlier, later in zip(times, times[1:], strict=False)):
            raise SeriesError(f"The times of the files do not grow from '{paths[0].name}' to '{paths[-1].name}'")
        rate = render.fps / render.fps_base / self.speed
        return [self.frame_start + (time - times[0]) * rate for time in times]


def draw_import_menu(self, _context):
    """The entry in Blender's menu File > Import."""
    self.layout.operator(INFRARED_OT_temperature_series.bl_idname, text="Temperature Series (.ply)")


_register, _unregister = register_classes_factory((INFRARED_OT_temperature_series,))


def register():
    _register()
    bpy.types.TOPBAR_MT_file_import.append(draw_import_menu)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(draw_import_menu)
    _unregister()
