# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels in Blender's Properties editor, and Blender's own panels that stay with this engine."""

from __future__ import annotations

import bpy
from bpy.types import Panel

from ..heat_settings import in_scene_unit
from ..interface import ENGINE
from ..properties import initial_value, property_label
from ..reading.custom_properties import describe, is_number
from ..reading.images import is_image
from ..reading.media import is_medium
from ..reading.objects import STRAND_TYPES, SURFACE_TYPES
from ..reading.strands import path_systems
from ..reading.surface_temperature import DOMAINS, temperature_source, usable_attribute
from ..reading.visibility import RAYS
from ..reading.world import SKY_KEYS
from ..rendering.checks import band_problem, find_bands, holds_gas, material_checks, settings_checks
from ..rendering.render_passes import CRYPTOMATTE_SWITCHES, LAYER_SWITCHES, SCENE_SWITCHES
from .band_presets import INFRARED_PT_band_presets
from .checks import draw_object_checks, draw_problems, kept
from .image_lookup import lookup_text
from .panel_base import InfraredPanel, RenderSettingsPanel
from .temperatures import heat_map

EDGES_A_LINE, EDGE_LINES = 6, 6  # of adaptive bands that the panel shows

# Blender's panels for every engine are marked BLENDER_RENDER; these do nothing here, or ours stand in their place.
REPLACED_PANELS = {"DATA_PT_light", "DATA_PT_preview", "NODE_DATA_PT_light", "NODE_DATA_PT_spot", "OBJECT_PT_shading"}
# These are marked for some engines only, but serve this one too.
SHARED_PANELS = {
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "VIEWLAYER_PT_override",
}


class INFRARED_PT_photons(RenderSettingsPanel, Panel):
    bl_label = "Photons"

    def draw_settings(self, column, infrared):
        column.prop(infrared, "passes")
        column.prop(infrared, "photons_per_pass")
        column.prop(infrared, "neighbours")
        column.separator()
        column.prop(infrared, "time_limit")
        column.prop(infrared, "target_noise")
        draw_problems(column, settings_checks(infrared), bpy.context.region)


class INFRARED_PT_photons_advanced(RenderSettingsPanel, Panel):
    bl_label = "Advanced"
    bl_parent_id = "INFRARED_PT_photons"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        column.prop(infrared, "seed")
        column.prop(infrared, "pass_offset")
        column.prop(infrared, "threads")
        column.prop(infrared.id_data.render, "use_persistent_data")  # Blender shows it for Cycles alone
        column.separator()
        column.prop(infrared, "reference_subtraction")
        column.prop(infrared, "shrink")
        column.prop(infrared, "roulette")


class INFRARED_PT_motion_blur(RenderSettingsPanel, Panel):
    """Blender's own panel of this name is EEVEE's, with EEVEE's settings in it."""

    bl_label = "Motion Blur"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw_settings(self, column, infrared):
        render = infrared.id_data.render
        shutter = column.column()
        shutter.active = render.use_motion_blur
        shutter.prop(render, "motion_blur_position", text="Position")
        shutter.prop(render, "motion_blur_shutter")
        steps = column.row()
        steps.active = render.use_motion_blur or infrared.sensor_lag > 0.0
        steps.prop(infrared, "motion_steps")


class INFRARED_PT_spectrum(RenderSettingsPanel, Panel):
    bl_label = "Spectrum"

    def draw_header_preset(self, _context):
        INFRARED_PT_band_presets.draw_panel_header(self.layout)

    def draw_settings(self, column, infrared):
        column.prop(infrared, "band_mode")
        adaptive = infrared.band_mode == "ADAPTIVE"
        if infrared.band_mode == "CUSTOM":
            column.prop(infrared, "band_edges")
        else:
            limits = column.column(align=True)
            limits.prop(infrared, "wavelength_min")
            limits.prop(infrared, "wavelength_max")
            count = column.row()
            count.active = not adaptive or infrared.band_tolerance == 0
            count.prop(infrared, "band_count")
        if adaptive:
            column.prop(infrared, "band_tolerance")
            draw_chosen_bands(column, infrared)
            return
        problem = band_problem(infrared)
        if problem:
            column.label(text=problem, icon="ERROR")


class INFRARED_PT_defaults(RenderSettingsPanel, Panel):
    bl_label = "Where Nothing Is Set"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        column.prop(infrared, "ambient_temperature", text="Temperature")
        column.prop(infrared, "default_emissivity")


class INFRARED_PT_film(RenderSettingsPanel, Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.column().prop(context.scene.render, "film_transparent", text="Transparent")


class INFRARED_PT_output(RenderSettingsPanel, Panel):
    bl_label = "Band Images"
    bl_context = "output"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        column.prop(infrared, "band_exr_path")
        formats = column.column(align=True)
        formats.active = bool(infrared.band_exr_path)
        formats.prop(infrared, "file_formats")
        column.operator("infrared.export_bands", text="Export Last Render...", icon="EXPORT")
        column.operator("infrared.sensor_image", text="Sensor Image Nodes...", icon="NODETREE")


class INFRARED_PT_passes(InfraredPanel, Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, _context):
        pass  # others are inside


class INFRARED_PT_passes_data(InfraredPanel, Panel):
    bl_label = "Data"
    bl_context = "view_layer"
    bl_parent_id = "INFRARED_PT_passes"

    def draw(self, context):
        self.layout.use_property_decorate = False
        column = self.column(heading="Include", align=True)
        for owner, switches in ((context.scene.infrared, SCENE_SWITCHES), (context.view_layer, LAYER_SWITCHES)):
            for switch, _ in switches.values():
                column.prop(owner, switch)


class INFRARED_PT_passes_cryptomatte(InfraredPanel, Panel):
    bl_label = "Cryptomatte"
    bl_context = "view_layer"
    bl_parent_id = "INFRARED_PT_passes"

    def draw(self, context):
        self.layout.use_property_decorate = False
        column, layer = self.column(heading="Include", align=True), context.view_layer
        for kind, switch in CRYPTOMATTE_SWITCHES.items():
            column.prop(layer, switch, text=kind.removeprefix("Crypto"))
        column = self.column()
        column.active = any(getattr(layer, switch) for switch in CRYPTOMATTE_SWITCHES.values())
        column.prop(layer, "pass_cryptomatte_depth", text="Levels")


class INFRARED_PT_checkpoint(RenderSettingsPanel, Panel):
    bl_label = "Checkpoint"
    bl_context = "output"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        column.prop(infrared, "checkpoint_path", text="File")
        row = column.row()
        row.active = bool(infrared.checkpoint_path)
        row.prop(infrared, "checkpoint_minutes")
        column.separator()
        column.prop(infrared, "film_path")


class INFRARED_PT_labels(RenderSettingsPanel, Panel):
    bl_label = "Labels"
    bl_context = "output"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, column, infrared):
        column.prop(infrared, "label_path")


class INFRARED_PT_ray_visibility(InfraredPanel, Panel):
    bl_label = "Ray Visibility"
    bl_context = "object"
    bl_parent_id = "OBJECT_PT_visibility"

    @classmethod
    def poll(cls, context):
        obj = context.object
        instances = obj is not None and obj.type == "EMPTY" and obj.instance_type == "COLLECTION"
        return super().poll(context) and obj is not None and (obj.type in SURFACE_TYPES or instances)

    def draw(self, context):
        column = self.column()
        for ray in RAYS:
            column.prop(context.object, f"visible_{ray}", text=ray.capitalize())


class INFRARED_PT_object(InfraredPanel, Panel):
    bl_label = "Thermal"
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        obj = context.object
        return super().poll(context) and obj is not None and obj.type in SURFACE_TYPES | {"VOLUME"}

    def draw(self, context):
        obj, scene = context.object, context.scene
        source = temperature_source(obj, context.view_layer.depsgraph)
        column = self.column()
        row = column.row(align=True)
        row.active = source not in ("IMAGE", "ATTRIBUTE") or any(path_systems(obj, render=True))
        ambient = f"{in_scene_unit(scene.infrared.ambient_temperature, scene)} (ambient)"
        draw_custom_property(row, obj, "OBJECT", "temperature", ambient)
        row.menu("INFRARED_MT_object_temperatures", text="", icon="DOWNARROW_HLT")
        if holds_gas(obj, context.view_layer):
            draw_custom_property(column, obj, "OBJECT", "pressure", "101325 Pa (1 atm)")
        if obj.type in SURFACE_TYPES:
            if obj.type not in STRAND_TYPES:
                draw_image(column, obj, "OBJECT", "temperature_image")
                column.operator("infrared.temperature_image", text="Temperature Image...", icon="IMAGE_DATA")
            elif source == "ATTRIBUTE":
                column.label(text="The attribute 'temperature' counts", icon="CURVES_DATA")
            draw_group(column, obj, "OBJECT", scene)
        if obj.type == "MESH":
            self.draw_surface(column, obj, source)
            self.draw_heat_map(column, context)
        draw_object_checks(self.layout, context)

    def draw_surface(self, column, obj, source):
        """What the mesh attribute does, and the menu that makes one."""
        if source == "ATTRIBUTE":
            own = usable_attribute(obj.data)
            where = f"on {DOMAINS[own.domain]}" if own else "from its modifiers"
            row = column.row(align=True)
            row.label(text=f"Mesh attribute {where} counts", icon="MESH_DATA")
            if own:
                row.operator("infrared.temperature_remove_attribute", text="", icon="X")
        elif source != "IMAGE" and "temperature" in obj.data.attributes:
            text = "Attribute 'temperature' is no float on points, corners or faces"
            column.label(text=text, icon="ERROR")
        column.menu("INFRARED_MT_surface_temperature", text="Over the Surface from...")

    def draw_heat_map(self, column, context):
        """The switch of the heat map, and its range."""
        shown = heat_map.is_shown(context.screen)
        row = column.row(align=True)
        row.operator(
            f"infrared.heat_map_{'hide' if shown else 'show'}", text="Heat Map", icon="SHADING_SOLID", depress=shown
        )
        if shown:
            row.operator("infrared.heat_map_show", text="", icon="FILE_REFRESH")
            low, high = (in_scene_unit(kelvin, context.scene) for kelvin in heat_map.shown_range(context.screen))
            column.label(text=f"From {low} to {high}")


class MaterialPanel(InfraredPanel):
    """Of materials that can be rendered."""

    bl_context = "material"

    @classmethod
    def poll(cls, context):
        material = context.material
        return super().poll(context) and material is not None and not material.grease_pencil


class INFRARED_PT_material(MaterialPanel, Panel):
    bl_label = "Thermal Surface"

    def draw(self, context):
        material, default = context.material, context.scene.infrared.default_emissivity
        column = self.column()
        draw_spectral(column, material, "emissivity", f"{default:g} (default)")
        row = column.row(align=True)
        row.operator("infrared.emissivity_library", text="From Library...", icon="VIEWZOOM")
        row.menu("INFRARED_MT_material_curve", text="Over Wavelength...", icon="FCURVE")
        if is_medium(material):
            column.label(text="A gas: it has no surface", icon="INFO")
        else:
            scene = context.scene
            key = f"surface of {material.session_uid}"
            draw_problems(column, kept(scene, key, lambda: material_checks(material, scene.infrared)), context.region)
        column.separator()
        draw_custom_property(column, material, "MATERIAL", "specular", "0 (diffuse)")
        draw_custom_property(column, material, "MATERIAL", "roughness", "0 (mirror)")
        draw_custom_property(column, material, "MATERIAL", "fresnel", "No (alike at all angles)")
        draw_spectral(column, material, "transmittance", "0 (opaque)")
        column.separator()
        draw_mix(column, material)


class WorldPanel(InfraredPanel):
    """Of the world that is shown."""

    bl_context = "world"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.world is not None


class INFRARED_PT_world(WorldPanel, Panel):
    bl_label = "Surroundings"

    def draw(self, context):
        column = self.column()
        none = f"{in_scene_unit(0.0, context.scene)} (no radiation)"
        sky = next((key for key in SKY_KEYS if context.world.get(key) is not None), None)
        if sky is None:
            draw_custom_property(column, context.world, "WORLD", "temperature", none)
        else:
            draw_sky(column, context.world, sky)
        column.operator("infrared.sky_image", text="Temperature Image...", icon="IMAGE_DATA")
        column.operator("infrared.clear_sky", text="Clear Sky from Weather...", icon="LIGHT_SUN")
        draw_group(column, context.world, "WORLD", context.scene)


class INFRARED_PT_light(InfraredPanel, Panel):
    bl_label = "Light"
    bl_context = "data"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.light is not None

    def draw(self, context):
        light = context.light
        self.layout.row().prop(light, "type", expand=True)
        column = self.column()
        if light.type == "SUN":
            column.prop(light, "energy", text="Irradiance (W/m²)")
            column.prop(light, "angle")
        else:
            column.prop(light, "energy", text="Power (W)")
        column.prop(light, "exposure")
        column.prop(light, "normalize")
        if light.type in {"POINT", "SPOT"}:
            column.prop(light, "shadow_soft_size", text="Radius")
        if light.type == "SPOT":  # Blender's own panel for these is a part of EEVEE's
            column.prop(light, "spot_size", text="Cone")
            column.prop(light, "spot_blend", text="Blend", slider=True)
            column.prop(light, "use_square", text="Square")
        elif light.type == "AREA":
            column.prop(light, "shape")
            two_sizes = light.shape in {"RECTANGLE", "ELLIPSE"}
            size = column.column(align=True)
            size.prop(light, "size", text="Size X" if two_sizes else "Size")
            if two_sizes:
                size.prop(light, "size_y", text="Y")
            column.prop(light, "spread", text="Spread")
        if context.object is not None:  # the temperature is the object's, a pinned light has none
            default = in_scene_unit(initial_value(context.object, "temperature", context.scene), context.scene)
            draw_custom_property(column, context.object, "OBJECT", "temperature", f"{default} (default)")
        draw_object_checks(self.layout, context)


class INFRARED_PT_panorama(InfraredPanel, Panel):
    bl_label = "Panorama"
    bl_context = "data"
    bl_parent_id = "DATA_PT_lens"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.camera is not None and context.camera.type == "PANO"

    def draw(self, context):
        camera = context.camera
        column = self.column()
        column.prop(camera, "panorama_type", text="Type")
        if camera.panorama_type != "EQUIRECTANGULAR":
            column.label(text="Rendered as Equirectangular", icon="ERROR")
        for angle in ("latitude", "longitude"):
            limits = column.column(align=True)
            limits.prop(camera, f"{angle}_min", text=f"{angle.capitalize()} Min")
            limits.prop(camera, f"{angle}_max", text="Max")


def draw_custom_property(column, id_block, owner: str, key: str, without: str) -> None:
    """One line: the value and a button to remove it, or what counts without it and a button to set it."""
    row = column.row(align=True)
    present = key in id_block
    if present:
        if hasattr(id_block[key], "to_list"):  # a field for each of many numbers would fill the panel
            row = draw_text(row, key, f"{len(id_block[key])} numbers")
        else:
            row.prop(id_block, f'["{key}"]', text=shown_label(id_block, key))
        operator = row.operator("infrared.property_remove", text="", icon="X")
    else:
        operator = draw_text(row, key, without).operator("infrared.property_add", text="", icon="ADD")
    operator.owner, operator.key = owner, key


def draw_mix(column, material) -> None:
    """What a material is mixed with, and by what, if it is; and the button that does it."""
    value, other = material.get("mix"), material.get("mix_material")
    if is_number(value):
        draw_custom_property(column, material, "MATERIAL", "mix", "")
    elif is_image(value):
        draw_image(column, material, "MATERIAL", "mix")
    elif value is not None:
        draw_removable(column, "MATERIAL", "mix", f"Attribute '{value}'" if isinstance(value, str) else describe(value))
    if other is not None:
        draw_removable(column, "MATERIAL", "mix_material", getattr(other, "name", "") or describe(other))
    column.operator("infrared.material_mix", text="Mix with Another Material...", icon="MATERIAL")


def draw_image(column, block, owner: str, key: str) -> None:
    """One line: the image that lies on a surface, and a button to remove it; nothing without one."""
    value = block.get(key)
    if value is not None:
        kind = key.removesuffix("_image")
        draw_removable(column, owner, key, lookup_text(block, kind, value) if is_image(value) else describe(value))


def draw_removable(column, owner: str, key: str, text: str) -> None:
    """One line: a custom property in words, and a button to remove it."""
    operator = draw_text(column.row(align=True), key, text).operator("infrared.property_remove", text="", icon="X")
    operator.owner, operator.key = owner, key


def draw_sky(column, world, key: str) -> None:
    """One line: the image or the table that says what the sky is like, and a button to remove it."""
    value = world[key]
    if hasattr(value, "id_type"):  # an image; a group of properties has a name, too
        text = value.name
    else:
        text = f"{len(value.get('zenith', ()))} angles, {len(value.get('wavelength', ()))} wavelengths"
    draw_removable(column, "WORLD", key, text)


def shown_label(id_block, key: str) -> str:
    """A custom property's name, with the unit of a temperature that Blender shows as a mere number.

    Scripts set those. To give it Blender's unit is to change the file, which a panel must not do while it is drawn.
    """
    value = id_block[key]
    plain = key == "temperature" and is_number(value)
    if plain and id_block.id_properties_ui(key).as_dict().get("subtype") != "TEMPERATURE":
        return "Temperature (K)"
    return property_label(key)


def draw_group(column, id_block, owner: str, scene) -> None:
    """The temperature group, where groups are used or one is set."""
    if scene.infrared.group_exr_path or "temperature_group" in id_block:
        draw_custom_property(column, id_block, owner, "temperature_group", "None")


def draw_text(row, key: str, text: str):
    """A name and a text in place of a value; returns the row that the text is in."""
    value = draw_name(row, property_label(key))
    value.label(text=text)
    return value


def draw_name(row, name: str):
    """A name to the left; returns the row to the right of it, for a value."""
    split = row.split(factor=0.4)
    left = split.row()
    left.alignment = "RIGHT"
    left.label(text=name)
    return split.row(align=True)


def draw_spectral(column, material, key: str, without: str) -> None:
    """An emissivity or a transmittance: a number, or in words what depends on the wavelength."""
    value = material.get(key)
    if value is None or isinstance(value, float | int):
        draw_custom_property(column, material, "MATERIAL", key, without)
    else:
        draw_spectrum(column, value, "MATERIAL", key)


def draw_spectrum(column, value, owner: str, key: str) -> None:
    """A curve of a material, or a coefficient, that depends on the wavelength, in words, and a button to remove it."""
    if isinstance(value, str):
        text = value
    elif hasattr(value, "to_list") and len(value) % 2 == 0:
        text = f"{len(value) // 2} points over wavelength"
    else:
        text = "Not a number, list or library name"
    draw_removable(column, owner, key, text)


def draw_chosen_bands(column, infrared) -> None:
    """The edges of adaptive bands, the error foreseen, and a button to keep them; or why there are none."""
    edges, error, problem = kept(infrared.id_data, "adaptive bands", lambda: find_bands(infrared))
    if problem:
        column.label(text=problem, icon="ERROR")
        return
    box = column.box().column(align=True)
    box.label(text=f"{len(edges) - 1} bands, error about {error:.1g} K")
    box.label(text="Edges (µm):")
    words = [f"{edge:.6g}" for edge in edges]
    lines = [", ".join(words[i : i + EDGES_A_LINE]) for i in range(0, len(words), EDGES_A_LINE)]
    for line in lines[:EDGE_LINES]:
        box.label(text=line)
    if len(lines) > EDGE_LINES:
        box.label(text=f"and {len(words) - EDGE_LINES * EDGES_A_LINE} more")
    column.operator("infrared.bands_keep", icon="PINNED")


CLASSES = (
    INFRARED_PT_photons,
    INFRARED_PT_photons_advanced,
    INFRARED_PT_motion_blur,
    INFRARED_PT_spectrum,
    INFRARED_PT_defaults,
    INFRARED_PT_passes,
    INFRARED_PT_passes_data,
    INFRARED_PT_passes_cryptomatte,
    INFRARED_PT_film,
    INFRARED_PT_output,
    INFRARED_PT_checkpoint,
    INFRARED_PT_labels,
    INFRARED_PT_ray_visibility,
    INFRARED_PT_object,
    INFRARED_PT_material,
    INFRARED_PT_world,
    INFRARED_PT_light,
    INFRARED_PT_panorama,
)


def get_panels():
    """Blender's own panels that stay usable with this engine: dimensions, output, camera, view layers, ..."""
    for panel in Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", ())
        general = "BLENDER_RENDER" in engines and "freestyle" not in panel.__name__
        if panel.__name__ in SHARED_PANELS or (general and panel.__name__ not in REPLACED_PANELS):
            yield panel


def register():
    for panel in get_panels():
        panel.COMPAT_ENGINES.add(ENGINE)
    for cls in CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    for panel in get_panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
