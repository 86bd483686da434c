# SPDX-License-Identifier: GPL-3.0-or-later
"""What a material's shader is made of, and what of it the engine does not see.

A shader tells how a surface looks in visible light. The engine renders the material's custom properties and never its
shader; what can be learnt from one is here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from .shader_graph import Closure, closures, constant, feed, live_nodes, shader_output, uses_nodes

# What a share of a surface is, as far as heat is concerned
METAL, CLEAR, DULL, LAMP, HOLE = "metal", "clear", "dull", "lamp", "hole"

# What the engine does not see, in the order in which it is told
IMAGES, PROCEDURAL, NORMALS, DISPLACEMENT = "image textures", "procedural textures", "normal maps", "displacement"
ALPHA, TRANSMISSION, EMISSION, VOLUME = "alpha", "transmission", "emission", "volume"
PARTS = (IMAGES, PROCEDURAL, NORMALS, DISPLACEMENT, ALPHA, TRANSMISSION, EMISSION, VOLUME)
SHAPING = {DISPLACEMENT, ALPHA, VOLUME}  # without them the picture has other shapes

COATED = 0.5  # weight of a coat that hides what is below

# Simple shaders: what they are, and whether they have a Roughness that blurs a mirror
SIMPLE = {
    "ShaderNodeBsdfAnisotropic": (METAL, True),  # Glossy
    "ShaderNodeBsdfMetallic": (METAL, True),
    "ShaderNodeBsdfGlass": (CLEAR, True),
    "ShaderNodeBsdfRefraction": (CLEAR, True),
    "ShaderNodeBsdfTransparent": (HOLE, False),
    "ShaderNodeBsdfRayPortal": (HOLE, False),
    "ShaderNodeHoldout": (HOLE, False),
    "ShaderNodeEmission": (LAMP, False),
    "ShaderNodeBackground": (LAMP, False),
}
UNSEEN_KINDS = {HOLE: ALPHA, CLEAR: TRANSMISSION, LAMP: EMISSION}
TEXTURE = "ShaderNodeTex"  # how the names of textures begin
IMAGE_NODES = {"ShaderNodeTexImage", "ShaderNodeTexEnvironment"}
NO_TEXTURES = {"ShaderNodeTexCoord"}


class Cutout(NamedTuple):
    """An image that cuts holes into a surface. channel: one of CHANNELS, the share of holes. extension,
    is_closest: of the image's node, see scene.Texture."""

    image: object
    channel: str
    extension: str
    is_closest: bool


@dataclass
class Shader:
    """What a material's shader is made of.

    shares: kind -> its part of the surface, from 0 to 1. gloss: [(share, roughness)] of what mirrors; None is a
    roughness that varies. coat: roughness of a coat that hides what is below, None without one. metallic_varies: where
    it is a metal is not known. connected: whether any shader is. unseen: what the engine does not see, those of PARTS.
    opaque: whether the surface is for the engine, too: its material has neither transmittance nor mix.
    """

    shares: dict[str, float] = field(default_factory=dict)
    gloss: list[tuple[float, float | None]] = field(default_factory=list)
    coat: float | None = None
    metallic_varies: bool = False
    connected: bool = False
    unseen: tuple[str, ...] = ()
    opaque: bool = True

    def share(self, *kinds: str) -> float:
        """The part of these kinds in all but holes, 0 to 1."""
        whole = sum(part for kind, part in self.shares.items() if kind != HOLE)
        return sum(self.shares.get(kind, 0.0) for kind in kinds) / whole if whole > 0.0 else 0.0

    @property
    def roughness(self) -> float | None:
        """The mean roughness, 0 to 1, of what mirrors; None if nothing does, or if it varies."""
        known = [(share, rough) for share, rough in self.gloss if rough is not None and share > 0.0]
        whole = sum(share for share, _ in known)
        return sum(share * rough for share, rough in known) / whole if whole > 0.0 else None


def read_shader(material) -> Shader:
    """What the shader of a Blender material, evaluated or not, is made of."""
    output = shader_output(material)
    if output is None:
        return Shader() if uses_nodes(material) else _without_nodes(material)
    shader, unseen = Shader(opaque=all(material.get(key) is None for key in ("mix_material", "transmittance"))), set()
    surface, volume, displacement = (output.inputs[name] for name in ("Surface", "Volume", "Displacement"))
    for closure in closures(surface):
        shader.connected = True
        _add(shader, closure, unseen)
    for node, groups in live_nodes(surface):
        unseen |= (_texture(node) - _of_mix(node, material)) | _normals(node, groups)
    if any(True for _ in closures(volume)):
        unseen.add(VOLUME)
    if feed(displacement).node is not None:
        unseen.add(NORMALS if material.displacement_method == "BUMP" else DISPLACEMENT)
        for node, _ in live_nodes(displacement):
            unseen |= _texture(node)
    shader.unseen = tuple(part for part in PARTS if part in unseen)
    return shader


def read_cutout(material) -> Cutout | None:
    """The image that says where a Blender material is a hole: at the Alpha of its one Principled shader, or in a mix
    with a Transparent one; None if nothing or something else says it."""
    output = shader_output(material)
    node, _, groups = feed(output.inputs["Surface"]) if output is not None else (None, None, ())
    if node is None:
        return None
    if node.bl_idname == "ShaderNodeBsdfPrincipled":
        return _cutout(feed(node.inputs["Alpha"], groups), True)
    if node.bl_idname != "ShaderNodeMixShader":
        return None
    kinds = [SIMPLE.get(getattr(feed(node.inputs[i], groups).node, "bl_idname", ""), (None,))[0] for i in (1, 2)]
    if kinds.count(HOLE) != 1:
        return None
    return _cutout(feed(node.inputs[0], groups), kinds[0] == HOLE)


def _cutout(fed, is_solid: bool) -> Cutout | None:
    """The Cutout of what feeds a share of the solid surface, or of holes; None if no single image does."""
    node = fed.node
    if node is None or node.bl_idname != "ShaderNodeTexImage" or node.image is None:
        return None
    channel = "Alpha" if fed.socket.identifier == "Alpha" else "Color"
    extension = "EXTEND" if node.extension == "CLIP" else node.extension  # as holes go on beyond the picture of a leaf
    channel = f"Inverted {channel}" if is_solid else channel
    return Cutout(node.image, channel, extension, node.interpolation == "Closest")


def _without_nodes(material) -> Shader:
    """Before Blender 5 a material may have no nodes; then these values count."""
    metal = material.metallic
    return Shader({METAL: metal, DULL: 1.0 - metal}, [(1.0, material.roughness)], connected=True)


def _add(shader: Shader, closure: Closure, unseen: set[str]) -> None:
    """Count one of the shaders of a surface in."""
    kind = closure.node.bl_idname
    if kind == "ShaderNodeBsdfPrincipled":
        _add_principled(shader, closure, unseen)
        return
    if closure.output.type != "SHADER":  # Blender lets a colour shine
        share_of, mirrors = LAMP, False
    else:
        share_of, mirrors = SIMPLE.get(kind, (DULL, kind == "ShaderNodeEeveeSpecular"))
    if share_of == LAMP and not _shines(closure, "Color", "Strength"):
        share_of = DULL
    shader.shares[share_of] = shader.shares.get(share_of, 0.0) + closure.weight
    if mirrors:
        shader.gloss.append((closure.weight, constant(closure.node, "Roughness", closure.groups)))
    if kind == "ShaderNodeEeveeSpecular" and _any(closure, "Transparency"):
        unseen.add(ALPHA)
    if share_of in UNSEEN_KINDS:
        unseen.add(UNSEEN_KINDS[share_of])
    if kind == "ShaderNodeBsdfTranslucent":
        unseen.add(TRANSMISSION)


def _add_principled(shader: Shader, closure: Closure, unseen: set[str]) -> None:
    node, groups, weight = closure.node, closure.groups, closure.weight
    metallic, transmission, alpha, coat = (
        constant(node, name, groups) for name in ("Metallic", "Transmission Weight", "Alpha", "Coat Weight")
    )
    opaque = weight * (1.0 if alpha is None else min(max(alpha, 0.0), 1.0))
    metal = opaque * (metallic or 0.0)
    clear = (opaque - metal) * (transmission or 0.0)
    parts = {METAL: metal, CLEAR: clear, DULL: opaque - metal - clear, HOLE: weight - opaque}
    for kind, part in parts.items():
        shader.shares[kind] = shader.shares.get(kind, 0.0) + part
    shader.gloss.append((opaque, constant(node, "Roughness", groups)))
    shader.metallic_varies |= metallic is None
    if coat is not None and coat >= COATED:
        shader.coat = constant(node, "Coat Roughness", groups) or 0.0
    if alpha is None or alpha < 1.0:
        unseen.add(ALPHA)
    if transmission is None or transmission > 0.0:
        unseen.add(TRANSMISSION)
    if _shines(closure, "Emission Color", "Emission Strength"):
        unseen.add(EMISSION)


def _any(closure: Closure, name: str) -> bool:
    """Whether an input is, or may be, above 0."""
    value = constant(closure.node, name, closure.groups, missing=1.0)
    return value is None or value > 0.0


def _shines(closure: Closure, colour: str, strength: str) -> bool:
    return _any(closure, colour) and _any(closure, strength)


def _texture(node) -> set[str]:
    if node.bl_idname in IMAGE_NODES:
        return {IMAGES}
    textures = node.bl_idname.startswith(TEXTURE) and node.bl_idname not in NO_TEXTURES
    return {PROCEDURAL} if textures else set()


def _of_mix(node, material) -> set[str]:
    """IMAGES if this node has the image that says how the material is mixed, which the engine sees."""
    image = getattr(node, "image", None)
    return {IMAGES} if image is not None and image == material.get("mix") else set()


def _normals(node, groups) -> set[str]:
    """NORMALS if this node bends them."""
    source = {"ShaderNodeNormalMap": "Color", "ShaderNodeBump": "Height"}.get(node.bl_idname)
    if source is None or constant(node, "Strength", groups) == 0.0:
        return set()
    return {NORMALS} if feed(node.inputs[source], groups).node is not None else set()


def unseen_message(shader: Shader) -> str:
    """What of a shader the engine does not see, and what is there instead; an empty text if it sees all."""
    unseen = _untold(shader)
    if not unseen:
        return ""
    *first, last = unseen
    listed = f"{', '.join(first)} and {last}" if first else last
    text = f"of its shader the engine does not see {listed}"
    if shader.opaque and {ALPHA, TRANSMISSION, VOLUME} & set(unseen):
        text += "; the surface is opaque"
    if EMISSION in unseen:
        text += "; visible light says nothing of heat"
    return text


def changes_shapes(shader: Shader) -> bool:
    """Whether what the engine does not see leaves other shapes in the picture than the shader shows."""
    return bool(SHAPING & set(_untold(shader)))


def _untold(shader: Shader) -> list[str]:
    """What of a shader the engine does not see, less what a transmittance or a mix tells it in another way."""
    return [part for part in shader.unseen if shader.opaque or part not in (ALPHA, TRANSMISSION)]
