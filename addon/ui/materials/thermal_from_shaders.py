# SPDX-License-Identifier: GPL-3.0-or-later
"""Give a scene made for visible light thermal values, after its list of them was looked at."""

from __future__ import annotations

import textwrap

from bpy.props import BoolProperty, CollectionProperty, EnumProperty, IntProperty, StringProperty
from bpy.types import Operator, PropertyGroup, UIList
from bpy.utils import register_classes_factory

from ...heat_settings import in_scene_unit
from ...interface import redraw
from ...properties import add_custom_property, property_label, set_custom_property
from ...reading.objects import layers_objects
from ...reading.shader_proposals import FORGOTTEN, Proposal, nothing_material, proposals

ICONS = {"Material": "MATERIAL", "Object": "OBJECT_DATA", "World": "WORLD"}  # by the type of what is to change
WIDTH = 1040  # of the dialog, in pixels at Blender's usual resolution
REASON_WIDTH = 150  # characters of a line of text in the dialog
REASON_LINES = 3  # of room for a reason, so that the dialog keeps its height
ROWS = 14


class InfraredProposal(PropertyGroup):
    """One row of the list; its built-in property `name` is the name of a material, an object or the world."""

    key: StringProperty()
    kind: StringProperty()
    use: BoolProperty(name="Set", description="Set these values", default=True)
    values: StringProperty()
    reason: StringProperty()


class INFRARED_UL_proposals(UIList):
    """What is to be set where; rows without values tell why there are none."""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property):
        row = layout.row(align=True)
        if item.values:
            row.prop(item, "use", text="")
        else:
            row.label(text="", icon="CANCEL")
        split = row.split(factor=0.24)
        split.active = bool(item.values) and item.use
        split.label(text=item.name, icon=ICONS.get(item.kind, "NONE"), translate=False)
        split = split.split(factor=0.5)
        split.label(text=item.values or "Nothing", translate=False)
        reason = split.row()
        reason.active = False
        reason.label(text=item.reason.partition(". ")[0], translate=False)  # all of it stands below the list


def find_proposals(scope: str, context) -> list[Proposal]:
    """What the selected objects ("SELECTED") lack, or all that is rendered and its surroundings ("SCENE")."""
    layers = context.scene.view_layers if scope == "SCENE" else ()
    objects = layers_objects(layers) if layers else context.selected_objects
    return proposals(objects, layers, context.scene, context.evaluated_depsgraph_get())


def list_proposals(operator, context) -> None:
    """Fill the list of an operator, or of its properties in its dialog, anew."""
    operator.rows.clear()
    operator.index = 0
    for proposal in find_proposals(operator.scope, context):
        row = operator.rows.add()
        row.name, row.key = proposal.block.name, proposal.key
        row.kind, row.reason = proposal.block.bl_rna.identifier, proposal.reason
        row.values = values_text(proposal, context.scene)


def values_text(proposal: Proposal, scene) -> str:
    """The values of a proposal as a line of text; an empty one without any."""
    return ",  ".join(f"{property_label(key)} {_shown(key, value, scene)}" for key, value in proposal.values.items())


def _shown(key: str, value, scene) -> str:
    if isinstance(value, str):
        return f"'{value}'"
    if not isinstance(value, float):
        return f"Image '{value.name}'"
    return in_scene_unit(value, scene) if key == "temperature" else f"{value:.3g}"


class INFRARED_OT_thermal_from_shaders(Operator):
    """Propose thermal values for a scene made for visible light, by its shaders and names. What is set stays"""

    bl_idname = "infrared.thermal_from_shaders"
    bl_label = "Thermal from Shaders"
    bl_options = {"REGISTER", "UNDO"}

    scope: EnumProperty(
        name="For",
        items=(
            ("SCENE", "Whole Scene", "All that is rendered, and the surroundings", 0),
            ("SELECTED", "Selected Objects", "The selected objects and their materials", 1),
        ),
        update=list_proposals,
    )
    rows: CollectionProperty(type=InfraredProposal, options={"SKIP_SAVE"})
    index: IntProperty(options={"SKIP_SAVE"})

    def invoke(self, context, _event):
        list_proposals(self, context)
        return context.window_manager.invoke_props_dialog(self, width=WIDTH, confirm_text="Set Values")

    def draw(self, _context):
        layout = self.layout
        layout.row().prop(self, "scope", expand=True)
        if not self.rows:
            layout.label(text="Nothing is missing: all of it has values", icon="CHECKMARK")
            return
        layout.template_list("INFRARED_UL_proposals", "", self, "rows", self, "index", rows=ROWS, maxrows=ROWS)
        texts = layout.column(align=True)
        texts.scale_y = 0.8
        lines = textwrap.wrap(self.rows[min(self.index, len(self.rows) - 1)].reason, REASON_WIDTH)
        for line in (lines + [""] * REASON_LINES)[:REASON_LINES]:
            texts.label(text=line, translate=False)

    def execute(self, context):
        shown = {row.key: row.use for row in self.rows}  # none where a script calls: then all are meant
        found = find_proposals(self.scope, context)
        chosen = [each for each in found if each.values and shown.get(each.key, not shown)]
        for proposal in chosen:
            for key, value in proposal.values.items():
                set_property = add_custom_property if isinstance(value, float) else set_custom_property
                set_property(proposal.block, key, nothing_material() if key == "mix_material" else value)
            proposal.block.update_tag()
        left = [each for each in found if not each.values]
        redraw("PROPERTIES")
        lost = any(each.block.override_library is not None for each in chosen)
        text = outcome(chosen, left) + (f". {FORGOTTEN}" if lost else "")
        self.report({"WARNING"} if left or lost else {"INFO"}, text)
        return {"FINISHED"} if chosen else {"CANCELLED"}


def outcome(chosen: list[Proposal], left: list[Proposal]) -> str:
    """What was done, as a message: of proposals that were set, and of those that had no values."""
    counts = {kind: sum(each.block.bl_rna.identifier == kind for each in chosen) for kind in ICONS}
    done = [f"{count} {kind.lower()}{'s' if count > 1 else ''}" for kind, count in counts.items() if count]
    text = f"Values set for {', '.join(done)}" if done else "Nothing was set"
    if left:
        names = ", ".join(f"'{each.block.name}'" for each in left[:3]) + (", ..." if len(left) > 3 else "")
        text += f"; not for {names}: {left[0].reason}" if len(left) == 1 else f"; nothing for {names}"
    elif not done:
        text += ": nothing was missing"
    return text


register, unregister = register_classes_factory(
    (
        InfraredProposal,
        INFRARED_UL_proposals,
        INFRARED_OT_thermal_from_shaders,
    )
)
