# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's evaluated scene becomes the solver's Scene: numpy arrays, one bulk read for each mesh.

Units: metres (one Blender unit, whatever the display units), kelvin, micrometres, watts.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..solver.physics import library
from ..solver.physics.band_partition import Partition, choose_bands
from ..solver.physics.sensors import BUILT_IN
from ..solver.physics.spectrum import uniform_edges
from ..solver.scene import (
    LAMP_TEMPERATURE,
    SUN_TEMPERATURE,
    AreaLight,
    Light,
    Material,
    PointLight,
    Response,
    Scene,
    SceneError,
    SpotLight,
    SunLight,
    check_band_edges,
    check_temperature,
)
from ..solver.settings import Settings
from .camera_reader import read_camera
from .group_reader import GroupReader, read_group
from .surface_temperature import NAME, SURFACE_TYPES, read_values, usable_attribute

UNSUPPORTED = {
    "CURVES": "hair curves",
    "POINTCLOUD": "point clouds",
    "VOLUME": "volumes",
    "GREASEPENCIL": "grease pencil",
    "GPENCIL": "grease pencil",
}


class Warnings:
    """What rendering goes on in spite of: one message for each kind of trouble, with the objects it concerns."""

    def __init__(self):
        self._names = defaultdict(dict)  # message -> names in order, without doubles

    def add(self, name: str, message: str) -> None:
        """name: of the object, material or light; message: the trouble and the fallback."""
        self._names[message][name] = None

    def messages(self, most: int = 5) -> list[str]:
        """One line for each message; at most `most` names are spelt out."""
        lines = []
        for message, names in self._names.items():
            listed = ", ".join(f"'{name}'" for name in list(names)[:most])
            more = f" and {len(names) - most} more" if len(names) > most else ""
            lines.append(f"{listed}{more}: {message}")
        return lines


def read_scene(depsgraph, camera=None, surfaces: SurfaceReader | None = None) -> tuple[Scene, list[str]]:
    """Everything that the depsgraph's view layer renders, and warnings about what it cannot render as it stands.

    camera: evaluated camera object; None is the scene's camera. surfaces: a new reader, to ask it for more afterwards.
    Raises SceneError, naming the object and the value, if there is nothing to render or a value makes no sense.
    """
    surfaces = surfaces or render_reader(depsgraph)
    contents = read_contents(depsgraph, surfaces)
    solver_camera = read_camera(depsgraph, camera or depsgraph.scene_eval.camera, surfaces.warnings)
    ignored = ignored_scene_settings(depsgraph.scene_eval, depsgraph.view_layer_eval)
    warnings = surfaces.warnings.messages() + list(ignored)
    return Scene(**contents, camera=solver_camera), warnings


def render_reader(depsgraph) -> SurfaceReader:
    """A new reader for a final render: it keeps temperature groups apart if the scene asks for their layers."""
    groups = GroupReader() if depsgraph.scene_eval.infrared.group_exr_path else None
    return SurfaceReader(depsgraph, Warnings(), groups=groups)


def read_contents(depsgraph, surfaces: SurfaceReader, space=None) -> dict:
    """The arguments of Scene for all that the depsgraph's view layer shows, but for the camera.

    surfaces: a new reader. space: the 3D viewport whose local view counts; None is a render.
    Raises SceneError as read_scene does.
    """
    scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    surfaces.ambient_temperature, surfaces.default = read_defaults(scene.infrared)
    warnings, lights, known, metres = surfaces.warnings, [], set(), metres_per_unit(scene)
    for instance in depsgraph.object_instances:
        obj = instance.object
        if not instance.show_self:
            continue
        if space and not (instance.parent or obj).visible_in_viewport_get(space):
            continue
        if obj.type in ("MESH", "LIGHT") and obj.name_full not in known:  # one of many instances tells all
            known.add(obj.name_full)
            for message in ignored_settings(obj, layer):
                warnings.add(obj.name, message)
        if obj.type == "MESH":  # curves, texts, metaballs and geometry nodes arrive here as meshes too
            surfaces.add(obj, np.array(instance.matrix_world, dtype=np.float64))
        elif obj.type == "LIGHT":
            lights.extend(read_light(obj, np.array(instance.matrix_world, dtype=np.float64), metres))
            if surfaces.groups is not None and read_group(obj, f"Light '{obj.name}'"):
                warnings.add(obj.name, "temperature groups are for surfaces; the light stays as it is")
        elif obj.type in UNSUPPORTED:
            warnings.add(obj.name, f"{UNSUPPORTED[obj.type]} are not rendered")
    check_faces(layer, bool(surfaces.triangles))
    world = layer_world(scene, layer)
    return surfaces.arrays(world) | {
        "band_edges": read_band_edges(scene.infrared),
        "world_temperature": world_temperature(world),
        "lights": tuple(lights),
        "response": read_response(scene.infrared),
    }


def check_faces(layer, found: bool) -> None:
    """Raise SceneError unless there are faces to render in a view layer."""
    if not found:
        raise SceneError(f"View layer '{layer.name}' has nothing to render: no visible object has faces")


def may_have_faces(obj) -> bool:
    """False if an object shows no face whatever is made of it: there is no need to make it."""
    if obj.type not in SURFACE_TYPES or len(obj.modifiers):
        return len(obj.modifiers) > 0
    return obj.type != "MESH" or len(obj.data.polygons) > 0 or obj.data.is_editmode


# Settings -------------------------------------------------------------------------------------------------------------

DEFAULTS = "Where Nothing Is Set"  # label of the panel with these settings
SENSOR_SETTINGS = {"assumed_emissivity", "reflected_temperature"}


def read_settings(infrared) -> Settings:
    """The solver's settings from scene.infrared. Raises SceneError, with the names that the interface shows, if nothing
    would stop the render or a value makes no sense.
    """
    names = [name for name in Settings.__dataclass_fields__ if hasattr(infrared, name)]
    try:
        return Settings(**{name: as_typed(getattr(infrared, name)) for name in names})
    except ValueError as error:
        panel = "Spectrum > Sensor" if SENSOR_SETTINGS.intersection(re.findall(r"\w+", str(error))) else "Photons"
        raise SceneError(f"Panel '{panel}': {as_shown(error, infrared, names)}") from error


def as_shown(error: Exception, infrared, names: Iterable[str], prefix: str = "") -> str:
    """The solver's message about settings of these names, with those that the interface shows.

    prefix: of the same names in scene.infrared.
    """
    labels = {name: infrared.bl_rna.properties[prefix + name].name for name in names}
    return "".join(labels.get(word, word) for word in re.findall(r"\w+|\W+", str(error)))


def read_defaults(infrared) -> tuple[float, Material]:
    """Temperature (K) and material of what has none of its own. Raises SceneError, naming their panel."""
    check_temperature(infrared.ambient_temperature, f"Panel '{DEFAULTS}'")
    if not 0.0 <= infrared.default_emissivity <= 1.0:  # also NaN
        raise SceneError(f"Panel '{DEFAULTS}': emissivity {infrared.default_emissivity:g} is outside 0..1")
    return infrared.ambient_temperature, Material(name=DEFAULTS, emissivity=infrared.default_emissivity)


def as_typed(value):
    """A property's value as its user typed it: those that are floats are rounded to float32, 293.15 to 293.149994."""
    return float(f"{value:.7g}") if isinstance(value, float) else value


# Sensor ---------------------------------------------------------------------------------------------------------------


def read_response(infrared, sensor: str | None = None) -> Response | None:
    """The response of a sensor, None for an ideal one. sensor: its key; None takes that of scene.infrared.

    Raises SceneError if a custom one is no response.
    """
    sensor = sensor or infrared.sensor
    if sensor == "BOX":
        return None
    if sensor != "CUSTOM":
        return BUILT_IN[sensor]()
    value = infrared.id_data.get("sensor_response")
    if getattr(value, "typecode", None) not in ("i", "f", "d"):  # an IDPropertyArray of numbers
        raise SceneError(
            f"Sensor: the scene's sensor_response is {_describe(value)}, expected a flat list of wavelengths (um) and "
            "responses; import one, or choose another sensor"
        )
    if len(value) % 2:
        raise SceneError(f"Sensor: sensor_response has {len(value)} numbers, expected pairs of um and response")
    return Response("Custom", np.array(value.to_list(), dtype=np.float64).reshape(-1, 2))


# Bands ----------------------------------------------------------------------------------------------------------------


def read_band_edges(infrared) -> np.ndarray:
    """Band edges (b + 1,) in um from scene.infrared. Raises SceneError if they are no ascending numbers above 0."""
    if infrared.band_mode == "UNIFORM":
        return uniform_edges(*_typed_ends(infrared), infrared.band_count)
    if infrared.band_mode == "ADAPTIVE":
        return read_adaptive_bands(infrared).edges
    words = [word.strip() for word in infrared.band_edges.split(",")]
    edges = []
    for word in words:
        try:
            edges.append(float(word))
        except ValueError:
            raise SceneError(
                f"Band edges: '{word}' is not a number; expected um between commas, as in 3, 5, 8, 14"
            ) from None
    edges = np.array(edges)
    check_band_edges(edges)
    return edges


def read_band_range(infrared) -> tuple[float, float]:
    """Ends of the bands, um, without the look at all objects that adaptive edges need. Raises as read_band_edges."""
    adaptive = infrared.band_mode == "ADAPTIVE"
    edges = uniform_edges(*_typed_ends(infrared), 1) if adaptive else read_band_edges(infrared)
    return float(edges[0]), float(edges[-1])


def _typed_ends(infrared) -> tuple[float, float]:
    """Shortest and longest wavelength of bands that are not custom ones, um."""
    return as_typed(infrared.wavelength_min), as_typed(infrared.wavelength_max)


def read_adaptive_bands(infrared) -> Partition:
    """The bands that suit the scene of scene.infrared best. Raises SceneError as choose_bands does.

    Passes are registered and rendered with the same bands, in each frame and view layer. So the scene itself decides,
    with the values that the interface shows, and not what is evaluated for a frame. Values that cannot be rendered are
    passed over: the render reports them.
    """
    scene = infrared.id_data.original
    infrared = scene.infrared
    materials = {layer.material_override for layer in scene.view_layers}
    curves, temperatures, lights = set(), [], set()
    for world in {layer_world(scene, layer) for layer in scene.view_layers}:
        with suppress(SceneError):
            temperatures.append(world_temperature(world))
    for obj in layers_objects(scene.view_layers):
        with suppress(SceneError):
            if obj.type in SURFACE_TYPES:
                materials.update(slot.material for slot in obj.material_slots)
                temperatures += object_temperatures(obj, infrared.ambient_temperature)
            elif obj.type == "LIGHT" and obj.data.energy > 0:
                lights.add(light_temperature(obj))
    for material in materials - {None}:
        with suppress(SceneError):
            curves.add(np.array(read_material(material, infrared.default_emissivity).curve).tobytes())
    low, high = _typed_ends(infrared)
    tolerance = as_typed(infrared.band_tolerance)
    count = 0 if tolerance > 0 else infrared.band_count
    spectra = (tuple(sorted(each)) for each in (curves, temperatures or [0.0], lights))
    response = read_response(infrared)
    curve = None if response is None else np.array(response.curve).tobytes()
    return _choose_bands(low, high, *spectra, count, tolerance, curve)


@lru_cache(maxsize=8)
def _choose_bands(low, high, curves: tuple[bytes, ...], temperatures, lights, count, tolerance, response) -> Partition:
    """choose_bands, which takes 0.1 s, once for each scene. curves, response: (2, n) float64 arrays."""

    def unpacked(curve: bytes):
        return tuple(np.frombuffer(curve).reshape(2, -1))

    seen = None if response is None else unpacked(response)
    return choose_bands(low, high, [unpacked(curve) for curve in curves], temperatures, lights, count, tolerance, seen)


def layer_objects(layer_collection) -> Iterator:
    """The objects in a view layer's collection and those inside it, but for collections hidden from renders."""
    if not layer_collection.collection.hide_render:
        if not layer_collection.exclude:
            yield from layer_collection.collection.objects
        for child in layer_collection.children:
            yield from layer_objects(child)


def rendered_objects(objects: Iterable) -> dict:
    """These objects and those in collections that they instance, once and in order (keys): but for hidden ones."""
    found, new = {}, objects
    while new:
        shown = {obj: None for obj in new if not obj.hide_render}
        found |= shown
        collections = {obj.instance_collection: None for obj in shown if obj.instance_type == "COLLECTION"}
        collections.pop(None, None)
        new = [obj for collection in collections for obj in collection.all_objects if obj not in found]
    return found


def layers_objects(layers: Iterable) -> dict:
    """The objects that some of these view layers render, once and in order (keys)."""
    shown = (layer_objects(layer.layer_collection) for layer in layers)
    return rendered_objects(dict.fromkeys(obj for objects in shown for obj in objects))


def object_temperatures(obj, ambient: float) -> list[float]:
    """All, or the lowest and the highest temperature (K) of an object itself, not of what modifiers make of it."""
    values = attribute_temperatures(obj.data, obj.name) if obj.type == "MESH" else None
    if values is None:
        return [read_temperature(obj, ambient, f"Object '{obj.name}'")]
    return [float(values.min()), float(values.max())]


def read_group_temperatures(scene, layer=None) -> dict[str, float]:
    """The temperature (K) of each group that a scene's objects and worlds are in now, as the interface shows them.

    layer: the view layer whose objects and world count; None is all that some view layer renders.
    Raises SceneError if a temperature makes no sense, or differs within a group.
    """
    groups = GroupReader()
    layers = [layer] if layer else list(scene.view_layers)
    for obj in sorted(layers_objects(layers), key=lambda obj: obj.name_full):
        if obj.type in SURFACE_TYPES and read_group(obj, f"Object '{obj.name}'"):
            kelvin = object_temperatures(obj, scene.infrared.ambient_temperature)
            groups.number(obj, f"Object '{obj.name}'", np.float32(kelvin))
    worlds = dict.fromkeys(layer_world(scene, each) for each in layers)
    worlds.pop(None, None)
    for world in worlds:
        groups.number(world, f"World '{world.name}'", np.float32([world_temperature(world)]))
    return groups.temperatures


# Settings of other engines --------------------------------------------------------------------------------------------

RAYS = ("camera", "diffuse", "glossy", "shadow")  # kinds that Blender's objects can be hidden from


def ignored_scene_settings(scene, layer) -> Iterator[str]:
    """What the settings of a scene and a view layer ask for and the engine does not do, and what it does instead."""
    if scene.render.use_multiview:
        yield "Stereoscopy is not supported: all views show the active camera's picture"
    if scene.render.use_motion_blur:
        yield "Motion blur is ignored: everything stands still in a picture"
    if scene.render.film_transparent:
        yield "A transparent film is ignored: what is behind the objects is seen at the temperature of the surroundings"
    if layer.samples != 0:
        yield f"View layer '{layer.name}': its {layer.samples} samples are ignored; all layers have the same passes"


def ignored_settings(obj, layer) -> Iterator[str]:
    """The same of an object. layer: the view layer, whose collections may ask for more."""
    if obj.light_linking.receiver_collection or obj.light_linking.blocker_collection:
        yield "light linking is ignored; what it sends reaches all objects, and all of them hide it"
    if obj.type == "LIGHT":
        yield from _ignored_light_settings(obj.data)
        return
    if obj.holdout_get(view_layer=layer) or obj.is_shadow_catcher:
        yield "holdout and shadow catcher are ignored; the object is rendered like any other"
    hidden = [ray for ray in RAYS if not getattr(obj, f"visible_{ray}")]
    if obj.indirect_only_get(view_layer=layer) and "camera" not in hidden:
        hidden.insert(0, "camera")
    if hidden:
        yield f"ray visibility is ignored (off: {', '.join(hidden)}); all rays meet the object"


def _ignored_light_settings(light) -> Iterator[str]:
    if tuple(light.color) != (1.0, 1.0, 1.0) or getattr(light, "use_temperature", False):  # Blender 5
        yield "the light's color is ignored; its spectrum is a blackbody's at the object's temperature"
    if getattr(light, "exposure", 0.0) != 0:
        yield "the light's exposure is ignored; its energy alone is its power"
    if light.type == "AREA" and light.spread < np.pi - 1e-4:
        yield "the area light's spread is ignored; it shines after Lambert's law"
    if not getattr(light, "normalize", True):
        yield "that the light is not normalized is ignored; its energy is its power, whatever its size"
    if not light.use_shadow:
        yield "that the light casts no shadow is ignored; surfaces hide it"
    if light.type == "SPOT" and light.use_square:
        yield "the spot's square shape is ignored; its cone is round"


# Custom properties ----------------------------------------------------------------------------------------------------


def _number(id_block, key: str, default: float, owner: str, unit: str) -> float:
    """The custom property `key` as a float; SceneError if it is anything but a number."""
    value = id_block.get(key)
    if value is None:
        return default
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise SceneError(f"{owner}: {key} is {_describe(value)}, expected a number{unit}")
    return float(value)


def _describe(value) -> str:
    """A custom property's value as users know it."""
    if hasattr(value, "to_dict"):
        value = value.to_dict()
    elif hasattr(value, "to_list"):
        value = value.to_list()
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def read_temperature(id_block, default: float, owner: str) -> float:
    """The custom property `temperature`, K, checked."""
    temperature = _number(id_block, "temperature", default, owner, " in kelvin")
    check_temperature(temperature, owner)
    return temperature


def layer_world(scene, layer):
    """The world that a view layer shows, or None: its own if it overrides the scene's."""
    return layer.world_override or scene.world


def world_temperature(world) -> float:
    """What rays that leave the scene see, K; without the property, or without a world, that is 0 K."""
    return 0.0 if world is None else read_temperature(world, 0.0, f"World '{world.name}'")


# Materials ------------------------------------------------------------------------------------------------------------


def read_material(material, default_emissivity: float) -> Material:
    """The solver's material from a Blender material's custom properties."""
    owner = f"Material '{material.name}'"
    emissivity = material.get("emissivity")  # Blender 5 can hold None, which is as good as nothing
    return Material(
        name=material.name,
        emissivity=default_emissivity if emissivity is None else _emissivity(emissivity, owner),
        specular=_number(material, "specular", 0.0, owner, " from 0 to 1"),
        roughness=_number(material, "roughness", 0.0, owner, " from 0 to 1"),
    )


def _emissivity(value, owner: str) -> float | np.ndarray:
    """A float, or an (n, 2) array of [um, emissivity] from a flat list or the name of a library material."""
    if isinstance(value, str):
        return _library_emissivity(value, owner)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if getattr(value, "typecode", None) not in ("i", "f", "d"):  # an IDPropertyArray of numbers
        raise SceneError(
            f"{owner}: emissivity is {_describe(value)}, expected a number, "
            "a flat list of wavelengths (um) and emissivities, or the name of a library material"
        )
    return pair_points(value.to_list(), owner)


def pair_points(numbers: list[float], owner: str) -> np.ndarray:
    """(n, 2) float64 points [um, emissivity] of a flat list. Raises SceneError unless its length is even."""
    if len(numbers) == 0 or len(numbers) % 2:
        raise SceneError(
            f"{owner}: the emissivity list has {len(numbers)} numbers, expected pairs of wavelength (um) and emissivity"
        )
    return np.array(numbers, dtype=np.float64).reshape(-1, 2)


def _library_emissivity(name: str, owner: str) -> np.ndarray:
    try:
        return library.find(name)
    except KeyError as error:
        raise SceneError(f"{owner}: {error.args[0]}") from None


# Surfaces -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MeshData:
    """A mesh in its own space, read once however often it is instanced.

    vertices: (n, 3) float64. triangles: (m, 3) int32. slot: (m,) int32, material slot of each triangle.
    temperature: (m,) or (m, 3) float32 K from the mesh attribute, or None.
    """

    vertices: np.ndarray
    triangles: np.ndarray
    slot: np.ndarray
    temperature: np.ndarray | None


def read_mesh(mesh, owner: str, warnings: Warnings) -> MeshData:
    """Positions, triangles, slots and the `temperature` attribute of an evaluated mesh, one bulk read for each."""
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    if count == 0:
        return MeshData(np.empty((0, 3)), np.empty((0, 3), np.int32), np.empty(0, np.int32), None)
    corner_vertices = read_values(mesh.attributes[".corner_vert"].data, "value", np.int32)
    corners = np.empty(3 * count, dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    faces = np.empty(count, dtype=np.int32)
    mesh.loop_triangle_polygons.foreach_get("value", faces)
    slots = mesh.attributes.get("material_index")
    return MeshData(
        vertices=read_values(mesh.attributes["position"].data, "vector", np.float32, 3).astype(np.float64),
        triangles=corner_vertices[corners].reshape(-1, 3),
        slot=np.zeros(count, np.int32) if slots is None else read_values(slots.data, "value", np.int32)[faces],
        temperature=_triangle_temperatures(mesh, corner_vertices, corners, faces, owner, warnings),
    )


def attribute_temperatures(mesh, owner: str) -> np.ndarray | None:
    """The mesh attribute `temperature`, (n,) float32 K on its domain; None without one that counts.

    owner: name of the mesh's object. Raises SceneError if a value cannot be rendered.
    """
    attribute = usable_attribute(mesh)
    if attribute is None or len(attribute.data) == 0:  # in Edit Mode there is nothing to read
        return None
    values = read_values(attribute.data, "value", np.float32)
    for value in (values.min(), values.max()):  # NaN is both
        check_temperature(value, f"Attribute '{NAME}' of object '{owner}'")
    return values


def _triangle_temperatures(mesh, corner_vertices, corners, faces, owner, warnings) -> np.ndarray | None:
    """The mesh attribute `temperature` per triangle (m,) or per triangle corner (m, 3), float32 K; None without one."""
    values, attribute = attribute_temperatures(mesh, owner), mesh.attributes.get(NAME)
    if values is None:
        if attribute is not None:
            kind = f"{attribute.data_type.lower()} on {attribute.domain.lower()}s"
            message = f"the attribute '{NAME}' ({kind}) is no float on points, corners or faces"
            warnings.add(owner, f"{message}; using the object's temperature")
        return None
    if attribute.domain == "FACE":
        return values[faces]
    return values[corner_vertices[corners] if attribute.domain == "POINT" else corners].reshape(-1, 3)


class SurfaceReader:
    """Gathers the triangles of all objects and their instances in world space."""

    def __init__(
        self,
        depsgraph,
        warnings: Warnings,
        kept: dict[tuple[str, int], MeshData] | None = None,
        groups: GroupReader | None = None,
    ):
        """kept: meshes that did not change since an earlier read, from its `kept`; None reads all. groups: None if
        temperature groups do not matter."""
        self.ambient_temperature, self.default = 0.0, Material()  # where nothing is set: read_contents reads them
        self.override, self.warnings = depsgraph.view_layer_eval.material_override, warnings
        self.meshes = {}  # address of the evaluated mesh -> MeshData
        self.kept = {}  # the same meshes, by the first object that has it, too: an address may be used once more
        self._earlier = kept or {}
        self.indices = {}  # Blender's material (None: no material) -> index into materials
        self.materials: list[Material] = []
        self.vertices, self.triangles, self.slots, self.temperatures = [], [], [], []
        self.groups, self.group_numbers = groups, []  # of each object
        self.vertex_count = 0
        self.pass_indices = {"object_index": [], "material_index": []}  # of the objects added, and of the materials

    def add(self, obj, matrix: np.ndarray) -> None:
        """One object or instance; matrix: (4, 4) float64, object to world."""
        if _is_gas_domain(obj):
            self.warnings.add(obj.name, "smoke and fire are not rendered")
            return
        if _has_particle_hair(obj):
            self.warnings.add(obj.name, "particle hair is not rendered, only its surface")
        key = obj.data.as_pointer()
        if key not in self.meshes:
            named = obj.name_full, key
            self.meshes[key] = self.kept[named] = self._earlier.get(named) or self._read(obj)
        mesh = self.meshes[key]
        if len(mesh.triangles) == 0:
            return
        with np.errstate(invalid="ignore"):  # what is not finite is reported below, by name
            vertices = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        if not np.isfinite(vertices.sum()):
            bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
            raise SceneError(f"Object '{obj.name}': vertex {bad} is not finite: {vertices[bad]}")
        triangles = mesh.triangles + np.int32(self.vertex_count)
        temperature = self._temperature(obj, mesh)
        if np.linalg.det(matrix[:3, :3]) < 0:  # a mirrored object keeps its front sides outside
            triangles = triangles[:, ::-1]
            temperature = temperature[:, ::-1] if temperature.ndim == 2 else temperature
        self.vertices.append(vertices)
        self.triangles.append(triangles)
        self.slots.append(self._materials(obj, mesh.slot))
        self.temperatures.append(temperature)
        self.pass_indices["object_index"].append(obj.pass_index)
        if self.groups is not None:
            number = self.groups.number(obj, f"Object '{obj.name}'", temperature)
            self.group_numbers.append(np.full(len(triangles), number, np.int16))
        self.vertex_count += len(vertices)

    def _read(self, obj) -> MeshData:
        if not obj.data.is_editmode:
            return read_mesh(obj.data, obj.name, self.warnings)
        try:  # in Edit Mode the evaluated data is empty, as long as nobody asks for a mesh
            return read_mesh(obj.to_mesh(), obj.name, self.warnings)
        finally:
            obj.to_mesh_clear()

    def arrays(self, world) -> dict:
        """The arguments of Scene that describe its surfaces, and their and the world's temperature groups."""
        temperatures = self.temperatures
        if any(t.ndim == 2 for t in temperatures):
            temperatures = [np.broadcast_to(t if t.ndim == 2 else t[:, None], (len(t), 3)) for t in temperatures]
        return {
            "vertices": np.concatenate(self.vertices),
            "triangles": np.concatenate(self.triangles),
            "material": np.concatenate(self.slots),
            "temperature": np.concatenate(temperatures),
            "materials": tuple(self.materials),
            **self._groups(world),
        }

    def labels(self, name: str) -> np.ndarray:
        """(m,) int32 Blender's 'object_index' or 'material_index' of each triangle."""
        indices = np.array(self.pass_indices[name], dtype=np.int32)
        if name == "object_index":
            return np.repeat(indices, [len(each) for each in self.triangles])
        return indices[np.concatenate(self.slots)]

    def _groups(self, world) -> dict:
        """The arguments of Scene that describe temperature groups, if there are any."""
        if self.groups is None:
            return {}
        of_world = -1
        if world is not None:
            of_world = self.groups.number(world, f"World '{world.name}'", np.float32([world_temperature(world)]))
        if not self.groups.names:
            return {}
        return {"groups": self.groups.names, "group": np.concatenate(self.group_numbers), "world_group": of_world}

    def _temperature(self, obj, mesh: MeshData) -> np.ndarray:
        if mesh.temperature is not None:
            return mesh.temperature
        if obj.get("temperature") is None:
            self.warnings.add(obj.name, f"no temperature, using the ambient {self.ambient_temperature:g} K")
        temperature = read_temperature(obj, self.ambient_temperature, f"Object '{obj.name}'")
        return np.full(len(mesh.triangles), temperature, dtype=np.float32)

    def _materials(self, obj, slot: np.ndarray) -> np.ndarray:
        """(m,) int32 index into materials for triangles with these material slots."""
        materials = [s.material for s in obj.material_slots] or [None]
        if self.override is not None:
            materials = [self.override] * len(materials)
        slot = np.clip(slot, 0, len(materials) - 1)  # as Blender: faces beyond the last slot take the last
        used = np.bincount(slot, minlength=len(materials)) > 0
        indices = np.zeros(len(materials), dtype=np.int32)
        for i in np.flatnonzero(used):
            if materials[i] is None:
                fallback = f"using the default emissivity {self.default.emissivity:g}"
                self.warnings.add(obj.name, f"faces without a material, {fallback}")
            indices[i] = self._index(materials[i])
        return indices[slot]

    def _index(self, material) -> int:
        key = None if material is None else material.as_pointer()
        if key not in self.indices:
            self.indices[key] = len(self.materials)
            default = self.default
            self.materials.append(default if material is None else read_material(material, default.emissivity))
            self.pass_indices["material_index"].append(0 if material is None else material.pass_index)
        return self.indices[key]


def _is_gas_domain(obj) -> bool:
    """True if the mesh is only the box around a smoke simulation."""
    return any(
        modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN" and modifier.domain_settings.domain_type == "GAS"
        for modifier in obj.modifiers
    )


def _has_particle_hair(obj) -> bool:
    """True if the object wears strands that would be rendered."""
    settings = [system.settings for system in obj.particle_systems]
    return any(each.type == "HAIR" and each.render_type == "PATH" for each in settings)


# Lights ---------------------------------------------------------------------------------------------------------------


def light_temperature(obj) -> float:
    """Temperature (K) of a light object, checked."""
    return read_temperature(obj, SUN_TEMPERATURE if obj.data.type == "SUN" else LAMP_TEMPERATURE, f"Light '{obj.name}'")


def metres_per_unit(scene) -> float:
    """The scene's Unit Scale: m, of one unit of its coordinates."""
    units = scene.unit_settings
    return 1.0 if units.system == "NONE" else units.scale_length


def read_light(obj, matrix: np.ndarray, metres: float = 1.0) -> list[Light]:
    """The solver's light for a light obj, none if it is dark; matrix: (4, 4) float64, object to world.

    Only an area light's size follows the object's scale, as in Cycles. metres: see metres_per_unit. Of a scene nothing
    depends on it but the W m-2 that lights bring: where 1 m is 1000 units, they spread over a million times the area.
    """
    light = obj.data
    owner = f"Light '{obj.name}'"
    sun = light.type == "SUN"
    temperature = light_temperature(obj)
    if not np.isfinite(matrix).all():
        raise SceneError(f"{owner}: its position or scale is not finite")
    if light.energy < 0 or not np.isfinite(light.energy):
        raise SceneError(f"{owner}: energy {light.energy:g} {'W/m2' if sun else 'W'}; lights radiate 0 or more")
    if light.energy == 0:
        return []
    common = {"temperature": temperature, "name": obj.name}
    if sun:
        direction = -_unit(matrix[:3, 2], owner)
        return [SunLight(direction=direction, irradiance=light.energy, angle=light.angle, **common)]
    common |= {"position": matrix[:3, 3], "power": light.energy / metres**2}
    if light.type == "AREA":
        return [_area_light(light, matrix, common)]
    common["radius"] = light.shadow_soft_size
    if light.type == "SPOT":
        direction = -_unit(matrix[:3, 2], owner)
        return [SpotLight(direction=direction, cone_angle=light.spot_size, blend=light.spot_blend, **common)]
    return [PointLight(**common)]


def _area_light(light, matrix: np.ndarray, common: dict) -> AreaLight:
    size_x, size_y = light.size, light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
    axis_u, axis_v = 0.5 * size_x * matrix[:3, 0], 0.5 * size_y * matrix[:3, 1]
    if not np.linalg.norm(np.cross(axis_u, axis_v)) > 0:
        raise SceneError(f"Light '{common['name']}': an area light needs a size and a scale above 0")
    if np.linalg.det(matrix[:3, :3]) < 0:  # a mirrored light still shines towards its own -Z
        axis_u = -axis_u
    return AreaLight(axis_u=axis_u, axis_v=axis_v, ellipse=light.shape in ("DISK", "ELLIPSE"), **common)


def _unit(vector: np.ndarray, owner: str) -> np.ndarray:
    length = np.linalg.norm(vector)
    if not length > 0:
        raise SceneError(f"{owner}: its scale is 0, so it points nowhere")
    return vector / length
