# SPDX-License-Identifier: GPL-3.0-or-later
"""What is wrong with a scene, or worth knowing, before it is rendered.

Whether a value can be rendered, the scene's reader decides; nothing here judges it a second time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import bpy
import numpy as np

from ..reading.bands import read_adaptive_bands, read_band_edges, read_band_range
from ..reading.camera import read_camera
from ..reading.custom_properties import driver_remark, is_number, read_temperature, setting_remarks
from ..reading.groups import UNGROUPED_LIGHT, read_group_temperatures
from ..reading.ignored import ignored_scene_settings, ignored_settings, left_out
from ..reading.lights import read_light, uneven_beam
from ..reading.materials import FRESNEL_LEFT_OUT, leaves_fresnel_out, read_material, surface_remarks
from ..reading.media import (
    GROUPED_AIR,
    NO_GROUP,
    gas_remarks,
    is_medium,
    leak_message,
    read_gas_alone,
    read_pressure,
    read_world_medium,
)
from ..reading.meshes import attribute_problem, layer_problem, read_mesh
from ..reading.object_parameters import read_object_parameters
from ..reading.objects import SURFACE_TYPES, layer_objects, may_have_faces, rendered_objects
from ..reading.openness import surely_open
from ..reading.scene_reader import check_faces
from ..reading.sensor import read_lag, read_response
from ..reading.settings import read_defaults, read_settings
from ..reading.shaders import changes_shapes, read_shader, unseen_message
from ..reading.strands import path_systems
from ..reading.surface_temperature import (
    HAIR_WITHOUT,
    WITH_ATTRIBUTES,
    temperature_source,
    temperatures_without_image,
)
from ..reading.textures import TextureReader, with_mixed
from ..reading.visibility import HIDDEN_IN_FOG, read_visibility
from ..reading.volumes import bad_values
from ..reading.warnings import Warnings
from ..reading.world import WHERE_TO_SET, layer_world, unset_surroundings, world_temperature
from ..solver.physics import library
from ..solver.physics.sensors import share_outside
from ..solver.physics.transmission import transmittance
from ..solver.scene import Hidden, Material, Medium, SceneError, check_depth, check_response
from .camera_effects import read_detector
from .render_files import check_paths
from .render_passes import render_passes

LEVELS = ("ERROR", "WARNING", "HINT")  # in the order of their weight
LOST = 0.02  # share of a sensor's signal outside the bands that is worth a warning
MOST_FACES = 50_000  # of the mesh of a gas; whether a larger one is closed, only the render finds out
LARGEST_FILE = 16e6  # bytes of a volume; what a larger one holds, only the render finds out
TYPICAL = 300.0  # K, at which a gas without a mesh is looked at
WAVELENGTHS = 512  # in the bands, at which a gas is looked at
SLACK = 1e-4  # um: settings are float32, so 14 um may be 14.0000001


@dataclass(frozen=True)
class Check:
    """Something to tell the user.

    level: an "ERROR" stops the render, a "WARNING" tells of a result that the user may not expect, a "HINT" of a
    default that is used. text: what it is.
    """

    level: str
    text: str


def problems(read: Callable, *arguments) -> list[Check]:
    """The SceneError that read(*arguments) raises, if it does, as a check: a render would stop with it."""
    try:
        read(*arguments)
    except SceneError as error:
        return [Check("ERROR", str(error))]
    return []


def settings_checks(infrared) -> list[Check]:
    """Checks of the solver's settings."""
    failing = [Check("WARNING", f"Scene: {remark}") for remark in setting_remarks(infrared.id_data)]
    return problems(read_settings, infrared) + failing


def material_checks(material, infrared) -> list[Check]:
    """Checks of a material: of its gas, if it fills meshes, else of its surface."""
    if is_medium(material):
        owner = f"Material '{material.name}'"
        driven = [Check("WARNING", f"{owner}: {remark}") for remark in gas_remarks(material)]
        return driven + gas_checks(material, owner, infrared) + _mix_checks(material)
    return _surface_checks(material, infrared) + _mix_checks(material) + _shader_checks(material)


def _mix_checks(material) -> list[Check]:
    """Checks of what a material is mixed with, and how."""
    warnings = Warnings()
    TextureReader(warnings).mix(material)
    return [Check("WARNING", f"Material {message}") for message in warnings.messages()]


def _shader_checks(material) -> list[Check]:
    """What of a material's shader the engine does not see: a warning where the picture has other shapes for it."""
    shader = read_shader(material)
    message = unseen_message(shader)
    level = "WARNING" if changes_shapes(shader) else "HINT"
    return [Check(level, f"Material '{material.name}': {message}")] if message else []


def gas_checks(block, owner: str, infrared) -> list[Check]:
    """Checks of what the gas of a material or a world absorbs and scatters. owner: how messages name it."""
    try:
        gas = read_gas_alone(block, owner, TYPICAL)
    except SceneError as error:
        return [Check("ERROR", str(error))]
    try:
        low, high = read_band_range(infrared)
    except SceneError:
        return []  # reported for the bands
    found = []
    for quantity in ("absorption", "scattering"):
        if not is_number(block.get(quantity, 0.0)):
            points = block[quantity].to_list()[::2]
            found += _range_checks(owner, quantity, points, (low, high))
    if transmittance(gas, np.linspace(low, high, WAVELENGTHS), 1.0).min() < 1.0:
        return found
    return found + [Check("WARNING", f"{owner}: its gas absorbs and scatters nothing from {low:.4g} to {high:.4g} µm")]


def _surface_checks(material, infrared) -> list[Check]:
    """Checks of a material's emissivity, transmittance, specular share, roughness and Fresnel's law."""
    owner = f"Material '{material.name}'"
    try:
        read = read_material(material, infrared.default_emissivity)
    except SceneError as error:
        return [Check("ERROR", str(error))]
    driven = [Check("WARNING", f"{owner}: {remark}") for remark in surface_remarks(material)]
    return [*driven, *_fresnel_checks(material, read, owner), *_emissivity_checks(material, read.curve[0], infrared)]


def _fresnel_checks(material, read: Material, owner: str) -> list[Check]:
    """Checks of Fresnel's law on a surface. read: the solver's material."""
    if leaves_fresnel_out(material, read):
        return [Check("WARNING", f"{owner}: {FRESNEL_LEFT_OUT}")]
    if read.fresnel and not read.specular:
        return [Check("WARNING", f"{owner}: fresnel changes nothing without a specular share above 0")]
    return []


def _emissivity_checks(material, wavelengths, infrared) -> list[Check]:
    """Checks of the emissivity of a material that can be read, over its wavelengths (n,), um."""
    owner = f"Material '{material.name}'"
    if material.get("emissivity") is None:
        return [Check("HINT", f"{owner}: no emissivity; the default {infrared.default_emissivity:.3g} counts")]
    try:
        low, high = read_band_range(infrared)
    except SceneError:
        return []  # reported for the bands
    return _range_checks(owner, "emissivity", wavelengths, (low, high)) if len(wavelengths) > 1 else []


def _range_checks(owner: str, quantity: str, wavelengths, bands: tuple[float, float]) -> list[Check]:
    """Checks of whether a quantity that is known at wavelengths (n,), um, is so in all bands, which reach from one
    wavelength to another."""
    first, last, low, high = wavelengths[0], wavelengths[-1], *bands
    if low >= first - SLACK and high <= last + SLACK:
        return []
    known = f"{quantity} is known from {first:.4g} to {last:.4g} µm; the bands reach from {low:.4g} to {high:.4g} µm"
    return [Check("WARNING", f"{owner}: {known}, where the nearest value is held")]


def find_bands(infrared) -> tuple[Sequence[float], float, str]:
    """The edges (um) of adaptive bands, the error (K) foreseen, and why there are no bands, or an empty text."""
    try:
        return *read_adaptive_bands(infrared), ""
    except SceneError as problem:
        return (), 0.0, str(problem)


def band_problem(infrared) -> str:
    """Why the band settings cannot be rendered, or an empty text."""
    return "".join(check.text for check in problems(read_band_edges, infrared))


def sensor_checks(infrared) -> list[Check]:
    """Checks of the sensor and of the bands that it sees through."""
    try:
        low, high = read_band_range(infrared)
    except SceneError:
        return []  # reported for the bands
    try:
        read_lag(infrared)
        response = read_response(infrared)
        check_response(response, (low, high))
    except SceneError as error:
        return [Check("ERROR", str(error))]
    lost = 0.0 if response is None else share_outside(response, low, high, infrared.ambient_temperature)
    if lost <= LOST:
        return []
    text = (
        f"Sensor '{response.name}': {lost:.0%} of its signal at {infrared.ambient_temperature:.5g} K lies outside the "
    )
    return [Check("WARNING", text + f"bands from {low:.4g} to {high:.4g} µm, which act as a filter")]


def object_parameter_checks(infrared) -> list[Check]:
    """Checks of what the temperatures are corrected for."""
    try:
        parameters = read_object_parameters(infrared)
    except SceneError as error:
        return [Check("ERROR", str(error))]
    if is_medium(infrared.id_data.world):
        return []
    if infrared.air_transmission_source == "WORLD":
        return [Check("WARNING", "Object Parameters: the world has no gas, so the air counts as clear")]
    through = parameters.correction.air_transmission
    if through == 1.0:
        return []
    corrected = f"temperatures are corrected for air that lets {through:.1%} through"
    return [Check("HINT", f"Object Parameters: {corrected}, but the world has no gas")]


def detector_checks(scene) -> list[Check]:
    """Checks of the camera effects; those of the camera itself are in `camera_checks`."""
    if not scene.infrared.use_detector or scene.camera is None or scene.camera.type != "CAMERA":
        return []
    if any(check.level == "ERROR" for check in sensor_checks(scene.infrared)):
        return []  # the bands' weights make no sense
    return problems(read_detector, scene, scene.camera)


def camera_checks(scene, view_layer) -> list[Check]:
    """Checks of the scene's camera."""
    warnings = Warnings()
    found = problems(read_camera, _evaluated(view_layer), scene.camera, warnings)
    return found + [Check("WARNING", message) for message in warnings.messages()]


def object_checks(obj, infrared, view_layer) -> list[Check]:
    """Checks of an object in a view layer; none of one that has neither surfaces nor light."""
    found = _temperature_checks(obj, infrared, view_layer) + _texture_checks(obj, view_layer)
    found += _ignored_checks(obj, infrared, view_layer)
    return found + (_medium_checks(obj, infrared, view_layer) if holds_gas(obj, view_layer) else [])


def holds_gas(obj, view_layer) -> bool:
    """Whether an object is a volume, or its material, or the view layer's in its place, is a gas."""
    filled = any(map(is_medium, _materials(obj, view_layer)))
    return obj.type == "VOLUME" or (obj.type in SURFACE_TYPES and filled)


def _surely_gas(obj, view_layer) -> bool:
    """Whether all materials of an object, or the view layer's in their place, are gases."""
    materials = _materials(obj, view_layer)
    return len(materials) > 0 and all(map(is_medium, materials))


def _materials(obj, view_layer) -> list:
    """The materials in an object's slots, None in empty ones, or the view layer's in their place."""
    override = view_layer.material_override
    return [override] if override else [slot.material for slot in obj.material_slots]


def _medium_checks(obj, infrared, view_layer) -> list[Check]:
    """Checks of an object that holds gas, beside those of its material and its temperature."""
    owner = _owner(obj)
    found = problems(_read_medium_pressure, obj, owner)
    if infrared.group_exr_path and obj.get("temperature_group"):
        found.append(Check("WARNING", f"{owner}: {NO_GROUP}"))
    leak = _leak(obj, view_layer)
    told = [leak] if leak else _bad_values(obj, view_layer)
    return found + [Check("WARNING", f"{owner}: {each}") for each in told]


def _read_medium_pressure(obj, owner: str) -> None:
    """Raise SceneError if the pressure of an object's gas makes no sense."""
    Medium(obj.name, pressure=read_pressure(obj, owner))


def _leak(obj, view_layer) -> str:
    """Where the mesh of a gas is open, in the object's own space; an empty text if it is closed, or large."""
    evaluated = obj.evaluated_get(_evaluated(view_layer))
    if obj.type != "MESH" or obj.data.is_editmode or len(evaluated.data.polygons) > MOST_FACES:
        return ""
    try:
        mesh = read_mesh(evaluated.data, obj.name, Warnings())
    except SceneError:  # reported for the temperature
        return ""
    materials = [view_layer.material_override or slot.material for slot in evaluated.material_slots]
    slots = np.clip(mesh.slot, 0, len(materials) - 1)
    parts = (mesh.triangles[slots == i] for i, material in enumerate(materials) if is_medium(material))
    return next(filter(None, (leak_message(mesh.vertices, part) for part in parts)), "")


def _bad_values(obj, view_layer) -> list[str]:
    """What is NaN or infinite in the file of a Volume object, unless it is large."""
    if obj.type != "VOLUME":
        return []
    grids = obj.evaluated_get(_evaluated(view_layer)).data.grids
    path = Path(bpy.path.abspath(grids.frame_filepath)) if grids.load() else Path()
    if not path.is_file():  # the render tells of files that cannot be read; geometry nodes have none
        return []
    about = path.stat()
    return bad_values(str(path), (about.st_size, about.st_mtime_ns)) if about.st_size <= LARGEST_FILE else []


def _ignored_checks(obj, infrared, view_layer) -> list[Check]:
    """Checks of what an object asks for and does not get."""
    messages = [left_out(obj)]
    if obj.type in SURFACE_TYPES or obj.type in ("LIGHT", "VOLUME"):
        messages += ignored_settings(obj, view_layer)
    if obj.type == "LIGHT":
        messages.append(uneven_beam(obj.data, np.array(obj.matrix_world, dtype=np.float64)))
    if obj.type == "LIGHT" and infrared.group_exr_path and obj.get("temperature_group"):
        messages.append(UNGROUPED_LIGHT)
    if obj.type in WITH_ATTRIBUTES:
        messages.append(attribute_problem(obj.evaluated_get(_evaluated(view_layer)).data))
    return [Check("WARNING", f"{_owner(obj)}: {message}") for message in messages if message]


def _owner(obj) -> str:
    return f"{'Light' if obj.type == 'LIGHT' else 'Object'} '{obj.name}'"


def _temperature_checks(obj, infrared, view_layer) -> list[Check]:
    if obj.type == "LIGHT":
        return problems(read_light, obj, np.array(obj.matrix_world, dtype=np.float64)) + _driver_checks(
            obj, _owner(obj)
        )
    if obj.type == "VOLUME":  # only the render knows whether it has a temperature of its own in its cells
        return problems(read_temperature, obj, 0.0, _owner(obj)) + _driver_checks(obj, _owner(obj))
    if obj.type not in SURFACE_TYPES:
        return []
    source = temperature_source(obj, _evaluated(view_layer))
    ambient = f"the ambient {infrared.ambient_temperature:.5g} K counts"
    if obj.get("temperature") is None and source == "ATTRIBUTE" and any(path_systems(obj, render=True)):
        return [Check("HINT", f"Object '{obj.name}': {HAIR_WITHOUT}no temperature; {ambient}")]
    if obj.get("temperature") is None and source == "AMBIENT":
        if holds_gas(obj, view_layer):
            return [Check("WARNING", f"Object '{obj.name}': its gas has no temperature; {ambient}")]
        return [Check("HINT", f"Object '{obj.name}': no temperature; {ambient}")]
    found = problems(temperatures_without_image, obj, 0.0)
    return found if source in ("IMAGE", "ATTRIBUTE") else found + _driver_checks(obj, _owner(obj))


def _texture_checks(obj, view_layer) -> list[Check]:
    """Checks of the image of an object's temperatures, and of what the mixes of its materials need of its mesh."""
    if obj.type not in SURFACE_TYPES:
        return []
    warnings, evaluated = Warnings(), obj.evaluated_get(_evaluated(view_layer))
    reader = TextureReader(warnings)
    materials = _materials(evaluated, view_layer)
    try:
        needed = reader.layers(obj, materials)
    except SceneError as error:
        return [Check("ERROR", str(error))]
    if obj.type == "MESH" and not obj.data.is_editmode:
        layers = {name: layer_problem(evaluated.data, name) or None for name in needed}
        reader.usable_temperature_image(obj, layers)
        for material in materials:
            reader.usable_mix(obj, layers, material)
    return [Check("WARNING", f"{_owner(obj)}: {message}") for message in warnings.of(obj.name)]


def _driver_checks(id_block, owner: str) -> list[Check]:
    remark = driver_remark(id_block)
    return [Check("WARNING", f"{owner}: {remark}")] if remark else []


def _fog_checks(scene, view_layer, objects: Collection) -> list[Check]:
    """Checks of objects that rays should pass, where gas scatters light. objects: those that the view layer renders."""
    seen_by = ((obj, read_visibility(obj, obj, view_layer)) for obj in objects if obj.type in SURFACE_TYPES)
    hidden = [obj for obj, visibility in seen_by if visibility.hidden & ~Hidden.CAMERA]
    if not hidden:
        return []
    filled = [obj for obj in objects if holds_gas(obj, view_layer)]
    slots = {material for obj in filled for material in _materials(obj, view_layer)}
    if not any(map(_scatters, [layer_world(scene, view_layer), *slots])):
        return []
    return [Check("WARNING", f"{_owner(obj)}: {HIDDEN_IN_FOG}") for obj in hidden]


def _scatters(block) -> bool:
    """Whether the gas of a material or world scatters light; not if it has none, or one that makes no sense."""
    try:
        return is_medium(block) and read_gas_alone(block, block.name, TYPICAL).scatters
    except SceneError:  # reported for the block
        return False


def world_checks(scene, view_layer, objects: Collection) -> list[Check]:
    """Checks of the world that a view layer shows. objects: those that it renders."""
    world = layer_world(scene, view_layer)
    unset = unset_surroundings(world)
    if not unset:
        return problems(world_temperature, world) + _driver_checks(world, f"World '{world.name}'")
    if scene.camera is not None and surely_open(_evaluated(view_layer), objects, scene.camera):
        return [
            Check("WARNING", f"{unset}, and the scene is open: rays that leave it see 0 K. Set it in {WHERE_TO_SET}")
        ]
    return [Check("HINT", f"{unset}: if rays leave the scene, they see 0 K")]


def world_gas_checks(world, infrared) -> list[Check]:
    """Checks of the gas that fills a world, none without a world or a gas."""
    if not is_medium(world):
        return []
    owner, warnings = f"World '{world.name}'", Warnings()
    found = gas_checks(world, owner, infrared)
    if not any(check.level == "ERROR" for check in found):
        found += problems(_read_air, world, warnings)
    return found + [Check("WARNING", f"World {message}") for message in warnings.messages()]


def _read_air(world, warnings: Warnings) -> None:
    """Raise SceneError if the depth or the pressure of the world's gas makes no sense."""
    (air,), depth = read_world_medium(world, 0.0, warnings, 1.0)
    check_depth(depth)


def _group_checks(scene, view_layer) -> list[Check]:
    """Checks of temperature groups, where they are kept apart."""
    found, world = problems(read_group_temperatures, scene, view_layer), layer_world(scene, view_layer)
    if is_medium(world) and world.get("temperature_group"):
        found.append(Check("WARNING", f"World '{world.name}': {GROUPED_AIR}"))
    return found


def _evaluated(view_layer):
    """The depsgraph of a view layer. It has none before its first evaluation."""
    return view_layer.depsgraph or bpy.context.evaluated_depsgraph_get()


def scene_checks(scene, view_layer) -> list[Check]:
    """All checks of what a view layer renders, in the order of their weight: errors, warnings, hints."""
    infrared = scene.infrared
    objects = rendered_objects(layer_objects(view_layer.layer_collection))
    override = view_layer.material_override
    slots = (slot.material for obj in objects if obj.type in SURFACE_TYPES for slot in obj.material_slots)
    materials = with_mixed([override] if override else slots)
    found = problems(check_paths, infrared)
    found += settings_checks(infrared)
    found += problems(read_defaults, infrared)
    found += problems(render_passes, scene, view_layer)
    found += sensor_checks(infrared)
    found += object_parameter_checks(infrared)
    found += detector_checks(scene)
    found += camera_checks(scene, view_layer)
    found += [Check("WARNING", message) for message in ignored_scene_settings(scene, view_layer)]
    surfaces = [obj for obj in objects if may_have_faces(obj) and not _surely_gas(obj, view_layer)]
    found += problems(check_faces, view_layer, len(surfaces) > 0)
    found += [Check("WARNING", f"My materials: {problem}") for problem in [library.user_problem()] if problem]
    found += world_checks(scene, view_layer, objects)
    found += world_gas_checks(layer_world(scene, view_layer), infrared)
    for material in materials:
        found += material_checks(material, infrared)
    volumes = (_materials(obj, view_layer) for obj in objects if obj.type == "VOLUME")
    for material in filter(is_medium, chain.from_iterable(volumes)):  # what is in its cells, the render finds out
        found += problems(read_gas_alone, material, f"Material '{material.name}'", TYPICAL)
    for obj in objects:
        found += object_checks(obj, infrared, view_layer)
    found += _fog_checks(scene, view_layer, objects)
    if infrared.group_exr_path:
        found += _group_checks(scene, view_layer)
    return sorted(dict.fromkeys(found), key=lambda check: LEVELS.index(check.level))
