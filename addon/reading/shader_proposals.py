# SPDX-License-Identifier: GPL-3.0-or-later
"""Thermal values that fit a scene made for visible light: of materials by their shaders and names, and temperatures
where there are none.

They are a start, as a shader knows nothing of heat. Nothing here changes a data block, and what is set is not proposed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import bpy

from ..properties import initial_value
from ..solver.physics import library
from ..solver.scene import EXTENSIONS
from .material_words import ANY, METALLIC, NO_METAL, SEE_THROUGH, Meaning, is_coating, meanings, named_metal
from .media import is_medium
from .objects import SURFACE_TYPES, may_have_faces
from .shaders import (
    ALPHA,
    CLEAR,
    DULL,
    HOLE,
    LAMP,
    METAL,
    TRANSMISSION,
    VOLUME,
    Cutout,
    Shader,
    read_cutout,
    read_shader,
    unseen_message,
)
from .surface_temperature import temperature_source
from .textures import with_mixed
from .world import layer_world, unset_surroundings

DIELECTRIC = (
    0.93  # emissivity of paint, plastic, wood, cloth, plaster: they have 0.90 to 0.96 in the long-wave infrared
)
GLOSSY = 0.4  # roughness from which what is mirrored is too wide to tell from what is scattered
SMOOTH = 0.2  # roughness up to which an opaque shader may stand for glass or water
COMMON_METAL = "Steel, cold rolled"  # of a metal whose name does not say which
COMMON_GLASS = "Glass, window"
USUAL_ROUGHNESS = 0.5  # a new shader's, where a texture has it
BARE = 0.5  # emissivity up to which a metal is bare, and not covered by its oxide or something else
NOTHING = "Nothing"  # name of the material that is nowhere
FORGOTTEN = "Blender forgets new properties of a library override when the file is opened again: make it local"


@dataclass(frozen=True)
class Proposal:
    """What to set on a data block, and why.

    block: a material, object or world. values: custom property -> value, which may be an image, or NOTHING in place of
    a material that is nowhere; none if nothing can be proposed, and then `reason` says why.
    """

    block: object
    values: dict[str, object] = field(default_factory=dict)
    reason: str = ""

    @property
    def key(self) -> str:
        """What tells the block from all others of the file."""
        return f"{self.block.bl_rna.identifier} {self.block.name_full}"


def _proposal(block, values: dict[str, float | str], reason: str) -> Proposal:
    """Of what can be changed; of a block that cannot, one without values that says so."""
    if not block.is_editable:
        return Proposal(block, {}, "Linked from another file: set its values there, or make it local")
    if block.override_library is not None:
        reason += f". {FORGOTTEN}"
    return Proposal(block, values, reason)


# Materials ------------------------------------------------------------------------------------------------------------


def propose_material(material) -> Proposal | None:
    """What a material lacks, from its shader and its name; None if it lacks nothing or fills a gas."""
    if is_medium(material) or getattr(material, "grease_pencil", None):
        return None
    shader = read_shader(material)
    values, reason = _surface(material, shader)
    values = {key: value for key, value in values.items() if material.get(key) is None}
    cutout = read_cutout(material) if shader.opaque and material.get("mix") is None else None
    if cutout is not None:
        values |= _holes(cutout)
        reason += f". Image '{cutout.image.name}' cuts holes into it"
    if not values:
        return None
    if VOLUME in shader.unseen and not shader.connected:
        return Proposal(material, {}, "A volume without a surface: hide its object, or make the material a gas")
    told = unseen_message(replace(shader, opaque=shader.opaque and not {"transmittance", "mix"} & set(values)))
    return _proposal(material, values, f"{reason}. {told.capitalize()}" if told else reason)


def _holes(cutout: Cutout) -> dict[str, object]:
    """The custom properties of a material into which an image cuts holes."""
    values = {"mix": cutout.image, "mix_material": NOTHING, "mix_channel": cutout.channel}
    if cutout.extension != EXTENSIONS[0]:
        values["mix_extension"] = cutout.extension
    return values | ({"mix_interpolation": "Closest"} if cutout.is_closest else {})


def nothing_material() -> object:
    """The material of this file that is nowhere, by the name of NOTHING: one that has its values, or a new one."""
    named = (material for material in bpy.data.materials if material.name.partition(".")[0] == NOTHING)
    for material in named:
        if (material.get("emissivity"), material.get("transmittance")) == (0.0, 1.0) and material.library is None:
            return material
    material = bpy.data.materials.new(NOTHING)
    material["emissivity"], material["transmittance"], material["specular"] = 0.0, 1.0, 0.0
    return material


def _surface(material, shader: Shader) -> tuple[dict[str, float | str], str]:
    """The emissivity, specular share and roughness that fit a shader, and the reason. What is set is among them."""
    known = _set_entry(material)
    if known:
        return _values(known.name, shader, _is_bare(known)), f"For its emissivity, which is set to '{known.name}'"
    name, metal = material.name, shader.share(METAL) > 0.5
    chosen = next((each for each in meanings(name) if _agrees(each, shader, name)), None)
    if chosen:
        metal = _is_bare(library.get(chosen.entry))
        return _values(chosen.entry, shader, metal), f"Its name says '{chosen.entry}'{_agreement(chosen)}"
    if _is_nothing(shader) and material.get("emissivity") is None:
        return {"emissivity": 0.0, "transmittance": 1.0}, "All of it is a hole: all passes straight through"
    if is_coating(name) or shader.coat is not None:
        hidden = " and hides the metal" if metal else ""
        return _values(DIELECTRIC, shader, False), f"Paint or a coat emits{hidden}"
    if shader.share(CLEAR) >= 0.5:
        return _values(COMMON_GLASS, shader, False), "Clear: taken for glass, which is opaque beyond 5 µm"
    if metal:
        return _values(COMMON_METAL, shader, True), f"Its shader is a metal: taken for '{COMMON_METAL}'"
    return _values(DIELECTRIC, shader, False), _dull_reason(shader, name)


def _set_entry(material):
    """The library's material whose name is the emissivity of a material; None if it is none."""
    value = material.get("emissivity")
    if not isinstance(value, str):
        return None
    try:
        return library.get(value)
    except KeyError:
        return None


def _is_bare(known: library.LibraryMaterial) -> bool:
    """Whether a material of the library is a bare metal, which mirrors nearly all."""
    return known.category.startswith("metal") and known.points[:, 1].mean() < BARE


def _agrees(meaning: Meaning, shader: Shader, name: str) -> bool:
    """Whether a surface looks like what its name means. Paint is no metal, whatever its name and its shine."""
    if meaning.surface == ANY:
        return True
    coated = is_coating(name) or shader.coat is not None
    metallic = shader.share(METAL) > 0.5
    if meaning.surface == METALLIC:
        return (metallic or shader.metallic_varies) and not coated
    if metallic or is_coating(name):
        return False
    smooth = shader.roughness is not None and shader.roughness <= SMOOTH
    return meaning.surface == NO_METAL or smooth or bool({ALPHA, TRANSMISSION} & set(shader.unseen))


def _agreement(meaning: Meaning) -> str:
    if meaning.why:
        return f": {meaning.why}"
    return {
        METALLIC: "; its shader is a metal",
        SEE_THROUGH: "; its shader is clear or smooth",
        NO_METAL: "; its shader is no metal",
    }.get(meaning.surface, "")


def _is_nothing(shader: Shader) -> bool:
    """Whether all of a surface is a hole."""
    return shader.shares.get(HOLE, 0.0) > 0.0 and shader.share(DULL, METAL, CLEAR, LAMP) == 0.0


def _dull_reason(shader: Shader, name: str) -> str:
    if not shader.connected:
        return "No shader: taken for a dull surface"
    if shader.share(LAMP) > 0.5:
        return "It only shines: taken for a dull surface. If it is hot, set its object's temperature"
    if _is_nothing(shader):
        return "All of it is a hole, which is opaque here: hide its object if it should not be seen"
    if shader.metallic_varies:
        return "Where it is metallic a texture says: taken for no metal"
    if named_metal(name):
        return "Named after a metal, but its shader is none: as paint"
    return "Neither metal nor clear: as paint, plastic, wood, cloth"


def _values(emissivity: float | str, shader: Shader, metal: bool) -> dict[str, float | str]:
    """The custom properties of a surface. Metals mirror all that they reflect, blurred by their roughness; others do
    where they are smooth, as their reflection comes from the surface alone, and scatter it where they are rough."""
    rough = shader.roughness if shader.coat is None or metal else shader.coat
    if metal:
        return {"emissivity": emissivity, "specular": 1.0, "roughness": _rounded(rough)}
    if rough is None or rough >= GLOSSY:
        return {"emissivity": emissivity, "specular": 0.0}
    return {"emissivity": emissivity, "specular": 1.0, "roughness": _rounded(rough)}


def _rounded(roughness: float | None) -> float:
    """To what a slider shows: shaders hold float32."""
    return USUAL_ROUGHNESS if roughness is None else round(min(max(roughness, 0.0), 1.0), 4)


# Temperatures ---------------------------------------------------------------------------------------------------------


def propose_object(obj, scene, depsgraph) -> Proposal | None:
    """The ambient temperature, which can then be changed, for an object that has none; None for others."""
    if obj.type not in SURFACE_TYPES or not may_have_faces(obj) or obj.get("temperature") is not None:
        return None
    if temperature_source(obj, depsgraph) in ("IMAGE", "ATTRIBUTE"):
        return None
    return _proposal(
        obj, {"temperature": initial_value(obj, "temperature", scene)}, "It has no temperature: the ambient one"
    )


def propose_world(world, scene) -> Proposal | None:
    """The temperature of a clear sky above air of the ambient temperature, for a world without one; else None."""
    if world is None or not unset_surroundings(world):
        return None
    reason = "A clear sky above air of the ambient temperature (Swinbank 1963); an overcast one is as warm as the air"
    return _proposal(world, {"temperature": clear_sky(scene.infrared.ambient_temperature)}, reason)


def clear_sky(air: float) -> float:
    """Temperature (K) of a blackbody that radiates as a clear sky above air of a temperature (K), and never above it.

    W. C. Swinbank, Long-wave radiation from clear skies, Q. J. R. Meteorol. Soc. 89, 339-348 (1963).
    """
    return min(0.0552 * max(air, 0.0) ** 1.5, air)


# Scenes ---------------------------------------------------------------------------------------------------------------


def materials_of(objects: Iterable, depsgraph) -> list:
    """The materials of objects: of their slots, those that their geometry nodes give, and those that are mixed with
    them, each once and in order."""
    found = {}
    for obj in objects:
        if obj.type in SURFACE_TYPES:
            found |= {slot.material: None for slot in obj.material_slots}
            mesh = obj.evaluated_get(depsgraph).data
            found |= {material and material.original: None for material in getattr(mesh, "materials", ())}
    return with_mixed(found)


def proposals(objects: Iterable, layers: Iterable, scene, depsgraph) -> list[Proposal]:
    """What objects and their materials lack, and the material and the world of view layers. Objects, which may be many,
    come last."""
    objects, layers = list(objects), list(layers)
    materials = dict.fromkeys(layer.material_override for layer in layers if layer.material_override)
    materials |= dict.fromkeys(materials_of(objects, depsgraph))
    found = [propose_material(material) for material in materials]
    found += [propose_world(world, scene) for world in dict.fromkeys(layer_world(scene, layer) for layer in layers)]
    found += [propose_object(obj, scene, depsgraph) for obj in objects]
    return [proposal for proposal in found if proposal is not None]
