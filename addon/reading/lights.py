# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's light objects become the solver's lights."""

from __future__ import annotations

import numpy as np

from ..solver.scene import (
    LAMP_TEMPERATURE,
    NARROWEST_SPREAD,
    SUN_TEMPERATURE,
    AreaLight,
    Light,
    PointLight,
    SceneError,
    SpotLight,
    SunLight,
)
from .custom_properties import read_temperature

_UNSEEN = 1e-4  # share by which scales may differ for nothing: matrices are rounded, and nobody sees it


def light_temperature(obj) -> float:
    """Temperature (K) of a light object, checked."""
    return read_temperature(obj, SUN_TEMPERATURE if obj.data.type == "SUN" else LAMP_TEMPERATURE, f"Light '{obj.name}'")


def metres_per_unit(scene) -> float:
    """Length of one unit of a scene's coordinates, m: its Unit Scale."""
    units = scene.unit_settings
    return 1.0 if units.system == "NONE" else units.scale_length


def uneven_beam(light, matrix: np.ndarray) -> str:
    """What is not followed of the scale of a light, and what is done instead; an empty text if all of it is.

    matrix: (4, 4) float64, object to world.
    """
    if light.type != "SPOT":
        return ""
    products = matrix[:3, :3].T @ matrix[:3, :3]
    even = np.diag((products[0, 0], products[0, 0], products[2, 2]))  # as wide along X as along Y, and upright
    if np.allclose(products, even, rtol=0.0, atol=_UNSEEN * products[0, 0]):
        return ""
    return "its scale would make the spot's beam elliptical or oblique; it is even and of the mean width"


def read_light(obj, matrix: np.ndarray, metres: float = 1.0) -> list[Light]:
    """The solver's light for a light obj, none if it is dark; matrix: (4, 4) float64, object to world.

    The size of an area light and the beam of a spot light follow the object's scale, radii do not, as in Cycles. What
    of a beam cannot be followed tells uneven_beam. metres: see metres_per_unit. Radiance does not
    depend on the scale of a scene, but the irradiance from a light of so many watts does: where a unit is a millimetre,
    the same watts fall on a millionth of the area. A light that is not normalized has its energy for each square metre
    of its surface, and so is as bright whatever its size and the unit; a sun then has it for each steradian, by the
    cosine. That is how Cycles has it (LightManager::device_update_lights in its scene/light.cpp); what has no size
    counts as normalized there, too. Raises SceneError, naming the light, if a value makes no sense.
    """
    light = obj.data
    owner = f"Light '{obj.name}'"
    sun = light.type == "SUN"
    temperature = light_temperature(obj)
    if not np.isfinite(matrix).all():
        raise SceneError(f"{owner}: its position or scale is not finite")
    if light.energy < 0 or not np.isfinite(light.energy):
        raise SceneError(f"{owner}: energy {light.energy:g} {'W/m2' if sun else 'W'}; lights radiate 0 or more")
    if light.energy == 0 or temperature == 0:  # a blackbody of 0 K radiates in no band
        return []
    energy = light.energy * 2.0**light.exposure
    common = {"temperature": temperature, "name": obj.name}
    if sun:
        seen = np.pi * np.sin(0.5 * light.angle) ** 2  # sr, by the cosine
        irradiance = energy if light.normalize or seen == 0.0 else energy * seen
        direction = -_unit(matrix[:3, 2], owner)
        return [SunLight(direction=direction, irradiance=irradiance, angle=light.angle, **common)]
    common |= {"position": matrix[:3, 3], "power": energy / metres**2}
    if light.type == "AREA":
        return [_area_light(light, matrix, common, None if light.normalize else energy)]
    common["radius"] = light.shadow_soft_size
    if not light.normalize and light.shadow_soft_size > 0.0:
        common["power"] = energy * 4.0 * np.pi * light.shadow_soft_size**2
    if light.type == "SPOT":
        square = _unit(matrix[:3, 0], owner) if light.use_square else None
        direction = -_unit(matrix[:3, 2], owner)
        cone, blend = _scaled_beam(light.spot_size, light.spot_blend, _beam_width(matrix, owner))
        return [SpotLight(direction=direction, cone_angle=cone, blend=blend, square=square, **common)]
    return [PointLight(**common)]


def _beam_width(matrix: np.ndarray, owner: str) -> float:
    """How much wider a beam is at any distance than that of an unscaled light; the mean over all sides of an uneven
    one, by the area that it shines on."""
    area = abs(np.linalg.det(matrix[:3, :3])) / np.linalg.norm(matrix[:3, 2])  # across the beam, of a unit square
    if not area > 0.0:
        raise SceneError(f"{owner}: its scale across its beam is 0, so the beam has no width")
    width = float(np.sqrt(area) / np.linalg.norm(matrix[:3, 2]))
    return 1.0 if abs(width - 1.0) < _UNSEEN else width


def _scaled_beam(cone: float, blend: float, width: float) -> tuple[float, float]:
    """Cone angle and blend of a beam that is so much wider. Between the edges of its rim, which are exact, it fades by
    the cosine in the world, in Cycles by that in the light's own space."""
    if width == 1.0:
        return cone, blend
    edge = np.cos(0.5 * cone)
    inside = np.arccos(edge + (1.0 - edge) * blend)  # where the light begins to fade
    half, inside = (np.arctan2(width * np.sin(angle), np.cos(angle)) for angle in (0.5 * cone, inside))
    return float(2.0 * half), float((np.cos(inside) - np.cos(half)) / (1.0 - np.cos(half)))


def _area_light(light, matrix: np.ndarray, common: dict, exitance: float | None) -> AreaLight:
    """exitance: W/m2 in place of the power, None for that."""
    size_x, size_y = light.size, light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
    axis_u, axis_v = 0.5 * size_x * matrix[:3, 0], 0.5 * size_y * matrix[:3, 1]
    if not np.linalg.norm(np.cross(axis_u, axis_v)) > 0:
        raise SceneError(f"Light '{common['name']}': an area light needs a size and a scale above 0")
    if np.linalg.det(matrix[:3, :3]) < 0:  # a mirrored light still shines towards its own -Z
        axis_u = -axis_u
    ellipse = light.shape in ("DISK", "ELLIPSE")
    if exitance is not None:
        area = np.linalg.norm(np.cross(axis_u, axis_v)) * (np.pi if ellipse else 4.0)
        common["power"] = exitance * float(area)
    spread = min(max(light.spread, NARROWEST_SPREAD), np.pi)
    return AreaLight(axis_u=axis_u, axis_v=axis_v, ellipse=ellipse, spread=spread, **common)


def _unit(vector: np.ndarray, owner: str) -> np.ndarray:
    length = np.linalg.norm(vector)
    if not length > 0:
        raise SceneError(f"{owner}: its scale is 0, so it points nowhere")
    return vector / length
