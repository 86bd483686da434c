# SPDX-License-Identifier: GPL-3.0-or-later
"""What varies over surfaces: temperatures by an image of the object, and materials that are mixed with another.

Both come from custom properties: `temperature_image` of objects, `mix` and `mix_material` of materials. How images are
looked up, `temperature_interpolation`, `temperature_extension`, `mix_interpolation` and `mix_extension` say, and
`mix_channel` which channel counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..solver.scene import Texture, Textures
from .custom_properties import describe, is_number
from .images import (
    CHANNELS,
    UNALTERED,
    check_image,
    image_shares,
    image_stamp,
    is_image,
    kelvin_pixels,
    read_choice,
    read_lookup,
    temperature_range,
)
from .media import is_medium
from .meshes import UV_MAP, MeshData
from .temperature_fields import TemperatureError
from .warnings import Warnings

OWN_TEMPERATURE = "the object's own temperature counts"
NONE_OF_IT = "a share of 0 counts"
_ROWS = "triangle", "uv", "temperature_image", "mixed", "share", "share_image"  # arrays of Textures
Layers = Mapping[str, np.ndarray | str | None]  # those of a mesh, see MeshData, or what is wrong with some alone
_ROUNDING = 1e-6  # of shares that were computed in float32


@dataclass(frozen=True)
class Mix:
    """How much of another Blender material there is in place of one: share, 0..1, or what the float mesh attribute of
    this name says, or the image of this number."""

    material: object
    share: float = 0.0
    attribute: str | None = None
    image: int = -1


class TextureReader:
    """Reads the images and mixes of objects and materials, each once, and warns of what is wrong with them."""

    def __init__(self, warnings: Warnings, kept: dict[tuple, tuple] | None = None):
        """kept: images that an earlier reader kept, to be used again where they did not change; None reads all."""
        self.warnings = warnings
        self.kept = {}  # image, how it is read and looked up -> its stamp, and its Texture
        self._earlier = kept or {}
        self.images: list[Texture] = []
        self._numbers = {}  # image, how it is read and looked up -> index into images, or why it cannot be read
        self._mixes = {}  # address of a Blender material -> Mix or None

    def layers(self, obj, materials: Iterable) -> set[str]:
        """What an object with these Blender materials, or None, needs to know of its mesh, see meshes.read_layer."""
        mixes = [mix for mix in map(self.mix, materials) if mix is not None]
        names = {mix.attribute for mix in mixes if mix.attribute is not None}
        if self.temperature_image(obj) >= 0 or any(mix.image >= 0 for mix in mixes):
            names.add(UV_MAP)
        return names

    # Temperatures -----------------------------------------------------------------------------------------------------

    def temperature_image(self, obj) -> int:
        """Index into images of that of an object's temperatures, -1 if there is none, or none that can be read. Raises
        SceneError, naming object and image, if it holds something else."""
        image, owner = obj.get("temperature_image"), f"Object '{obj.name}'"
        if image is None:
            return -1
        check_image(image, owner)
        span = temperature_range(obj, owner)
        return self._number(obj, "temperature", span, lambda: kelvin_pixels(image, obj, owner), OWN_TEMPERATURE)

    def usable_temperature_image(self, obj, layers: Layers) -> int:
        """As temperature_image; -1, and a warning, also if the object's mesh has no coordinates for it."""
        image = self.temperature_image(obj)
        if image < 0 or not isinstance(layers[UV_MAP], str):
            return image
        self.warnings.add(obj.name, f"temperature_image: {layers[UV_MAP]}; {OWN_TEMPERATURE}")
        return -1

    def covers(self, obj, layers: Layers) -> bool:
        """Whether an image gives the temperature all over an object, so that its own counts nowhere."""
        image = self.usable_temperature_image(obj, layers)
        return image >= 0 and self.images[image].extension != "CLIP"

    # Mixed materials --------------------------------------------------------------------------------------------------

    def mix(self, material) -> Mix | None:
        """How a Blender material is mixed; None if it is not, or is None."""
        if material is None:
            return None
        key = material.as_pointer()
        if key not in self._mixes:
            self._mixes[key] = self._read_mix(material)
        return self._mixes[key]

    def usable_mix(self, obj, layers: Layers, material) -> Mix | None:
        """As mix; None, and a warning, also if the mesh of an object with the material lacks what the mix needs."""
        mix = self.mix(material)
        problem = None if mix is None else layers.get(UV_MAP if mix.image >= 0 else mix.attribute)
        if not isinstance(problem, str):
            return mix
        self.warnings.add(obj.name, f"mix of its material '{material.name}': {problem}; {NONE_OF_IT}")
        return None

    def _read_mix(self, material) -> Mix | None:
        value, other = material.get("mix"), material.get("mix_material")
        if value is None and other is None:
            return None
        if problem := _no_mix(material, value, other):
            self.warnings.add(material.name, problem)
            return None
        if other.get("mix") is not None:
            self.warnings.add(material.name, f"mix_material '{other.name}' is mixed itself; its own mix is left out")
        if isinstance(value, str):
            return Mix(other, attribute=value)
        if is_image(value):
            image = self._share_image(material, value)
            return Mix(other, image=image) if image >= 0 else None
        share = float(self._shares(material.name, "mix", np.array([value], np.float32))[0])
        return Mix(other, share) if share > 0.0 else None

    def _share_image(self, material, image) -> int:
        """Index into images of that of a material's shares, -1 if it cannot be read."""
        channel = read_choice(material, "mix_channel", CHANNELS, self.warnings)

        def shares() -> np.ndarray:
            return self._shares(material.name, f"Image '{image.name}'", image_shares(image, channel))

        return self._number(material, "mix", channel, shares, NONE_OF_IT)

    def _shares(self, name: str, source: str, values: np.ndarray) -> np.ndarray:
        """Values, float32 of any shape, as shares from 0 to 1; a warning to those of this name if they were others."""
        unknown = np.isnan(values)
        if unknown.any():
            self.warnings.add(name, f"{source} holds values that are no numbers; {NONE_OF_IT} there")
            values = np.where(unknown, np.float32(0.0), values)
        low, high = float(values.min()), float(values.max())
        if low < -_ROUNDING or high > 1.0 + _ROUNDING:
            run = f"is {low:g}" if values.size == 1 else f"runs from {low:g} to {high:g}"
            self.warnings.add(name, f"{source} {run}; shares are from 0 to 1, and what is beyond counts as the nearest")
        return values.clip(0.0, 1.0)

    # Images -----------------------------------------------------------------------------------------------------------

    def _number(self, block, kind: str, key, read: Callable[[], np.ndarray], fallback: str) -> int:
        """Index into images of the one of an object or material, its property f"{kind}_image" or just kind; -1, and a
        warning with the fallback, if it cannot be read.

        key: what tells apart how the same image is read. read: gives its values (height, width), float32.
        """
        image = block["mix" if kind == "mix" else f"{kind}_image"]
        lookup = read_lookup(block, kind, self.warnings)
        key = image.session_uid, key, *lookup
        if key not in self._numbers:
            try:
                texture = self._texture(image, key, lambda: Texture(read(), *lookup))
            except TemperatureError as error:
                self._numbers[key] = str(error)
            else:
                self._numbers[key] = len(self.images)
                self.images.append(texture)
        number = self._numbers[key]
        if isinstance(number, str):
            self.warnings.add(block.name, f"{number}; {fallback}")
            return -1
        space = image.colorspace_settings.name
        if space not in UNALTERED and not str(key[1]).endswith("Alpha"):  # no color space alters alpha
            told = f"Image '{image.name}': its color space {space} does not count"
            self.warnings.add(block.name, f"{told}; its values are taken as they are stored")
        return number

    def _texture(self, image, key: tuple, read: Callable[[], Texture]) -> Texture:
        """The texture of an image that is read and looked up as its key says: that of an earlier reader, or read()."""
        stamp = image_stamp(image)
        earlier, texture = self._earlier.get(key, (None, None))
        if stamp is None or stamp != earlier:
            texture = read()
        self.kept[key] = stamp, texture
        return texture

    # Rows -------------------------------------------------------------------------------------------------------------

    def rows(self, obj, mesh: MeshData, materials: list, index: Callable[[object], int]) -> Textures | None:
        """What varies over an object, without the images; None if nothing does.

        mesh: of m triangles, counted from 0, with the slots of materials, Blender's or None, and the layers that they
        need. index: gives the number of a Blender material in the scene.
        """
        count = len(mesh.slot)
        image = self.usable_temperature_image(obj, mesh.layers)
        temperature_image, mixed, share_image = (np.full(count, i, np.int32) for i in (image, -1, -1))
        share, uv = np.zeros((count, 3), np.float32), np.zeros((count, 3, 2), np.float32)
        for slot in np.unique(mesh.slot):
            mix = self.usable_mix(obj, mesh.layers, materials[slot])
            if mix is None:
                continue
            of_slot = mesh.slot == slot
            mixed[of_slot], share_image[of_slot] = index(mix.material), mix.image
            if mix.attribute is None:
                share[of_slot] = mix.share
            else:
                of_attribute = mesh.layers[mix.attribute][of_slot]
                share[of_slot] = self._shares(obj.name, f"the attribute '{mix.attribute}'", of_attribute)
        by_image = (temperature_image >= 0) | (share_image >= 0)
        if by_image.any():
            uv[by_image] = mesh.layers[UV_MAP][by_image]
        every = Textures(np.arange(count, dtype=np.int32), uv, temperature_image, mixed, share, share_image)
        used = by_image | (mixed >= 0)
        return replace(every, **{name: getattr(every, name)[used] for name in _ROWS}) if used.any() else None


def _no_mix(material, value, other) -> str:
    """Why a Blender material with this `mix` and `mix_material` cannot be mixed; an empty text if it can."""
    if other is None:
        return "mix changes nothing without a mix_material"
    if getattr(other, "id_type", "") != "MATERIAL":
        return f"mix_material is {describe(other)}, expected a material; it is left out"
    if value is None:
        return "mix_material changes nothing without mix"
    if is_medium(material):
        return "a gas is not mixed; mix is left out"
    if is_medium(other):
        return f"mix_material '{other.name}' is a gas; mix is left out"
    if other.name_full == material.name_full:
        return "mix_material is the material itself; mix is left out"
    if is_number(value) or isinstance(value, str) or is_image(value):
        return ""
    return f"mix is {describe(value)}, expected a number, the name of a mesh attribute or an image; it is left out"


def with_mixed(materials: Iterable) -> list:
    """Blender materials, and those that they are mixed with, each once and in order; None is left out."""
    found = dict.fromkeys(material for material in materials if material is not None)
    asked = [(material, material.get("mix"), material.get("mix_material")) for material in found]
    return list(found | {other: None for material, mix, other in asked if other and not _no_mix(material, mix, other)})


def mirrored(rows: Textures) -> Textures:
    """Rows whose triangles have their corners in the other order."""
    return replace(rows, uv=rows.uv[:, ::-1], share=rows.share[:, ::-1])


def joined(parts: list[Textures | None], counts: list[int], images: list[Texture]) -> Textures | None:
    """The textures of a scene from the rows of its objects, in order; None if nothing varies. counts: triangles of each
    object."""
    starts = np.cumsum([0, *counts[:-1]])
    moved = [
        replace(rows, triangle=rows.triangle + np.int32(start))
        for rows, start in zip(parts, starts, strict=True)
        if rows is not None
    ]
    if not moved:
        return None
    rows = {name: np.concatenate([getattr(rows, name) for rows in moved]) for name in _ROWS}
    return Textures(**rows, images=tuple(images))
