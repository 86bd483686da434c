# SPDX-License-Identifier: GPL-3.0-or-later
"""The library of mixtures in Blender's window: names, what they consist of, and what a length of them lets through."""

from __future__ import annotations

from bpy.props import CollectionProperty, EnumProperty, IntProperty, StringProperty
from bpy.types import Operator, PropertyGroup, UIList

from ...reading.bands import read_band_edges
from ...solver.physics.gases import find_gas, gases
from ...solver.scene import SceneError
from ..materials.curve_previews import shown_range
from .pictures import gas_icon, mixture, mixture_icon
from .species import GasOperator, write_gas

KELVIN = (
    ("300", "300 K", "As air and breath", 0),
    ("600", "600 K", "As exhaust of engines and flue gas", 1),
    ("1000", "1000 K", "As hot exhaust", 2),
    ("1800", "1800 K", "As flames", 3),
)


class InfraredGasName(PropertyGroup):
    """One row of the browser; its built-in property `name` is the mixture's name."""


class INFRARED_UL_gases(UIList):
    """Names with small pictures."""

    def draw_item(self, context, layout, data, item, _icon, _active_data, _active_property):
        row = layout.row()
        length = context.scene.infrared.transmittance_length
        row.template_icon(mixture_icon(item.name, float(data.kelvin), length))
        row.label(text=item.name)


class INFRARED_OT_gas_library(GasOperator, Operator):
    """Use a mixture of gases of the library"""

    bl_idname = "infrared.gas_library"
    bl_label = "Gas Library"

    name: StringProperty(name="Gas", description="Name of a mixture of the library", options={"SKIP_SAVE"})
    kelvin: EnumProperty(name="Temperature", description="Of the gas in the pictures", items=KELVIN)
    names: CollectionProperty(type=InfraredGasName, options={"SKIP_SAVE"})
    index: IntProperty(options={"SKIP_SAVE"})

    def invoke(self, context, _event):
        self.names.clear()
        for name in gases():
            self.names.add().name = name
        block = self.block(context)
        current = block.get("gas") if block is not None else None
        if isinstance(current, str):
            found = [i for i, item in enumerate(self.names) if item.name.casefold() == current.strip().casefold()]
            self.index = found[0] if found else 0
        return context.window_manager.invoke_props_dialog(self, width=680, confirm_text="Use")

    def draw(self, context):
        split = self.layout.split(factor=0.45)
        left, right = split.column(), split.column()
        left.template_list("INFRARED_UL_gases", "", self, "names", self, "index", rows=13)
        if self.names:
            draw_mixture(right, self.names[self.index].name, float(self.kelvin), context.scene.infrared)
        right.prop(context.scene.infrared, "transmittance_length")
        right.row().prop(self, "kelvin", expand=True)

    def edit(self, block):
        name = self.names[self.index].name if self.names else self.name
        try:
            find_gas(name)
        except KeyError as error:
            self.report({"ERROR"}, error.args[0])
            return {"CANCELLED"}
        write_gas(block, name)
        return {"FINISHED"}


def draw_mixture(column, name: str, kelvin: float, infrared) -> None:
    """A mixture of the library as large as the browser has room for it, over the scene's bands."""
    column.label(text=name)
    draw_transmittance(column, "gas library", mixture(name, kelvin), infrared, 9.0)
    texts = column.column(align=True)
    texts.scale_y = 0.8
    for species, fraction in find_gas(name).items():
        texts.label(text=f"{species} {fraction:.4g}")


def draw_transmittance(column, icon: str, medium, infrared, scale: float) -> None:
    """A picture of what the length of the panels lets through of the light, and what it shows; nothing without bands.

    icon: its name, see curve_icon. scale: its size.
    """
    try:
        edges = read_band_edges(infrared)
    except SceneError:  # the panel of the bands reports it
        return
    length = infrared.transmittance_length
    column.template_icon(gas_icon(icon, medium, length, edges), scale=scale)
    low, high = shown_range(edges)
    row = column.row()
    row.alignment, row.active = "CENTER", False
    row.label(text=f"{low:.3g} to {high:.3g} µm, bands shaded; 0 to 1, {length:.4g} m at {medium.temperature:.4g} K")


CLASSES = InfraredGasName, INFRARED_UL_gases, INFRARED_OT_gas_library
