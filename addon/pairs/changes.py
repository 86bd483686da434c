# SPDX-License-Identifier: GPL-3.0-or-later
"""What the rules of a file change in a Blender scene, for a while."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import partial
from itertools import product
from math import radians

import bpy
import numpy as np

from ..kept import Kept
from ..properties import initial_value
from ..reading.arrays import read_values
from ..reading.categories import Categories
from ..reading.custom_properties import is_number, read_temperature
from ..reading.images import temperature_range
from ..reading.objects import SURFACE_TYPES, rendered_objects
from ..reading.surface_temperature import NAME, WITH_ATTRIBUTES, temperature_source, usable_attribute
from ..reading.warnings import Warnings
from ..reading.world import SKY_KEYS, layer_world, sky_table
from ..solver.physics.clear_sky import check_weather, clear_sky
from ..solver.physics.humidity import dew_point
from ..solver.scene import SceneError, check_temperature
from .ranges import AXES, Rule, uniform

# Keys that change the same: of each only one may say what a thing's value is
_SAME = {"warmer": "temperature", "move": "location", "turn": "rotation"}
_WITH_HEAT = {*SURFACE_TYPES, "VOLUME", "LIGHT"}  # types of the objects that have a temperature


@dataclass(frozen=True)
class Change:
    """What is drawn of one thing. where: rule and key, for messages. stream: what the draws go by, see ranges.uniform.

    blocks: the data blocks that it may change; several where the camera changes. ranges: low and high by part. apply:
    function of a Kept and of the drawn values by part.
    """

    where: str
    thing: str
    key: str
    stream: str
    blocks: Sequence
    ranges: Mapping[str, tuple[float, float]]
    apply: Callable[[Kept, Mapping[str, float]], None]

    def drawn(self, seed: int, frame: int) -> dict[str, float]:
        """The values of a frame, by part."""
        shares = {part: uniform(seed, frame, f"{self.stream}/{part}") for part in self.ranges}
        return {part: low + (high - low) * shares[part] for part, (low, high) in self.ranges.items()}

    def end(self, number: int) -> dict[str, float]:
        """The low ends of all ranges (0), or the high ones (1)."""
        return {part: ends[number] for part, ends in self.ranges.items()}


def apply_draws(changes: Iterable[Change], kept: Kept, seed: int, frame: int) -> dict[str, float]:
    """Draw the values of a frame and change the scene; returns them by thing, key and part."""
    told = {}
    for change in changes:
        values = change.drawn(seed, frame)
        change.apply(kept, values)
        names = {part: f"{change.thing}.{change.key}" + f".{part}" * bool(part) for part in values}
        told |= {names[part]: value for part, value in values.items()}
    return told


def bind(rules: Sequence[Rule], scene, layer) -> list[Change]:
    """What the rules change in a scene with this view layer. Raises SceneError, naming rule, key and value, if that is
    nothing, or not possible."""
    changes, owner = [], {}
    for rule in rules:
        for change in _BINDERS[rule.section](rule, scene, layer):
            for slot in product(change.blocks, _slots(change)):
                if slot in owner:
                    raise SceneError(f"{change.where}: {owner[slot]} draws the same of '{slot[0].name_full}'")
                owner[slot] = change.where
            changes.append(change)
    return changes


def _slots(change: Change) -> set[str]:
    """Names of what a change says of its thing, each of which only one may say."""
    if change.key == "clear_sky":
        return {"temperature"}
    return {f"{_SAME.get(change.key, change.key)}{part}" for part in change.ranges}


def used_cameras(scene) -> list:
    """The camera of a scene, and those that markers make it."""
    return list(dict.fromkeys(each.camera for each in (scene, *scene.timeline_markers) if each.camera is not None))


def _changes(rule: Rule, thing: str, blocks: Sequence, makers: Mapping[str, Callable]) -> Iterator[Change]:
    """The changes of one thing. makers: function that applies each key; what has none is not drawn of this thing."""
    for key in [each for each in rule.ranges if each in makers]:
        stream = f"{rule.together or f'{rule.section}/{thing}'}/{key}"
        yield Change(f"{rule.where}.{key}", thing, key, stream, blocks, rule.ranges[key], makers[key])


# Objects --------------------------------------------------------------------------------------------------------------


def _of_objects(rule: Rule, scene, layer) -> Iterator[Change]:
    objects, kinds = _selected_objects(rule, scene), {**_POSES, "scale": _scale}
    heat = {"temperature": _set_temperature, "warmer": partial(_warm, scene)}
    for key in [each for each in rule.ranges if each in heat]:
        _check_heat(rule, key, objects)
    for obj in objects:
        of_type = kinds | heat if obj.type in _WITH_HEAT else kinds
        makers = {key: partial(change, obj) for key, change in of_type.items()}
        yield from _changes(rule, obj.name_full, (obj,), makers)
        if rule.visible is not None:
            stream = f"{rule.together or f'objects/{obj.name_full}'}/visible"
            apply = partial(_show, obj, rule.visible)
            yield Change(f"{rule.where}.visible", obj.name_full, "visible", stream, (obj,), {"": (0.0, 1.0)}, apply)


def _selected_objects(rule: Rule, scene) -> list:
    objects, categories = sorted(_all_objects(scene), key=lambda obj: obj.name_full), Categories(Warnings())
    names, kinds = (rule.selectors.get(key) for key in ("name", "category"))
    if names:
        objects = [obj for obj in objects if _fits(obj, names)]
    if kinds:
        objects = [obj for obj in objects if categories.of(obj) in kinds]
    if not objects:
        raise SceneError(f"{rule.where}: no object has {_told(rule.selectors)}")
    return objects


def _all_objects(scene) -> dict:
    """The objects of a scene and of the collections that it instances, also those that are hidden from renders."""
    return dict.fromkeys([*scene.objects, *rendered_objects(scene.objects)])


def _fits(block, patterns: Iterable[str]) -> bool:
    """Whether a data block has such a name. That with the library tells apart those of one name, and is no pattern:
    its brackets would be one."""
    return any(pattern == block.name_full or fnmatchcase(block.name, pattern) for pattern in patterns)


def _told(selectors: Mapping[str, Sequence[str]]) -> str:
    return " and ".join(key + " " + " or ".join(map(repr, texts)) for key, texts in selectors.items())


def _check_heat(rule: Rule, key: str, objects: Sequence) -> None:
    """Raise SceneError if these objects cannot get the temperatures of a rule, or so many K more. What has none may be
    among those that a pattern or a category chooses, but not be named, or be all."""
    where, warm = f"{rule.where}.{key}", [obj for obj in objects if obj.type in _WITH_HEAT]
    for obj in objects:
        if obj in warm:
            _check_temperatures(where, obj, key, rule.ranges[key][""])
        elif not warm or {obj.name, obj.name_full} & {*rule.selectors.get("name", ())}:
            group = obj.instance_collection
            other = "objects that have one" if group is None else f"the objects in its collection '{group.name}'"
            raise SceneError(f"{where}: '{obj.name_full}' ({_type_name(obj)}) has no temperature; choose {other}")


def _type_name(obj) -> str:
    """The type of an object as Blender shows it."""
    return obj.bl_rna.properties["type"].enum_items[obj.type].name


def _check_temperatures(where: str, obj, key: str, span: tuple[float, float]) -> None:
    """Raise SceneError if an object cannot get temperatures of this range, or so many K more."""
    source = temperature_source(obj, bpy.context.evaluated_depsgraph_get())
    if key == "temperature":
        if source in ("IMAGE", "ATTRIBUTE"):
            raise SceneError(f"{where}: the {source.lower()} of '{obj.name}' says how warm it is; use warmer, in K")
        check_temperature(span[1], f"{where}, '{obj.name}'")
    elif source == "ATTRIBUTE" and usable_attribute(obj.data) is None:
        raise SceneError(f"{where}: a modifier makes the temperatures of '{obj.name}', which no draw can add to")


def _set_temperature(obj, kept: Kept, values: Mapping[str, float]) -> None:
    kept.set_property(obj, NAME, values[""])


def _warm(scene, obj, kept: Kept, values: Mapping[str, float]) -> None:
    """Add K to an object's own temperature, and to those of its image and of its mesh, hair or points."""
    more = values[""]
    if obj.get("temperature_image") is not None:
        _warm_image(obj, kept, more)
    if obj.type in WITH_ATTRIBUTES and usable_attribute(obj.data) is not None:
        data = obj.data.copy()
        painted = usable_attribute(data).data
        painted.foreach_set("value", read_values(painted, "value", np.float32) + np.float32(more))
        kept.set_data(obj, data)
    own = read_temperature(obj, initial_value(obj, NAME, scene), f"Object '{obj.name}'")
    kept.set_property(obj, NAME, own + more)


def _warm_image(block, kept: Kept, more: float) -> None:
    """Add K to the temperatures that an image gives an object or a world: without a range it holds K itself."""
    low, high = temperature_range(block, f"'{block.name}'") or (0.0, 1.0)
    kept.set_property(block, "temperature_range", [low + more, high + more])


def _place(obj, kept: Kept, values: Mapping[str, float]) -> None:
    kept.set(obj, location=_with_parts(obj.location, values))


def _move(obj, kept: Kept, values: Mapping[str, float]) -> None:
    kept.set(obj, location=_with_parts(obj.location, values, added=True))


def _rotate(obj, kept: Kept, values: Mapping[str, float], added: bool = False) -> None:
    if obj.rotation_mode in ("QUATERNION", "AXIS_ANGLE"):
        kept.keep(obj, "rotation_mode", "rotation_euler", "rotation_quaternion", "rotation_axis_angle")
        kept.set(obj, rotation_mode="XYZ")
    degrees = {part: radians(value) for part, value in values.items()}
    kept.set(obj, rotation_euler=_with_parts(obj.rotation_euler, degrees, added))


def _with_parts(vector, values: Mapping[str, float], added: bool = False) -> tuple[float, ...]:
    """A vector with other x, y or z; added: those are added."""
    return tuple(values.get(axis, 0.0 if added else old) + added * old for axis, old in zip(AXES, vector, strict=True))


def _scale(obj, kept: Kept, values: Mapping[str, float]) -> None:
    kept.set(obj, scale=tuple(values[""] * each for each in obj.scale))


def _show(obj, probability: float, kept: Kept, values: Mapping[str, float]) -> None:
    """Hide an object with all its children from renders, but with a probability. What is hidden anyway stays hidden."""
    if values[""] >= probability and probability < 1.0:  # a draw is below 1, but not the end of its range
        for each in (obj, *obj.children_recursive):
            kept.set(each, hide_render=True)


_POSES = {"location": _place, "move": _move, "rotation": _rotate, "turn": partial(_rotate, added=True)}


# Materials, the world and the camera ----------------------------------------------------------------------------------


def _of_materials(rule: Rule, scene, layer) -> Iterator[Change]:
    materials = [each for each in bpy.data.materials if _fits(each, rule.selectors["name"])]
    if not materials:
        raise SceneError(f"{rule.where}: no material has {_told(rule.selectors)}")
    for material in materials:
        makers = {key: partial(_set_number, material, key) for key in rule.ranges}
        yield from _changes(rule, material.name_full, (material,), makers)


def _set_number(block, key: str, kept: Kept, values: Mapping[str, float]) -> None:
    kept.set_property(block, key, values[""])


def _of_world(rule: Rule, scene, layer) -> Iterator[Change]:
    world = layer_world(scene, layer)
    if world is None:
        raise SceneError("world: the scene has none")
    if "clear_sky" in rule.ranges:
        for end in (0, 1):
            _weather({part: ends[end] for part, ends in rule.ranges["clear_sky"].items()})
    makers = {"temperature": _set_world, "warmer": _warm_world, "clear_sky": _set_sky}
    yield from _changes(rule, world.name_full, (world,), {key: partial(make, world) for key, make in makers.items()})


def _set_world(world, kept: Kept, values: Mapping[str, float]) -> None:
    for key in SKY_KEYS:
        kept.set_property(world, key, None)
    kept.set_property(world, NAME, values[""])


def _warm_world(world, kept: Kept, values: Mapping[str, float]) -> None:
    """Add K to the temperature of a world, or to all of its sky."""
    more = values[""]
    image, table, own = (world.get(key) for key in (*SKY_KEYS, NAME))
    if image is not None:
        _warm_image(world, kept, more)
    elif table is not None:
        columns = table.to_dict()
        kept.set_property(world, SKY_KEYS[1], columns | {"kelvin": [each + more for each in columns["kelvin"]]})
    elif own is None or is_number(own):
        kept.set_property(world, NAME, (own or 0.0) + more)
    else:  # zenith angles and kelvin in turn
        kept.set_property(world, NAME, [each + more * (i % 2) for i, each in enumerate(own.to_list())])


def _weather(values: Mapping[str, float]) -> tuple[float, float, float]:
    """Air temperature and dew point, K, and cloud cover. Raises SceneError if they make no sense."""
    air, cover = values["air"], values.get("cover", 0.0)
    try:
        dew = dew_point(air, values["humidity"] / 100.0)
        check_weather(air, dew, cover, 1000.0)
    except SceneError as error:
        raise SceneError(f"world.clear_sky: {error}") from None
    return air, dew, cover


def _set_sky(world, kept: Kept, values: Mapping[str, float]) -> None:
    """The sky of a weather, as Clear Sky from Weather makes it."""
    kept.set_property(world, SKY_KEYS[0], None)
    kept.set_property(world, SKY_KEYS[1], sky_table(*clear_sky(*_weather(values))))


def _of_camera(rule: Rule, scene, layer) -> Iterator[Change]:
    if scene.camera is None:
        raise SceneError("camera: the scene has none")
    cameras = used_cameras(scene)
    for camera in cameras if "focal_length" in rule.ranges else ():
        if camera.type != "CAMERA" or camera.data.type != "PERSP":
            raise SceneError(f"camera.focal_length: '{camera.name}' is no perspective camera")

    def of_now(change: Callable, kept: Kept, values: Mapping[str, float]) -> None:  # a marker may change the camera
        change(scene.camera, kept, values)

    makers = {key: partial(of_now, change) for key, change in {**_POSES, "focal_length": _zoom}.items()}
    yield from _changes(rule, "camera", cameras, makers)


def _zoom(camera, kept: Kept, values: Mapping[str, float]) -> None:
    kept.set(camera.data, lens=values[""])


_BINDERS = {"objects": _of_objects, "materials": _of_materials, "world": _of_world, "camera": _of_camera}
