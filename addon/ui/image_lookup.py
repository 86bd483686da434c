# SPDX-License-Identifier: GPL-3.0-or-later
"""What dialogs and panels share that lay an image on a surface: which one, and how it is looked up."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty, StringProperty

from ..properties import set_custom_property
from ..reading.images import INTERPOLATIONS, read_lookup
from ..reading.warnings import Warnings
from ..solver.scene import EXTENSIONS

_INTERPOLATIONS = (
    ("Linear", "Linear", "Linear between the middles of pixels", 0),
    ("Closest", "Closest", "The value of the pixel, without any between", 1),
)
_EXTENSIONS = (
    ("REPEAT", "Repeat", "The image again", 0),
    ("EXTEND", "Extend", "The image's border", 1),
    ("CLIP", "Clip", "Nothing of the image", 2),
    ("MIRROR", "Mirror", "The image again, each the other way round than its neighbours", 3),
)


class ImageLookup:
    """Base of operators that set an image and how it is looked up. kind: "temperature" or "mix", how the properties of
    this begin."""

    kind = ""

    image: StringProperty(name="Image", description="Name of an image of this file")
    interpolation: EnumProperty(
        name="Interpolation", description="What is between the middles of the image's pixels", items=_INTERPOLATIONS
    )
    extension: EnumProperty(
        name="Extension", description="What is outside the image, where UV coordinates leave 0 to 1", items=_EXTENSIONS
    )

    def load_lookup(self, block, image) -> None:
        """Begin with what an object or material has. image: its own, or None."""
        self.image = image.name if image is not None else ""
        self.extension, closest = read_lookup(block, self.kind, Warnings())
        self.interpolation = INTERPOLATIONS[closest]

    def draw_lookup(self, column) -> None:
        column.prop_search(self, "image", bpy.data, "images")
        column.prop(self, "interpolation")
        column.prop(self, "extension")

    def find_image(self):
        """The image; None, and an error, if the file has none of this name."""
        found = bpy.data.images.get(self.image)
        if found is None:
            self.report({"ERROR"}, f"There is no image '{self.image}' in this file")
        return found

    def store_lookup(self, block) -> None:
        """Set on an object or material what is not the default anyway."""
        store_choice(block, f"{self.kind}_interpolation", self.interpolation, INTERPOLATIONS)
        store_choice(block, f"{self.kind}_extension", self.extension, EXTENSIONS)

    def tell(self, warnings: Warnings) -> None:
        for message in warnings.messages():
            self.report({"WARNING"}, message)


def store_choice(block, key: str, value: str, choices: tuple[str, ...]) -> None:
    """Set a custom property to one of some choices; of the first, which counts anyway, there is none."""
    if value == choices[0]:
        block.pop(key, None)
    else:
        set_custom_property(block, key, value)


def lookup_text(block, kind: str, image) -> str:
    """The name of an image of an object or material, and how it is looked up if that is not as usual."""
    extension, closest = read_lookup(block, kind, Warnings())
    names = {key: name for key, name, *_ in _EXTENSIONS}
    unusual = ["Closest"] * closest + [names[extension]] * (extension != EXTENSIONS[0])
    return f"{image.name} ({', '.join(unusual)})" if unusual else image.name
