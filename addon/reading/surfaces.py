# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of all objects and their instances in world space, with their materials and temperatures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..output.coco import Labelled
from ..solver.scene import Material, SceneError
from .categories import Categories
from .custom_properties import driver_remark, read_temperature
from .groups import GroupReader, read_group
from .materials import FRESNEL_LEFT_OUT, leaves_fresnel_out, read_material, surface_remarks
from .media import GROUPED_AIR, NO_GROUP, is_medium, read_medium, read_world_medium
from .meshes import MeshData, read_mesh
from .objects import STRAND_TYPES
from .spheres import Points
from .strands import NO_LAYER, PixelSize, detail, path_systems, read_particle_hair, read_strands, triangles_of
from .surface_temperature import HAIR_WITHOUT, usable_attribute
from .textures import OWN_TEMPERATURE, TextureReader, joined, mirrored
from .tubes import Strands
from .visibility import SEEN, Visibility
from .volumes import VolumeReader, is_gas_domain
from .warnings import Warnings
from .world import air_temperature, read_sky, world_temperature

WITHOUT_MATERIAL = "default_surface"  # name of the material, in mattes, of faces that have none, as Cycles has it


class SurfaceReader:
    """Gathers the triangles of all objects and their instances in world space."""

    def __init__(
        self,
        depsgraph,
        warnings: Warnings,
        kept: dict[tuple, MeshData | Strands | Points] | None = None,
        groups: GroupReader | None = None,
        kept_images: dict[tuple, tuple] | None = None,
        categories: Categories | None = None,
    ):
        """kept: meshes that did not change since an earlier reader kept them; None reads all.
        groups, categories: None if temperature groups, or instances, do not matter. kept_images: see TextureReader.
        """
        self.ambient_temperature, self.default = 0.0, Material()  # where nothing is set; scene_reader sets them
        self.override, self.warnings = depsgraph.view_layer_eval.material_override, warnings
        # Address of the evaluated mesh -> MeshData; that of hair or points with "source" -> Strands or Points, with a
        # level of detail -> MeshData
        self.meshes = {}
        self.kept = {}  # (first object that has it, *address) -> the same; another mesh may get the address later
        self._earlier = kept or {}
        self.indices = {}  # Blender's material (None: no material) -> index into materials
        self.materials: list[Material] = []
        self.vertices, self.triangles, self.slots, self.temperatures = [], [], [], []
        self.normals = []  # (m, 3, 3) float32 of each object, None of flat ones
        self.textures = TextureReader(warnings, kept_images)
        self.varying = []  # rows of Textures of each object, None if nothing varies over it
        self.metres, self.media = 1.0, []  # length of a unit, which scene_reader sets
        self.volumes = VolumeReader(warnings)
        self.groups, self.group_numbers = groups, []  # (triangles,) int16 of each object
        self.visibilities: list[Visibility] = []  # of each object
        self.vertex_count = 0
        self.pass_indices = {"object_index": [], "material_index": []}  # of each object, and of each material
        self.matte_names = {"CryptoObject": [], "CryptoAsset": [], "CryptoMaterial": []}  # likewise
        self.categories, self.instances = categories, []  # Labelled, of each instance
        self.instancer = None  # evaluated object that places what is added next, which scene_reader sets
        self.instance_count, self.instance_numbers = 0, []  # from 1, of each entry of triangles
        self._begins = False  # whether what is placed next belongs to a new instance
        self.for_render = depsgraph.mode == "RENDER"
        self.pixel_size: PixelSize | None = None  # which scene_reader sets if a camera tells it

    def add(self, obj, matrix: np.ndarray, visibility: Visibility = SEEN) -> None:
        """One object or instance; matrix: (4, 4) float64, object to world. visibility: of its surface, not of gases."""
        if is_gas_domain(obj):
            self.add_volume(obj, matrix)
            return
        self._begins = True
        materials = self._slot_materials(obj)
        layers = self.textures.layers(obj, materials)
        if obj.type in STRAND_TYPES:
            mesh = self._strands(obj, obj.data.as_pointer(), matrix, lambda: read_strands(obj, self.warnings))
            mesh = replace(mesh, layers=dict.fromkeys(layers, NO_LAYER))
        else:
            mesh = self._mesh(obj, layers)
        self._place(obj, mesh, materials, matrix, visibility)

    def add_particle_hair(self, obj, matrix: np.ndarray, source, alone: bool, visibility: Visibility = SEEN) -> None:
        """The particle hair of one object or instance; matrix, visibility: see add.

        source: the evaluated object that has the particles. alone: whether the surface from which the hair grows is not
        shown, so that it was not added before.
        """
        self._begins |= alone
        if not any(path_systems(source, self.for_render)):
            return
        materials = self._slot_materials(obj)

        def read():
            return read_particle_hair(source, self.for_render, self.warnings)

        mesh = self._strands(obj, source.as_pointer(), matrix, read)
        layers = dict.fromkeys(self.textures.layers(obj, materials), NO_LAYER)
        whose = HAIR_WITHOUT if usable_attribute(obj.data) else ""
        self._place(obj, replace(mesh, layers=layers), materials, matrix, visibility, whose)

    def _place(
        self, obj, mesh: MeshData, materials: list, matrix: np.ndarray, visibility: Visibility, whose: str = ""
    ) -> None:
        """A mesh of an object, where a matrix (4, 4) takes it. whose: see _temperature."""
        if len(mesh.triangles) == 0:
            return
        vertices = _in_world_space(mesh.vertices, matrix, obj.name)
        temperature = self._temperature(obj, mesh, whose)
        mesh = replace(mesh, slot=_known_slots(mesh.slot, materials))
        filled = np.array([is_medium(material) for material in materials])[mesh.slot]
        if filled.any():
            slots = materials, np.where(filled, mesh.slot, -1)
            self._add_media(obj, vertices, mesh.triangles, slots, temperature)
            if filled.all():
                return
            mesh, temperature = mesh.part(~filled), temperature[~filled]
        triangles = mesh.triangles + np.int32(self.vertex_count)
        normals = _normals_in_world_space(mesh.normals, matrix)
        varying = self.textures.rows(obj, mesh, materials, self._index)
        if np.linalg.det(matrix[:3, :3]) < 0:  # a mirrored object keeps its front sides outside
            triangles = triangles[:, ::-1]
            temperature = temperature[:, ::-1] if temperature.ndim == 2 else temperature
            normals = None if normals is None else normals[:, ::-1]
            varying = None if varying is None else mirrored(varying)
        self.normals.append(normals)
        self.varying.append(varying)
        self.vertices.append(vertices)
        self.triangles.append(triangles)
        self.slots.append(self._materials(obj, materials, mesh.slot))
        self.temperatures.append(temperature)
        self.visibilities.append(visibility)
        self.pass_indices["object_index"].append(obj.pass_index)
        self.matte_names["CryptoObject"].append(obj.name)
        self.matte_names["CryptoAsset"].append(_top_parent(obj).name)
        if self._begins:
            self._begins, self.instance_count = False, self.instance_count + 1
            if self.categories is not None:
                self.instances.append(Labelled(obj.name, self.categories.of(obj, self.instancer)))
        self.instance_numbers.append(self.instance_count)
        if self.groups is not None:
            self._check_group(obj, mesh)
            number = self.groups.number(obj, f"Object '{obj.name}'", temperature)
            self.group_numbers.append(np.full(len(triangles), number, np.int16))
        self.vertex_count += len(vertices)

    def add_volume(self, obj, matrix: np.ndarray) -> None:
        """The gas in a Volume object, a smoke domain or an instance of one; matrix: (4, 4) float64, object to world."""
        materials = self._slot_materials(obj)
        read = self.volumes.read_smoke if is_gas_domain(obj) else self.volumes.read
        medium = read(obj, matrix, materials[0], self.ambient_temperature, self.metres)
        if medium is not None:
            self.media.append(medium)

    def _add_media(self, obj, vertices, triangles, slots, temperature) -> None:
        """The gases in an object. slots: its materials, and (m,) which of them each triangle has, -1 for none here."""
        materials, slot = slots
        kelvin = float(temperature.mean(dtype=np.float64))
        if np.ptp(temperature) > 0.0:
            self.warnings.add(obj.name, "a gas has one temperature; the mean of its mesh counts")
        if self.textures.temperature_image(obj) >= 0:
            self.warnings.add(obj.name, f"a gas has one temperature; not that of an image, {OWN_TEMPERATURE}")
        if self.groups is not None:
            self.warnings.add(obj.name, NO_GROUP)
        for number in np.unique(slot[slot >= 0]):
            used = triangles[slot == number]
            medium = read_medium(obj, materials[number], kelvin, vertices, used, self.warnings, self.metres)
            if medium is not None:
                self.media.append(medium)

    def _mesh(self, obj, layers: set[str]) -> MeshData:
        """The mesh of an object with these layers. It may be that of an earlier object or of an earlier reader."""
        key = obj.data.as_pointer()
        named = obj.name_full, key
        known = self.meshes.get(key) or self._earlier.get(named)
        if known is None or not layers <= known.layers.keys():
            known = self._read(obj, layers if known is None else layers | known.layers.keys())
        if self.meshes.get(key) is not known:
            self.meshes[key] = self.kept[named] = known
        return known

    def _strands(self, obj, address: int, matrix: np.ndarray, read: Callable[[], Strands | Points]) -> MeshData:
        """The triangles of hair or points, in the space of their object; instances share them, see strands.detail.

        address: of what read() reads.
        """
        source = self._once(obj, (address, "source"), read)
        level, pixel = detail(source, matrix, self.pixel_size)
        return self._once(obj, (address, level), lambda: triangles_of(source, pixel, obj.name))

    def _once(self, obj, key: tuple, make: Callable):
        """What an object's key stands for: what an earlier object or reader kept, or make()."""
        named = obj.name_full, *key
        known = self.meshes.get(key) or self._earlier.get(named)
        self.meshes[key] = self.kept[named] = make() if known is None else known
        return self.kept[named]

    def _read(self, obj, layers: set[str]) -> MeshData:
        if not obj.data.is_editmode:
            return read_mesh(obj.data, obj.name, self.warnings, layers)
        try:  # in Edit Mode the evaluated mesh is empty, and to_mesh makes one
            return read_mesh(obj.to_mesh(), obj.name, self.warnings, layers)
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
            "corner_normals": self._corner_normals(),
            "textures": joined(self.varying, [len(each) for each in self.triangles], self.textures.images),
            "hidden": self._marked("hidden", np.uint8),
            "holdout": self._marked("holdout", np.bool_),
            **self._media(world),
            **self._groups(world),
        }

    def _marked(self, name: str, dtype: type) -> np.ndarray | None:
        """(m,) of a dtype, whether triangles are 'hidden' or a 'holdout', see Visibility; None if none are."""
        marks = np.array([getattr(each, name) for each in self.visibilities], dtype)
        return np.repeat(marks, [len(each) for each in self.triangles]) if marks.any() else None

    def _corner_normals(self) -> np.ndarray | None:
        """(m, 3, 3) float32 of all triangles, 0 on flat ones; None if all are flat."""
        if all(normals is None for normals in self.normals):
            return None
        of_objects = zip(self.triangles, self.normals, strict=True)
        flat = [np.zeros((len(t), 3, 3), np.float32) if normals is None else normals for t, normals in of_objects]
        return np.concatenate(flat)

    def labels(self, name: str) -> np.ndarray:
        """(m,) int32 Blender's 'object_index' or 'material_index' of each triangle, or its 'instance', from 1."""
        if name == "instance":
            return np.repeat(np.array(self.instance_numbers, np.int32), list(map(len, self.triangles)))
        return self._on_triangles(np.array(self.pass_indices[name], dtype=np.int32), name == "material_index")

    def mattes(self, kind: str) -> tuple[list[str], np.ndarray]:
        """The names of a kind of mattes, "CryptoObject", "CryptoAsset" (the topmost parents of objects) or
        "CryptoMaterial", and (m,) int32 which of them each triangle has, from 1."""
        names, number = np.unique(self.matte_names[kind], return_inverse=True)
        return names.tolist(), self._on_triangles(1 + number.astype(np.int32), kind == "CryptoMaterial")

    def _on_triangles(self, values: np.ndarray, of_materials: bool) -> np.ndarray:
        """Values of materials, or of objects, on the triangles that have them."""
        if of_materials:
            return values[np.concatenate(self.slots)]
        return np.repeat(values, [len(each) for each in self.triangles])

    def _media(self, world) -> dict:
        """The arguments of Scene that describe gases, if there are any."""
        kelvin = air_temperature(world) if is_medium(world) else 0.0  # a sky's image takes time to read
        of_world, depth = read_world_medium(world, kelvin, self.warnings, self.metres)
        media = (*self.media, *of_world)
        return {"media": media, "world_depth": depth} if media else {}

    def _groups(self, world) -> dict:
        """The arguments of Scene that describe temperature groups, if there are any."""
        if self.groups is None:
            return {}
        of_world = -1
        if world is not None:
            kelvin = np.float32([world_temperature(world)])
            of_world = self.groups.number(world, f"World '{world.name}'", kelvin)
            if of_world >= 0 and read_sky(world) is not None:
                raise SceneError(f"World '{world.name}': a temperature that depends on the direction is in no group")
            if of_world >= 0 and is_medium(world):
                self.warnings.add(world.name, GROUPED_AIR)
        if not self.groups.names:
            return {}
        return {"groups": self.groups.names, "group": np.concatenate(self.group_numbers), "world_group": of_world}

    def _temperature(self, obj, mesh: MeshData, whose: str) -> np.ndarray:
        """(m,) or (m, 3) float32 K of an object's triangles, or of their corners. whose: in messages, what of the
        object has none."""
        if mesh.temperature is not None:
            return mesh.temperature
        if not self.textures.covers(obj, mesh.layers):
            if obj.get("temperature") is None:
                self.warnings.add(
                    obj.name, f"{whose}no temperature; the ambient {self.ambient_temperature:.5g} K counts"
                )
            if remark := driver_remark(obj):
                self.warnings.add(obj.name, remark)
        temperature = read_temperature(obj, self.ambient_temperature, f"Object '{obj.name}'")
        return np.full(len(mesh.triangles), temperature, dtype=np.float32)

    def _check_group(self, obj, mesh: MeshData) -> None:
        """Raise SceneError if an object whose temperatures an image gives is in a temperature group."""
        owner = f"Object '{obj.name}'"
        name = read_group(obj, owner)
        if name and self.textures.usable_temperature_image(obj, mesh.layers) >= 0:
            raise SceneError(
                f"{owner}: its temperature comes from the image '{obj['temperature_image'].name}', but it is in the "
                f"temperature group '{name}'; a group has one temperature"
            )

    def _slot_materials(self, obj) -> list:
        """The materials of an object's slots, one or more; None where there is none."""
        materials = [slot.material for slot in obj.material_slots] or [None]
        return materials if self.override is None else [self.override] * len(materials)

    def _materials(self, obj, materials: list, slot: np.ndarray) -> np.ndarray:
        """(m,) int32 index into materials for triangles with these slots of an object's materials."""
        used = np.bincount(slot, minlength=len(materials)) > 0
        indices = np.zeros(len(materials), dtype=np.int32)
        for i in np.flatnonzero(used):
            if materials[i] is None:
                fallback = f"using the default emissivity {self.default.emissivity:g}"
                self.warnings.add(obj.name, f"faces without a material, {fallback}")
            indices[i] = self._index(materials[i])
        return indices[slot]

    def _index(self, material) -> int:
        """Index into materials of a Blender material, or of None; it is read if it is a new one."""
        key = None if material is None else material.as_pointer()
        if key not in self.indices:
            self.indices[key] = len(self.materials)
            self.materials.append(self.default if material is None else self._read_material(material))
            self.pass_indices["material_index"].append(0 if material is None else material.pass_index)
            self.matte_names["CryptoMaterial"].append(WITHOUT_MATERIAL if material is None else material.name)
        return self.indices[key]

    def _read_material(self, material) -> Material:
        read = read_material(material, self.default.emissivity)
        if leaves_fresnel_out(material, read):
            self.warnings.add(material.name, FRESNEL_LEFT_OUT)
        for remark in surface_remarks(material):
            self.warnings.add(material.name, remark)
        return read


def _top_parent(obj):
    """The topmost parent of an object, itself without one."""
    while obj.parent is not None:
        obj = obj.parent
    return obj


def _known_slots(slot: np.ndarray, materials: list) -> np.ndarray:
    """(m,) int32 slots of triangles. As in Blender, faces beyond the last slot take the last."""
    return np.clip(slot, 0, len(materials) - 1)


def _in_world_space(vertices: np.ndarray, matrix: np.ndarray, owner: str) -> np.ndarray:
    """(n, 3) float64 vertices of an object in world space. Raises SceneError, naming a vertex that is not finite."""
    with np.errstate(invalid="ignore"):  # it is reported here, by name
        vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    if not np.isfinite(vertices.sum()):
        bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
        raise SceneError(f"Object '{owner}': vertex {bad} is not finite: {vertices[bad].tolist()}")
    return vertices


def _normals_in_world_space(normals: np.ndarray | None, matrix: np.ndarray) -> np.ndarray | None:
    """(m, 3, 3) float32 corner normals in world space. An object that a scale of 0 makes flat has none; a triangle with
    a corner whose normal has no direction is flat."""
    if normals is None or np.linalg.det(matrix[:3, :3]) == 0.0:
        return None
    turned = normals @ np.linalg.inv(matrix[:3, :3]).astype(np.float32)
    length = np.linalg.norm(turned, axis=2, keepdims=True)
    known = np.isfinite(length) & (length > 0.0)
    np.divide(turned, length, out=turned, where=known)
    turned[~known.all(axis=(1, 2))] = 0.0
    return turned
