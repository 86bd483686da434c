# SPDX-License-Identifier: GPL-3.0-or-later
"""Which temperature counts on a surface: that of an image, else of the mesh, else of the object, else the ambient one.

An object has an image in its custom property `temperature_image`; a mesh has the float attribute `temperature`, K, on
points, corners or faces; an object has a temperature in its custom property of that name.
"""

from __future__ import annotations

import numpy as np

from ..solver.scene import SceneError, check_temperature
from .arrays import read_values, render_uv_map, same_elements
from .custom_properties import read_temperature
from .images import is_image, kelvin_pixels, read_lookup
from .temperature_fields import TemperatureError, check_kelvin, sample_image
from .warnings import Warnings

NAME = "temperature"  # of the custom property and of the mesh attribute
DOMAINS = {"POINT": "points", "CORNER": "corners", "FACE": "faces", "CURVE": "curves"}
HAIR_WITHOUT = "its particle hair has "  # before "no temperature": that of the mesh does not count for the hair
WITH_ATTRIBUTES = {"MESH", "CURVES", "POINTCLOUD"}  # types of objects whose data has attributes


def usable_attribute(mesh):
    """The mesh attribute that the engine takes temperatures from, or None."""
    attribute = mesh.attributes.get(NAME)
    usable = attribute is not None and attribute.data_type == "FLOAT" and attribute.domain in DOMAINS
    return attribute if usable else None


def temperature_source(obj, depsgraph) -> str:
    """What gives an object its temperature: an "IMAGE", the "ATTRIBUTE" of its evaluated mesh, a "PROPERTY" of its own,
    or "AMBIENT". An image that cannot be read, of which the checks tell, counts as one."""
    mesh = obj.evaluated_get(depsgraph).data
    if has_image(obj, mesh):
        return "IMAGE"
    if obj.type in WITH_ATTRIBUTES and usable_attribute(mesh):
        return "ATTRIBUTE"
    return "PROPERTY" if NAME in obj else "AMBIENT"


def has_image(obj, mesh) -> bool:
    """Whether an image gives the temperatures of an object with this data, which has coordinates for it. Which ones a
    curve or a text gets as a mesh is not known here."""
    if obj.type in ("CURVES", "POINTCLOUD"):  # they have no coordinates
        return False
    on_mesh = obj.type != "MESH" or mesh.is_editmode or render_uv_map(mesh) is not None
    return is_image(obj.get("temperature_image")) and on_mesh


def image_temperatures(obj) -> np.ndarray | None:
    """(height, width) float32 K of the image that gives an object its temperatures before its modifiers; None without
    one that can be read. Raises SceneError, naming object and image, if it holds no temperatures."""
    if not has_image(obj, obj.data):
        return None
    try:
        return kelvin_pixels(obj["temperature_image"], obj, f"Object '{obj.name}'")
    except TemperatureError:  # its own temperature counts
        return None


def own_temperature(obj, scene) -> float:
    """Temperature (K) of an object without the mesh attribute: its property, or what is ambient.

    Raises TemperatureError, naming the object, if the property is no temperature.
    """
    try:
        return read_temperature(obj, scene.infrared.ambient_temperature, f"Object '{obj.name}'")
    except SceneError as error:
        raise TemperatureError(str(error)) from None


def attribute_temperatures(mesh, owner: str) -> np.ndarray | None:
    """The mesh attribute `temperature`, (n,) float32 K on its domain; None without a usable one.

    owner: name of the mesh's object. Raises SceneError if a value cannot be rendered.
    """
    attribute = usable_attribute(mesh)
    if attribute is None or len(attribute.data) == 0:  # in Edit Mode there is nothing to read
        return None
    values = read_values(attribute.data, "value", np.float32)
    for value in (values.min(), values.max()):  # NaN is both
        check_temperature(value, f"Attribute '{NAME}' of object '{owner}'")
    return values


def object_temperatures(obj, ambient: float) -> list[float]:
    """Temperatures (K) of an object before its modifiers: the lowest and the highest of its image or attribute, or its
    only one.

    ambient: K, where it has none. Raises SceneError, naming the object, if a value cannot be rendered.
    """
    image = image_temperatures(obj)
    own = [] if image is not None and not _is_clipped(obj) else temperatures_without_image(obj, ambient)
    every = own if image is None else [*own, float(image.min()), float(image.max())]
    return every if len(every) == 1 else [min(every), max(every)]


def _is_clipped(obj) -> bool:
    """Whether the own temperature of an object counts outside its image."""
    return read_lookup(obj, NAME, Warnings())[0] == "CLIP"


def temperatures_without_image(obj, ambient: float) -> list[float]:
    """As object_temperatures, of an object without an image, or where it does not reach."""
    values = attribute_temperatures(obj.data, obj.name) if obj.type in WITH_ATTRIBUTES else None
    if values is None:
        return [read_temperature(obj, ambient, f"Object '{obj.name}'")]
    return [float(values.min()), float(values.max())]


def vertex_temperatures(obj, depsgraph, scene) -> tuple[str, np.ndarray]:
    """The temperatures that an object's mesh would be rendered with: their domain, "POINT" or "CORNER", and (n,) K. Of
    an image, those that it has at the corners.

    Raises TemperatureError, naming the object, if one cannot be rendered.
    """
    domain, kelvin = _own_temperatures(obj, depsgraph, scene)
    try:
        image = image_temperatures(obj)
    except SceneError as error:
        raise TemperatureError(str(error)) from None
    uv_map = render_uv_map(obj.data)
    if image is None or uv_map is None:
        return domain, kelvin
    uv = read_values(uv_map.uv, "vector", np.float32, 2)
    at_corners = sample_image(image, uv, *read_lookup(obj, NAME, Warnings()))
    if domain == "POINT":
        kelvin = kelvin[read_values(obj.data.loops, "vertex_index", np.int32)]
    return "CORNER", np.where(np.isnan(at_corners), kelvin, at_corners).astype(np.float32)


def _own_temperatures(obj, depsgraph, scene) -> tuple[str, np.ndarray]:
    """Those without an image, likewise."""
    mesh = obj.data
    evaluated = obj.evaluated_get(depsgraph).data
    attribute = usable_attribute(evaluated if same_elements(mesh, evaluated) else mesh)
    if attribute is None:
        return "POINT", np.full(len(mesh.vertices), own_temperature(obj, scene))
    kelvin = read_values(attribute.data, "value", np.float32)
    check_kelvin(kelvin, f"Object '{obj.name}'")
    if attribute.domain != "FACE":
        return attribute.domain, kelvin
    return "CORNER", np.repeat(kelvin, read_values(mesh.polygons, "loop_total", np.int32))
