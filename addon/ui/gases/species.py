# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows of species: what the gas of a material or a world consists of, and operators that edit it.

All of it lives in the custom property `gas` alone: the name of a mixture, or fractions by species, and of droplets and
particles g/m3.
"""

from __future__ import annotations

from bpy.props import EnumProperty, FloatProperty
from bpy.types import Operator

from ...interface import redraw
from ...properties import set_custom_property
from ...solver.physics.aerosols import aerosols
from ...solver.physics.gases import find_gas
from ...solver.scene import MOLECULES, SOOT

PPM = 1e-6
OWNERS = (
    ("MATERIAL", "Material", "The active material", 0),
    ("WORLD", "World", "The scene's world", 1),
)
SPECIES = (
    ("H2O", "Water Vapour", "Mole fraction of water vapour", 0),
    ("CO2", "Carbon Dioxide", "Mole fraction of carbon dioxide", 1),
    ("CO", "Carbon Monoxide", "Mole fraction of carbon monoxide", 2),
    ("CH4", "Methane", "Mole fraction of methane", 3),
    (SOOT, "Soot", "Volume fraction of soot", 4),
    *((name, name, "Mass in g/m³", 5 + i) for i, name in enumerate(aerosols())),
)
NEW = (
    dict.fromkeys(MOLECULES, 0.01) | {SOOT: 1e-7} | dict.fromkeys(aerosols(), 0.1)
)  # amounts that a new row begins with


def unit_of(name: str) -> tuple[float, str]:
    """The unit in which amounts of a species are shown, as a number and as text."""
    return (1.0, "g/m³") if name in aerosols() else (PPM, "ppm")


def fractions(block) -> dict | None:
    """Fractions by species of a gas, right or wrong; None if it is no such list."""
    value = block.get("gas")
    return value.to_dict() if hasattr(value, "to_dict") else None


def write_gas(block, value: str | dict[str, float]) -> None:
    """Set what a gas consists of, let Blender evaluate it and draw the panels that may show it; nothing removes it."""
    if value:
        set_custom_property(block, "gas", value)
    else:
        block.pop("gas", None)
    block.update_tag()
    redraw("PROPERTIES")


class GasOperator:
    """Base of operators on the gas of the material or the world in the panel."""

    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    owner: EnumProperty(name="Owner", items=OWNERS, options={"HIDDEN"})

    def block(self, context):
        """The material or world, None if there is none that can be edited."""
        found = getattr(context, self.owner.lower(), None)
        if found is None:
            found = context.scene.world if self.owner == "WORLD" else getattr(context.object, "active_material", None)
        return found if found is not None and found.is_editable else None

    def execute(self, context):
        block = self.block(context)
        if block is None:
            self.report({"ERROR"}, f"There is no editable {self.owner.lower()} here")
            return {"CANCELLED"}
        return self.edit(block)


class INFRARED_OT_species_set(GasOperator, Operator):
    """Give the gas this species, or change how much of it there is. A mixture of the library becomes a list"""

    bl_idname = "infrared.species_set"
    bl_label = "Add Species"

    species: EnumProperty(name="Species", items=SPECIES)
    amount: FloatProperty(
        name="Amount",
        description="Millionths: mole fraction of a molecule, volume fraction of soot. Of droplets and particles g/m³",
        default=10_000.0,
        min=0.0,
        max=1e6,
        precision=4,
        step=1000,
    )

    def invoke(self, context, _event):
        block = self.block(context)
        known = _as_list(block) if block is not None else {}
        fraction = known.get(self.species)
        self.amount = (fraction if isinstance(fraction, int | float) else NEW[self.species]) / unit_of(self.species)[0]
        return context.window_manager.invoke_props_dialog(self)

    def draw(self, _context):
        self.layout.prop(self, "species")
        self.layout.prop(self, "amount", text="Mass (g/m³)" if self.species in aerosols() else "Fraction (ppm)")

    def edit(self, block):
        fraction = (
            float(f"{self.amount:.7g}") * unit_of(self.species)[0]
        )  # what the dialog shows, not what float32 adds
        write_gas(block, _as_list(block) | {self.species: float(f"{fraction:.9g}")})
        return {"FINISHED"}


class INFRARED_OT_species_remove(GasOperator, Operator):
    """Remove this species from the gas"""

    bl_idname = "infrared.species_remove"
    bl_label = "Remove Species"

    species: EnumProperty(name="Species", items=SPECIES)

    def edit(self, block):
        write_gas(block, {name: value for name, value in _as_list(block).items() if name != self.species})
        return {"FINISHED"}


class INFRARED_OT_species_make(GasOperator, Operator):
    """Turn the mixture of the library into a list of its species"""

    bl_idname = "infrared.species_make"
    bl_label = "Edit as Species"

    def edit(self, block):
        found = _as_list(block)
        if not found:
            self.report({"ERROR"}, f"The library has no gas '{block.get('gas')}'")
            return {"CANCELLED"}
        write_gas(block, found)
        return {"FINISHED"}


def _as_list(block) -> dict:
    """Fractions by species of a gas, also of one that has the name of a mixture; empty for what is neither."""
    if isinstance(block.get("gas"), str):
        try:
            return find_gas(block["gas"])
        except KeyError:
            return {}
    return fractions(block) or {}


CLASSES = INFRARED_OT_species_set, INFRARED_OT_species_remove, INFRARED_OT_species_make
