# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels of gas: of a material that fills closed meshes, and of the air of the world."""

from __future__ import annotations

import bpy
from bpy.types import Panel

from ...reading.custom_properties import read_temperature
from ...reading.media import is_medium, read_gas_alone, read_pressure
from ...reading.world import air_temperature
from ...rendering.checks import material_checks, world_gas_checks
from ...solver.scene import SOOT, SceneError
from ..checks import draw_problems, kept
from ..panels import MaterialPanel, WorldPanel, draw_custom_property, draw_name, draw_spectrum, draw_text
from . import gas_library, species
from .gas_library import draw_transmittance
from .species import SPECIES, fractions, unit_of


class INFRARED_PT_gas(MaterialPanel, Panel):
    bl_label = "Gas"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, material, scene = self.column(), context.material, context.scene
        if is_medium(material):
            column.label(text="Fills closed meshes, and is no surface", icon="INFO")
        draw_gas(column, material, "MATERIAL")
        if is_medium(material):
            key = f"gas of {material.session_uid}"
            draw_problems(column, kept(scene, key, lambda: material_checks(material, scene.infrared)), context.region)


class INFRARED_PT_world_gas(WorldPanel, Panel):
    bl_label = "Air"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column, world, scene = self.column(), context.world, context.scene
        draw_gas(column, world, "WORLD")
        draw_custom_property(column, world, "WORLD", "pressure", "101325 Pa (1 atm)")
        draw_custom_property(column, world, "WORLD", "depth", "0 m (none before the sky)")
        key = f"gas of {world.session_uid}"
        draw_problems(column, kept(scene, key, lambda: world_gas_checks(world, scene.infrared)), context.region)


class INFRARED_PT_gas_transmittance(MaterialPanel, Panel):
    bl_label = "Transmittance"
    bl_parent_id = "INFRARED_PT_gas"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and is_medium(context.material)

    def draw(self, context):
        obj, ambient = context.object, context.scene.infrared.ambient_temperature

        def kelvin() -> float:
            return ambient if obj is None else read_temperature(obj, ambient, obj.name)

        draw_picture(self.column(), context.material, obj, kelvin, context.scene.infrared)


class INFRARED_PT_world_transmittance(WorldPanel, Panel):
    bl_label = "Transmittance"
    bl_parent_id = "INFRARED_PT_world_gas"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and is_medium(context.world)

    def draw(self, context):
        world = context.world
        draw_picture(self.column(), world, world, lambda: air_temperature(world), context.scene.infrared)


def draw_picture(column, block, holder, kelvin, infrared) -> None:
    """What a length of a gas lets through, and the length; no picture if a value makes no sense: the checks tell.

    block: the material or world. holder: object or world whose pressure counts, None for 1 atm. kelvin: a function
    that reads the temperature.
    """
    try:
        pressure = {} if holder is None else {"pressure": read_pressure(holder, holder.name)}
        medium = read_gas_alone(block, block.name, kelvin(), **pressure)
    except SceneError:
        return
    draw_transmittance(column, f"gas {block.session_uid}", medium, infrared, 8.0)
    column.prop(infrared, "transmittance_length")


def draw_gas(column, block, owner: str) -> None:
    """What a gas absorbs and scatters, 1/m, and what it consists of. owner: see operators.OWNERS."""
    for key, without in (("absorption", "0 (none)"), ("scattering", "0 (none)"), ("anisotropy", "0 (evenly)")):
        value = block.get(key)
        if value is None or isinstance(value, float | int):
            draw_custom_property(column, block, owner, key, without)
        else:
            draw_spectrum(column, value, owner, key)
    rows = column.column(align=True)
    draw_species(rows, block, owner)
    row = rows.row(align=True)
    row.operator("infrared.gas_library", text="From Library...", icon="VIEWZOOM").owner = owner
    row.operator_menu_enum("infrared.species_set", "species", text="Add Species", icon="ADD").owner = owner


def draw_species(column, block, owner: str) -> None:
    """The mixture by its name, or a row for each species: a click changes it, x removes it."""
    value, listed = block.get("gas"), fractions(block)
    if value is None:
        draw_text(column.row(align=True), "gas", "No molecules, no soot")
        return
    known = {identifier for identifier, *_ in SPECIES}
    if not listed or not set(listed) <= known or not all(isinstance(each, int | float) for each in listed.values()):
        text = value if isinstance(value, str) else "No mixture, or unknown species"
        row = draw_text(column.row(align=True), "gas", text)
        if isinstance(value, str):
            row.operator("infrared.species_make", text="", icon="PRESET").owner = owner
        remove = row.operator("infrared.property_remove", text="", icon="X")
        remove.owner, remove.key = owner, "gas"
        return
    for name, fraction in listed.items():
        row, (size, unit) = draw_name(column.row(align=True), "Soot" if name == SOOT else name), unit_of(name)
        change = row.operator("infrared.species_set", text=f"{fraction / size:.6g} {unit}")
        remove = row.operator("infrared.species_remove", text="", icon="X")
        for each in (change, remove):
            each.owner, each.species = owner, name


CLASSES = (
    *species.CLASSES,
    *gas_library.CLASSES,
    INFRARED_PT_gas,
    INFRARED_PT_gas_transmittance,
    INFRARED_PT_world_gas,
    INFRARED_PT_world_transmittance,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
