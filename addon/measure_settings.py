# SPDX-License-Identifier: GPL-3.0-or-later
"""The measuring tools of a scene, in scene.infrared.measuring_tools, as the .blend keeps them."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
from bpy.app.handlers import persistent
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from .heat_settings import redraw_pictures, scale_temperature

KIND_ITEMS = (
    ("SPOT", "Spot", "The temperature of one pixel", "LAYER_ACTIVE", 0),
    ("LINE", "Line", "The temperatures along a line, with their profile", "IPO_LINEAR", 1),
    ("BOX", "Box", "The temperatures in a rectangle", "MESH_PLANE", 2),
    ("ELLIPSE", "Ellipse", "The temperatures in an ellipse", "MESH_CIRCLE", 3),
    ("POLYGON", "Polygon", "The temperatures in a polygon", "LIGHTPROBE_PLANE", 4),
)
KIND_NAMES = {item[0]: item[1] for item in KIND_ITEMS}
KIND_ICONS = {item[0]: item[3] for item in KIND_ITEMS}


class InfraredToolPoint(bpy.types.PropertyGroup):
    """A place in the picture."""

    position: FloatVectorProperty(
        name="Position",
        description="Place in the picture, as shares of its width and height from the lower left corner",
        size=2,
        min=0.0,
        max=1.0,
        update=redraw_pictures,
    )


class InfraredMeasuringTool(bpy.types.PropertyGroup):
    """A measuring tool in the pictures of a scene. A spot has one point, a line two, a box and an ellipse two opposite
    corners of the rectangle that they fill, a polygon three or more.
    """

    name: StringProperty(
        name="Name", description="What this tool is called in lists and reports", update=redraw_pictures
    )
    kind: EnumProperty(name="Kind", description="What the tool measures", items=KIND_ITEMS, default="SPOT")
    points: CollectionProperty(name="Points", description="Places in the picture", type=InfraredToolPoint)
    use_own_emissivity: BoolProperty(
        name="Own Emissivity",
        description="Correct this tool's temperatures for an emissivity and a reflected temperature of its own, not "
        "for those of the picture",
        default=False,
        update=redraw_pictures,
    )
    emissivity: FloatProperty(
        name="Emissivity",
        description="Emissivity, above 0 to 1, that this tool's temperatures are corrected for",
        default=0.95,
        min=0.001,
        max=1.0,
        precision=3,
        subtype="FACTOR",
        update=redraw_pictures,
    )
    reflected_temperature: scale_temperature(
        "Reflected Temperature",
        "Apparent temperature in kelvin of what the surfaces under this tool reflect",
        293.15,
    )

    def places(self) -> list[tuple[float, float]]:
        """(u, v) of all points."""
        return [tuple(point.position) for point in self.points]


class MeasureSettings:
    """Base of InfraredSettings: the measuring tools."""

    measuring_tools: CollectionProperty(
        name="Measuring Tools",
        description="Spots, lines and areas in which the temperatures of a render are measured",
        type=InfraredMeasuringTool,
    )
    tool_index: IntProperty(
        name="Measuring Tools", description="Number of the chosen measuring tool, from 0", min=0, update=redraw_pictures
    )
    difference_of: StringProperty(
        name="Difference of",
        description="Name of the tool from whose mean another one's is subtracted",
        update=redraw_pictures,
    )
    difference_to: StringProperty(
        name="To", description="Name of the tool whose mean is subtracted", update=redraw_pictures
    )
    show_measuring_tools: BoolProperty(
        name="Tools",
        description="Show the measuring tools over the picture, with their readings",
        default=True,
        update=redraw_pictures,
    )
    show_extremes: BoolProperty(
        name="Hot and Cold",
        description="Mark the hottest and the coldest pixel of the picture and of each area",
        default=False,
        update=redraw_pictures,
    )


def add_tool(infrared, kind: str, points: Sequence[Sequence[float]], name: str = "") -> InfraredMeasuringTool:
    """A new tool in scene.infrared, which becomes the chosen one. points: (u, v). name: else one by its kind."""
    taken = {tool.name for tool in infrared.measuring_tools}
    tool = infrared.measuring_tools.add()
    tool.name, tool.kind = _free_name(name or KIND_NAMES[kind], taken), kind
    for position in points:
        tool.points.add().position = position
    infrared.tool_index = len(infrared.measuring_tools) - 1
    return tool


def _free_name(wanted: str, taken: set[str]) -> str:
    """The name that is wanted, with a number behind it if it is taken."""
    number, name = 1, wanted
    while name in taken:
        number += 1
        name = f"{wanted} {number}"
    return name


@persistent
def convert_spots(*_) -> None:
    """The fixed spots in files of earlier versions become tools."""
    for scene in bpy.data.scenes:
        if len(scene.infrared.spots) and scene.is_editable:
            for spot in scene.infrared.spots:
                add_tool(scene.infrared, "SPOT", [spot.position])
            scene.infrared.spots.clear()


CLASSES = (InfraredToolPoint, InfraredMeasuringTool)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.app.handlers.load_post.append(convert_spots)


def unregister():
    bpy.app.handlers.load_post.remove(convert_spots)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
