# SPDX-License-Identifier: GPL-3.0-or-later
"""Which temperature counts on a surface: that of the mesh, else that of the object, else the ambient one.

A mesh has it in the float attribute `temperature`, K, on points, corners or faces; an object in its custom property of
that name.
"""

from __future__ import annotations

import numpy as np

from ..solver.scene import SceneError, check_temperature
from .arrays import read_values, same_elements
from .custom_properties import read_temperature
from .temperature_fields import TemperatureError, check_kelvin

NAME = "temperature"  # of the custom property and of the mesh attribute
DOMAINS = {"POINT": "points", "CORNER": "corners", "FACE": "faces"}


def usable_attribute(mesh):
    """The mesh attribute that the engine takes temperatures from, or None."""
    attribute = mesh.attributes.get(NAME)
    usable = attribute is not None and attribute.data_type == "FLOAT" and attribute.domain in DOMAINS
    return attribute if usable else None


def temperature_source(obj, depsgraph) -> str:
    """What gives an evaluated object its temperature: "ATTRIBUTE" of its mesh, "PROPERTY" of its own, or "AMBIENT"."""
    mesh = obj.evaluated_get(depsgraph).data
    if obj.type == "MESH" and usable_attribute(mesh):
        return "ATTRIBUTE"
    return "PROPERTY" if NAME in obj else "AMBIENT"


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
    """Temperatures (K) of an object before its modifiers: the lowest and the highest of its attribute, or its only one.

    ambient: K, where it has none. Raises SceneError, naming the object, if a value cannot be rendered.
    """
    values = attribute_temperatures(obj.data, obj.name) if obj.type == "MESH" else None
    if values is None:
        return [read_temperature(obj, ambient, f"Object '{obj.name}'")]
    return [float(values.min()), float(values.max())]


def vertex_temperatures(obj, depsgraph, scene) -> tuple[str, np.ndarray]:
    """The temperatures that an object's mesh would be rendered with: their domain, "POINT" or "CORNER", and (n,) K.

    Raises TemperatureError, naming the object, if one cannot be rendered.
    """
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
