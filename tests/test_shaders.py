# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a shader the engine does not see: as Blender follows nodes, told by the Checks panel and the render."""

import pytest

bpy = pytest.importorskip("bpy")

from addon.reading.shader_graph import constant  # noqa: E402
from addon.reading.shaders import CLEAR, DULL, HOLE, LAMP, METAL, read_shader, unseen_message  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, read  # noqa: E402
from tests.helpers.shaders import covering, grouped, join, mixed, node, output, principled, shaded, textured  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")


def shares(material):
    return {kind: part for kind, part in read_shader(material).shares.items() if part > 0.0}


def unseen(material):
    return list(read_shader(material).unseen)


# What is not seen -----------------------------------------------------------------------------------------------------


def test_a_new_material_has_nothing_that_is_not_seen():
    assert unseen(shaded()) == [] and unseen_message(read_shader(shaded())) == ""


@pytest.mark.parametrize(
    ("inputs", "parts"),
    [
        ({"Transmission_Weight": 0.5}, ["transmission"]),
        ({"Alpha": 0.5}, ["alpha"]),
        ({"Emission_Strength": 1.0}, ["emission"]),
        ({"Emission_Strength": 1.0, "Emission_Color": (0.0, 0.0, 0.0, 1.0)}, []),
        ({"Metallic": 1.0, "Coat_Weight": 1.0, "Roughness": 0.1}, []),
    ],
)
def test_parts_of_a_principled_shader(inputs, parts):
    assert unseen(shaded(**inputs)) == parts


@pytest.mark.parametrize(
    ("name", "kind", "parts"),
    [
        ("Base Color", "TexImage", ["image textures"]),
        ("Base Color", "TexEnvironment", ["image textures"]),
        ("Roughness", "TexNoise", ["procedural textures"]),
        ("Base Color", "TexCoord", []),
        ("Alpha", "TexImage", ["image textures", "alpha"]),
        ("Transmission Weight", "TexImage", ["image textures", "transmission"]),
    ],
)
def test_textures(name, kind, parts):
    material = shaded()
    textured(material, name, kind)
    assert unseen(material) == parts


@pytest.mark.parametrize(("kind", "source"), [("NormalMap", "Color"), ("Bump", "Height")])
def test_normal_maps_count_where_something_bends_them(kind, source):
    material = shaded()
    bend = node(material, kind)
    join(bend, principled(material).inputs["Normal"])
    assert unseen(material) == []
    join(node(material, "TexNoise"), bend.inputs[source])
    assert unseen(material) == ["procedural textures", "normal maps"]
    bend.inputs["Strength"].default_value = 0.0
    assert "normal maps" not in unseen(material)


@pytest.mark.parametrize(
    ("method", "part"), [("BUMP", "normal maps"), ("DISPLACEMENT", "displacement"), ("BOTH", "displacement")]
)
def test_displacement(method, part):
    material = shaded()
    material.displacement_method = method
    join(node(material, "Displacement"), output(material).inputs["Displacement"])
    assert unseen(material) == [part]


def test_volumes():
    material = shaded()
    join(node(material, "VolumeScatter"), output(material).inputs["Volume"])
    assert unseen(material) == ["volume"] and read_shader(material).connected
    material.node_tree.nodes.remove(principled(material))
    assert unseen(material) == ["volume"] and not read_shader(material).connected


@pytest.mark.parametrize(
    ("kind", "share", "parts"),
    [
        ("BsdfGlass", CLEAR, ["transmission"]),
        ("BsdfRefraction", CLEAR, ["transmission"]),
        ("BsdfTransparent", HOLE, ["alpha"]),
        ("BsdfTranslucent", DULL, ["transmission"]),
        ("BsdfDiffuse", DULL, []),
        ("SubsurfaceScattering", DULL, []),
        ("BsdfAnisotropic", METAL, []),
        ("Emission", LAMP, ["emission"]),
        ("TexImage", LAMP, ["image textures", "emission"]),  # Blender lets a colour shine
        ("RGB", LAMP, ["emission"]),
    ],
)
def test_other_shaders(kind, share, parts):
    material = shaded()
    join(node(material, kind), output(material).inputs["Surface"])
    assert (shares(material), unseen(material)) == ({share: 1.0}, parts)


# As Blender follows nodes ---------------------------------------------------------------------------------------------


def muted_texture(material, wanted):
    texture = node(material, "TexNoise")
    texture.mute = True
    join(texture, wanted)


def value(material, wanted, muted=False):
    source = node(material, "Value")
    source.outputs[0].default_value, source.mute = 0.9, muted
    join(source, wanted)


def muted_sum(material, wanted, source=None):
    math = node(material, "Math")
    math.inputs[0].default_value, math.mute = 0.8, True
    join(math, wanted)
    if source:
        join(node(material, source), math.inputs[0])


def reroute(material, wanted):
    join(node(material, "NodeReroute"), wanted)


def group(material, wanted, ends=True):
    tree = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    tree.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
    for each in (0.2, 0.7) if ends else ():
        end = tree.nodes.new("NodeGroupOutput")
        end.inputs[0].default_value, end.is_active_output = each, True
    user = node(material, "Group")
    user.node_tree = tree
    join(user, wanted)


@pytest.mark.parametrize(
    "feed",
    [
        lambda *_: None,
        muted_texture,
        value,
        lambda *each: value(*each, muted=True),
        muted_sum,
        lambda *each: muted_sum(*each, source="Value"),
        lambda *each: muted_sum(*each, source="NodeReroute"),
        reroute,
        group,
        lambda *each: group(*each, ends=False),
    ],
)
def test_values_are_those_that_cycles_renders(feed, tmp_path):
    """An emission fills the picture with its strength, to the file's float32."""
    material = shaded()
    shines = node(material, "Emission", Strength=0.3)
    join(shines, output(material).inputs["Surface"])
    feed(material, shines.inputs["Strength"])
    camera(width=4, height=4)
    link("Cube", cube_mesh()).data.materials.append(material)
    bpy.data.objects["Cube"].scale = (9.0, 9.0, 1.0)
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 1, False
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(tmp_path / "picture.exr")
    bpy.ops.render.render(write_still=True)
    rendered = bpy.data.images.load(scene.render.filepath).pixels[0]
    assert constant(shines, "Strength", ()) == pytest.approx(rendered, rel=1e-6)


def test_what_is_not_connected_does_not_count():
    material = shaded()
    node(material, "TexImage")
    node(material, "Emission")
    assert unseen(material) == [] and shares(material) == {DULL: 1.0}


def test_muted_links_and_muted_textures_do_not_count():
    material = shaded(Metallic=0.25)
    texture = textured(material, "Metallic")
    assert read_shader(material).metallic_varies
    texture.mute = True
    assert unseen(material) == [] and shares(material) == {METAL: 0.25, DULL: 0.75}  # the input's own value
    texture.mute, material.node_tree.links[-1].is_muted = False, True
    assert unseen(material) == [] and shares(material) == {METAL: 0.25, DULL: 0.75}


def test_a_muted_shader_is_none():
    material = shaded(Emission_Strength=1.0)
    principled(material).mute = True
    assert not read_shader(material).connected and unseen(material) == []


def test_a_muted_mix_hands_on_what_blender_says():
    """The first of its shaders that is linked."""
    material = shaded(Metallic=1.0)
    mix = mixed(material, None, principled(material), factor=0.0)
    assert shares(material) == {}
    mix.mute = True
    assert shares(material) == {METAL: 1.0}


@pytest.mark.parametrize(
    ("factor", "expected"),
    [(0.0, {METAL: 1.0}), (1.0, {LAMP: 1.0}), (0.25, {METAL: 0.75, LAMP: 0.25}), (7.0, {LAMP: 1.0})],
)
def test_mixes_by_a_number(factor, expected):
    """What has no weight is not in the shader; Blender clamps the factor."""
    material = shaded(Metallic=1.0)
    mix = mixed(material, principled(material), node(material, "Emission"))
    value = node(material, "Value")
    value.outputs[0].default_value = factor
    join(value, mix.inputs[0])
    assert shares(material) == pytest.approx(expected)
    assert unseen(material) == ["emission"] * (LAMP in expected)


def test_mixes_by_what_varies():
    material = shaded()
    mix = mixed(material, principled(material), node(material, "BsdfAnisotropic"), factor=0.0)
    join(node(material, "TexImage"), mix.inputs[0])
    assert shares(material) == {DULL: 0.5, METAL: 0.5} and unseen(material) == ["image textures"]
    join(node(material, "Fresnel"), mix.inputs[0])
    assert shares(material) == pytest.approx({DULL: 0.9, METAL: 0.1}) and unseen(material) == []


def test_sums():
    material = shaded()
    add = node(material, "AddShader")
    join(principled(material), add.inputs[0])
    join(node(material, "Emission"), add.inputs[1])
    join(add, output(material).inputs["Surface"])
    assert shares(material) == {DULL: 1.0, LAMP: 1.0} and read_shader(material).share(DULL) == 0.5


def test_groups_within_groups():
    """Each user of a group gives it values of its own; a reroute and an inner group are followed."""
    inner = grouped("BsdfPrincipled", "Metallic", 0.0, Roughness=0.125)
    outer = grouped("BsdfDiffuse", "Roughness", 0.0)
    outer.nodes.remove(next(each for each in outer.nodes if each.bl_idname == "ShaderNodeBsdfDiffuse"))
    begin, end = (
        next(each for each in outer.nodes if each.bl_idname == f"NodeGroup{name}") for name in ("Input", "Output")
    )
    inside, reroute = outer.nodes.new("ShaderNodeGroup"), outer.nodes.new("NodeReroute")
    inside.node_tree = inner
    join(begin, inside.inputs["Metallic"])
    join(inside, reroute.inputs[0])
    join(reroute, end.inputs[0])
    materials = [shaded(), shaded()]
    for material, metallic in zip(materials, (1.0, 0.25), strict=True):
        user = material.node_tree.nodes.new("ShaderNodeGroup")
        user.node_tree = outer
        user.inputs[0].default_value = metallic
        join(user, output(material).inputs["Surface"])
    assert [shares(material) for material in materials] == [{METAL: 1.0}, {METAL: 0.25, DULL: 0.75}]
    assert read_shader(materials[0]).roughness == 0.125
    join(node(materials[0], "TexImage"), user_of(materials[0]).inputs[0])
    assert read_shader(materials[0]).metallic_varies and unseen(materials[0]) == ["image textures"]
    assert not read_shader(materials[1]).metallic_varies
    inner.nodes.clear()
    assert shares(materials[1]) == {} and not read_shader(materials[1]).connected
    user_of(materials[1]).node_tree = None  # of a file that is missing
    assert shares(materials[1]) == {}


def user_of(material):
    return next(each for each in material.node_tree.nodes if each.bl_idname == "ShaderNodeGroup")


def test_which_of_several_outputs_counts():
    """Cycles' before the one for all, that before EEVEE's; of two the active one."""
    material = shaded()
    others = {}
    for target, kind in (("EEVEE", "Emission"), ("ALL", "BsdfTransparent"), ("CYCLES", "BsdfGlass")):
        others[target] = node(material, "OutputMaterial")
        others[target].target = target
        join(node(material, kind), others[target].inputs["Surface"])
    output(material).target = "EEVEE"
    assert unseen(material) == ["transmission"]
    material.node_tree.nodes.remove(others["CYCLES"])
    assert unseen(material) == ["alpha"]
    material.node_tree.nodes.remove(others["ALL"])
    others["EEVEE"].is_active_output = True
    assert unseen(material) == ["emission"]
    output(material).is_active_output = True
    assert unseen(material) == []
    for each in [output(material), others["EEVEE"]]:
        material.node_tree.nodes.remove(each)
    assert not read_shader(material).connected and unseen(material) == []


@pytest.mark.skipif(bpy.app.version >= (5, 0), reason="materials have nodes")
def test_a_material_without_nodes_has_values_of_its_own():
    material = bpy.data.materials.new("Old")
    material.metallic, material.roughness = 1.0, 0.25
    assert shares(material) == {METAL: 1.0} and read_shader(material).roughness == 0.25


# Where it is told -----------------------------------------------------------------------------------------------------


@pytest.fixture
def cube():
    """A scene of which nothing is to be said but of its cube's material."""
    camera()
    cube = link("Cube", cube_mesh(), temperature=300.0)
    cube.data.materials.append(shaded("Leaf", {"emissivity": 0.9}))
    bpy.context.scene.world = bpy.data.worlds.new("Night")
    bpy.context.scene.world["temperature"] = 0.0
    return cube


def told():
    """The render's warnings, and what the Checks panel has: [(level, text)]."""
    bpy.context.view_layer.update()
    found = scene_checks(bpy.context.scene, bpy.context.view_layer)
    return read()[1], [(check.level, check.text) for check in found]


def test_nothing_is_told_of_a_plain_shader(cube):
    assert told() == ([], [])


def test_render_and_checks_tell_the_same(cube):
    leaf = cube.active_material
    textured(leaf, "Base Color")
    text = "of its shader the engine does not see image textures"
    assert told() == ([f"'Leaf': {text}"], [("HINT", f"Material 'Leaf': {text}")])
    textured(leaf, "Alpha")
    text += " and alpha; the surface is opaque"
    assert told() == ([f"'Leaf': {text}"], [("WARNING", f"Material 'Leaf': {text}")])


def test_emission_says_nothing_of_heat(cube):
    principled(cube.active_material).inputs["Emission Strength"].default_value = 100.0
    warnings, checks = told()
    assert warnings == ["'Leaf': of its shader the engine does not see emission; visible light says nothing of heat"]
    assert [level for level, _ in checks] == ["HINT"]


def test_the_render_names_materials_of_one_kind_together(cube):
    cube.data.materials.clear()
    for name in ("Oak", "Elm"):
        cube.data.materials.append(shaded(name, {"emissivity": 0.9}))
        textured(cube.data.materials[name], "Roughness")
    cube.data.polygons[0].material_index = 1
    warnings, checks = told()
    assert warnings == ["'Oak', 'Elm': of its shader the engine does not see image textures"]
    assert len(checks) == 2


def test_the_render_names_materials_of_geometry_nodes(cube):
    """They are in no slot, so the panel knows nothing of them."""
    glass = shaded("Glass", {"emissivity": 0.9}, Transmission_Weight=1.0)
    cube.modifiers.new("Cover", "NODES").node_group = covering(glass)
    assert told() == (["'Glass': of its shader the engine does not see transmission; the surface is opaque"], [])


def test_of_a_gas_the_shader_does_not_matter(cube):
    leaf = cube.active_material
    textured(leaf, "Alpha")
    leaf["absorption"] = 0.1
    link("Floor", cube_mesh("Floor"), temperature=300.0).data.materials.append(shaded("Plain", {"emissivity": 0.9}))
    assert told() == ([], [])
