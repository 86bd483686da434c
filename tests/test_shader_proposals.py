# SPDX-License-Identifier: GPL-3.0-or-later
"""Thermal from Shaders...: what it proposes, that it sets what it shows and nothing else, and never what is set."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading.material_words import MEANINGS, is_coating, meanings, words_of  # noqa: E402
from addon.reading.shader_proposals import DIELECTRIC, FORGOTTEN, clear_sky, propose_material  # noqa: E402
from addon.solver.physics import library  # noqa: E402
from addon.ui.materials import thermal_from_shaders  # noqa: E402
from docs.tools.ordinary_scene import BALLS, build  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, custom_properties, link, read  # noqa: E402
from tests.helpers.shaders import covering, join, mixed, node, output, principled, shaded, textured  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")
operator = bpy.ops.infrared.thermal_from_shaders
METAL, GLASS = {"Metallic": 1.0, "Roughness": 0.25}, {"Transmission_Weight": 1.0, "Roughness": 0.0}
STEEL = {"emissivity": "Steel, cold rolled", "specular": 1.0, "roughness": 0.25}
DULL = {"emissivity": DIELECTRIC, "specular": 0.0}
NOTHING = {"emissivity": 0.0, "transmittance": 1.0}


@pytest.fixture
def own_file(tmp_path, monkeypatch):
    monkeypatch.setenv(library.USER_VARIABLE, str(tmp_path / "my materials.csv"))


def proposed(name="Paint", properties=None, **inputs):
    """The values that are proposed for a material; None if nothing is."""
    proposal = propose_material(shaded(name, properties, **inputs))
    return proposal and proposal.values


def entry(name, **inputs):
    return proposed(name, **inputs)["emissivity"]


# Names ----------------------------------------------------------------------------------------------------------------


def test_every_meaning_is_in_the_library():
    """And every row is found by its own first words; a metal's bare name needs a metallic shader."""
    for row in MEANINGS:
        assert library.get(row.entry).name == row.entry
        assert row in meanings(" ".join(sorted(each)[0] for each in row.words))
        bare = library.get(row.entry).category == "metal"
        assert bare == (row.surface == "metallic" and row.entry != "Steel, cold rolled"), row


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Brushed_Aluminum.003", {"brushed", "aluminum"}),
        ("brushedAluminum", {"brushed", "aluminum"}),
        ("MAT_PVCPipe2", {"mat", "pvc", "pipe"}),
        ("GOLD", {"gold"}),
        ("steelcase", {"steelcase"}),
        ("Österreich-Öl", {"österreich", "öl"}),
        ("123.456", set()),
    ],
)
def test_words_of_names(name, words):
    assert words_of(name) == words


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Copper", "Copper, polished"),
        ("copper_pipe.001", "Copper, polished"),
        ("BrushedAluminum", "Aluminium, polished"),
        ("Chrome", "Chromium, polished"),
        ("stainless steel", "Steel, cold rolled"),
        ("Bronze statue", "Brass, polished"),
        ("Anodized aluminium", "Aluminium, anodised grey"),
        ("aluminum anodised BLACK", "Aluminium, anodised black"),
        ("rusty metal", "Iron, weathered"),
        ("Weathered_Lead", "Lead, weathered"),
        ("Silver, polished", "Silver, polished"),
        # no steel, gold, ...: a metal by the shader alone
        ("steelcase", "Steel, cold rolled"),
        ("Ironwood", "Steel, cold rolled"),
        ("GoldFish", "Steel, cold rolled"),
        ("Copper color", "Steel, cold rolled"),
        ("leadership", "Steel, cold rolled"),
        ("Metal.001", "Steel, cold rolled"),
        # paint hides the metal
        ("Gold Paint", DIELECTRIC),
        ("painted steel", DIELECTRIC),
        # of mirrors the glass is what is seen
        ("Bathroom mirror", "Glass, window"),
        ("Mirror chrome", "Chromium, polished"),
    ],
)
def test_names_of_metals(name, expected):
    assert entry(name, **METAL) == expected


@pytest.mark.parametrize("name", ["Copper hair", "Silver", "lead pencil", "Iron Man", "Titanium White", "gold"])
def test_a_name_makes_no_metal(name):
    """Of a shader that is none."""
    assert proposed(name, Roughness=0.5) == DULL


@pytest.mark.parametrize(
    ("name", "inputs", "expected"),
    [
        ("Water", GLASS, "Water"),
        ("ocean_surface", {"Roughness": 0.1}, "Water"),
        ("water_bottle", GLASS, "Glass, window"),
        ("Wine Glass", GLASS, "Glass, window"),
        ("glass_table", {"Roughness": 0.1}, "Glass, window"),
        ("glass_table", {"Roughness": 0.6}, DIELECTRIC),  # whatever of it this is
        ("glassware", {"Roughness": 0.6}, DIELECTRIC),
        ("Fiber glass", {"Roughness": 0.1}, DIELECTRIC),
        ("Ice", {"Roughness": 0.5}, "Ice"),
        ("Ice cream", {"Roughness": 0.5}, DIELECTRIC),
        ("Skin.002", {}, "Skin, human"),
        ("orange_skin", {}, DIELECTRIC),
        ("Red Bricks", {}, "Brick, new"),
        ("old brick wall", {}, "Brick, weathered"),
        ("concrete_floor", {}, "Concrete, new"),
        ("plexiglass", {"Roughness": 0.0}, "Plastic, PMMA (acrylic)"),
        ("acrylic paint", {}, DIELECTRIC),
        ("Silicone", {}, "Silicone rubber (PDMS)"),
        ("Silicon", {}, "Silicon"),
        ("pet", {}, DIELECTRIC),
        ("PET bottle", {}, "Plastic, PET"),
        ("Snowboard", {}, DIELECTRIC),
        ("snow board", {}, DIELECTRIC),
        ("Snow", {}, "Snow, coarse-grained"),
        ("Flat black paint", {}, "Paint, ultra-flat black"),
        ("Dolomite", {}, "Dolomite"),
        ("rust", {}, "Iron, weathered"),
    ],
)
def test_names_of_others(name, inputs, expected):
    assert entry(name, **inputs) == expected


def test_a_metallic_shader_is_no_brick():
    assert entry("brick_red", **METAL) == "Steel, cold rolled"


def test_materials_of_the_artist_count_first(own_file):
    library.add_user_material("Oak", np.array([[8.0, 0.9], [14.0, 0.8]]), "me")
    library.add_user_material("Gold leaf", np.array([[8.0, 0.1], [14.0, 0.1]]), "me")
    assert entry("Oak floor") == "Oak" and entry("oaks", Roughness=0.1) == "Oak"
    assert entry("Soaked") == DIELECTRIC
    assert entry("gold_leaf.001", **METAL) == "Gold leaf" and entry("gold", **METAL) == "Gold, polished"


@pytest.mark.parametrize(
    ("name", "coating"),
    [("CarPaint", True), ("Lacquered wood", True), ("powder-coated steel", True), ("Painting", False)],
)
def test_coatings(name, coating):
    assert is_coating(name) == coating


# Shaders --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        (METAL, STEEL),
        ({}, DULL),
        ({"Roughness": 0.25}, {"emissivity": DIELECTRIC, "specular": 1.0, "roughness": 0.25}),
        ({"Metallic": 0.25, "Roughness": 0.75}, DULL),
        (GLASS, {"emissivity": "Glass, window", "specular": 1.0, "roughness": 0.0}),
        ({"Transmission_Weight": 0.25, "Roughness": 0.5}, DULL),
        ({"Alpha": 0.0}, NOTHING),
        ({"Alpha": 0.25, "Roughness": 0.5}, DULL),
        ({"Emission_Strength": 50.0}, DULL),
        # A coat is what is seen, with its own roughness
        (
            METAL | {"Coat_Weight": 1.0, "Coat_Roughness": 0.125},
            {"emissivity": DIELECTRIC, "specular": 1.0, "roughness": 0.125},
        ),
        (METAL | {"Coat_Weight": 0.25}, STEEL),
    ],
)
def test_values_of_principled_shaders(inputs, expected):
    assert proposed("Material", **inputs) == expected


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("BsdfDiffuse", DULL),
        ("BsdfAnisotropic", STEEL),
        ("BsdfGlass", {"emissivity": "Glass, window", "specular": 1.0, "roughness": 0.25}),
        ("BsdfTransparent", NOTHING),
        ("Emission", DULL),
    ],
)
def test_values_of_other_shaders(kind, expected):
    material = shaded("Material")
    shows = node(material, kind)
    if "Roughness" in shows.inputs:
        shows.inputs["Roughness"].default_value = 0.25
    join(shows, output(material).inputs["Surface"])
    assert propose_material(material).values == expected


def test_a_hole_is_proposed_whole_or_not_at_all():
    """With an emissivity that is set, all that passes would be more than there is."""
    material = shaded("Material", Alpha=0.0)
    assert propose_material(material).reason == "All of it is a hole: all passes straight through"  # and is not opaque
    material["emissivity"] = 0.93
    found = propose_material(material)
    assert found is None or "transmittance" not in found.values


def test_paint_of_old_shaders_is_no_metal():
    """Diffuse below, and a gloss over it by Fresnel's law, as before there was a Principled BSDF."""
    material = shaded("Material")
    mix = mixed(material, node(material, "BsdfDiffuse"), node(material, "BsdfAnisotropic", Roughness=0.125))
    join(node(material, "Fresnel"), mix.inputs[0])
    assert propose_material(material).values == {"emissivity": DIELECTRIC, "specular": 1.0, "roughness": 0.125}


def test_glass_whose_shadow_is_transparent_is_glass():
    material = shaded("Material")
    mix = mixed(material, node(material, "BsdfGlass"), node(material, "BsdfTransparent"))
    join(node(material, "LightPath"), mix.inputs[0])
    assert propose_material(material).values["emissivity"] == "Glass, window"


def test_what_textures_say_is_not_known():
    material = shaded("Material", Roughness=0.0)
    textured(material, "Roughness")
    assert propose_material(material).values == DULL
    principled(material).inputs["Metallic"].default_value = 1.0
    assert propose_material(material).values == STEEL | {"roughness": 0.5}
    textured(material, "Metallic")
    assert propose_material(material).values == DULL
    assert "a texture says" in propose_material(material).reason
    material.name = "Copper"
    assert propose_material(material).values["emissivity"] == "Copper, polished"


def test_every_proposal_can_be_rendered():
    """And emits what the library says, or 0.90 to 0.96."""
    for row in MEANINGS:
        assert 0.0 < library.get(row.entry).points[:, 1].mean() < 1.0
    assert 0.9 <= DIELECTRIC <= 0.96


def test_reasons_tell_what_is_not_seen():
    material = shaded("Leaf")
    textured(material, "Alpha")
    reason = propose_material(material).reason
    assert reason.endswith("Of its shader the engine does not see image textures and alpha; the surface is opaque")
    lamp = propose_material(shaded("Lamp", Emission_Strength=5.0)).reason
    assert "visible light says nothing of heat" in lamp


# Holes ----------------------------------------------------------------------------------------------------------------


def leaf_picture():
    return bpy.data.images.new("Leaf.png", 4, 4, alpha=True)


def test_a_picture_cuts_holes():
    """At the Alpha of a Principled shader, by its alpha or by its colors, and as its node looks it up."""
    material, image = shaded("Leaf"), leaf_picture()
    texture = textured(material, "Alpha")
    assert "mix" not in propose_material(material).values  # there is no image yet
    texture.image = image
    holes = {"mix": image, "mix_material": "Nothing", "mix_channel": "Inverted Color"}
    proposal = propose_material(material)
    assert {key: proposal.values.get(key) for key in holes} == holes
    assert "Image 'Leaf.png' cuts holes into it" in proposal.reason and "alpha" not in proposal.reason
    join(texture, principled(material).inputs["Alpha"], "Alpha")
    texture.extension, texture.interpolation = "CLIP", "Closest"
    holes |= {"mix_channel": "Inverted Alpha", "mix_extension": "EXTEND", "mix_interpolation": "Closest"}
    assert {key: propose_material(material).values.get(key) for key in holes} == holes
    for key in ("mix", "transmittance"):
        material[key] = 0.5
        assert "mix_material" not in propose_material(material).values
        del material[key]


@pytest.mark.parametrize("solid_first", [True, False])
def test_a_mix_with_a_transparent_shader_cuts_holes(solid_first):
    material = shaded("Fence")
    solid, hole, texture = principled(material), node(material, "BsdfTransparent"), node(material, "TexImage")
    texture.image = leaf_picture()
    mix = mixed(material, *((solid, hole) if solid_first else (hole, solid)))
    join(texture, mix.inputs[0], "Alpha")
    assert propose_material(material).values["mix_channel"] == ("Alpha" if solid_first else "Inverted Alpha")


def test_holes_are_rendered_after_a_click(things):
    """One material that is nowhere serves all; a second click finds nothing."""
    for name in ("Copper", "Oak"):
        join_picture = textured(bpy.data.materials[name], "Alpha")
        join_picture.image = leaf_picture()
    assert operator() == {"FINISHED"}
    nowhere = [material for material in bpy.data.materials if material.name.startswith("Nothing")]
    assert len(nowhere) == 1 and bpy.data.materials["Oak"]["mix_material"] == nowhere[0]
    assert operator() == {"CANCELLED"}


# What is set ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("properties", "rest"),
    [
        ({"emissivity": 0.5}, {"specular": 1.0, "roughness": 0.25}),
        ({"specular": 0.0}, {"emissivity": "Steel, cold rolled", "roughness": 0.25}),
        ({"emissivity": [8.0, 0.9, 14.0, 0.8], "specular": 0.5}, {"roughness": 0.25}),
        ({"emissivity": 0.5, "specular": 0.0, "roughness": 0.0}, None),
        ({"emissivity": "Water"}, {"specular": 1.0, "roughness": 0.25}),
        ({"emissivity": "no such material"}, {"specular": 1.0, "roughness": 0.25}),
        ({"absorption": 0.1}, None),
        ({"gas": "Breath"}, None),
    ],
)
def test_what_is_set_is_not_proposed(properties, rest):
    assert proposed("Material", properties, **METAL) == rest


def test_the_rest_fits_the_emissivity_that_is_set():
    assert proposed("Material", {"emissivity": "gold, polished"}, Roughness=0.5) == {"specular": 1.0, "roughness": 0.5}


# The operator ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def things():
    """Two cubes that share a material, a third with another, and surroundings without a temperature."""
    copper, oak = shaded("Copper", **METAL), shaded("Oak")
    found = [link(f"Cube {i}", cube_mesh(f"Cube {i}")) for i in range(3)]
    for thing, material in zip(found, (copper, copper, oak), strict=True):
        thing.data.materials.append(material)
    bpy.context.scene.world = bpy.data.worlds.new("Sky")
    camera()
    return found


def everything():
    """The custom properties of all that may get some."""
    return {
        (kind, block.name_full): custom_properties(block)
        for kind in ("materials", "objects", "worlds", "scenes", "meshes")
        for block in getattr(bpy.data, kind)
        if block.bl_rna.identifier != "Scene"
    }


def test_a_click_gives_the_scene_values(things):
    things[2]["temperature"] = 310.0
    assert operator() == {"FINISHED"}
    copper, oak = bpy.data.materials["Copper"], bpy.data.materials["Oak"]
    assert custom_properties(copper) == {"emissivity": "Copper, polished", "specular": 1.0, "roughness": 0.25}
    assert custom_properties(oak) == DULL
    ambient = bpy.context.scene.infrared.ambient_temperature
    assert [thing["temperature"] for thing in things] == [ambient, ambient, 310.0]
    assert "temperature" not in bpy.context.scene.camera
    assert bpy.context.scene.world["temperature"] == clear_sky(ambient)
    scene, warnings = read()
    assert warnings == [] and len(scene.materials) == 2
    before = everything()
    assert operator() == {"CANCELLED"}  # a second one finds nothing
    assert everything() == before


def test_an_ordinary_scene_has_all_values_after_a_click():
    """That of the pages' pictures: what is left to tell is what of its shaders is not seen, and ends of data."""
    build()
    assert operator() == {"FINISHED"}
    scene, warnings = read()
    assert len(warnings) == 3 and all("of its shader the engine does not see" in warning for warning in warnings)
    assert len(scene.materials) == len(BALLS) + 4 and scene.world_temperature == pytest.approx(277.06, abs=0.01)
    metals = {material.name for material in scene.materials if material.curve[1].mean() < 0.15}
    assert metals == {"Copper kettle", "Brushed_Aluminum", "Metal.001", "Nothing"}
    assert {material.name for material in scene.materials if material.specular == 0.0} == {
        "Cushion", "Lampshade", "Concrete floor", "brick_wall", "leaf_card", "Nothing"
    }  # fmt: skip


def test_of_selected_objects_alone(things):
    things[0].select_set(True)
    assert operator(scope="SELECTED") == {"FINISHED"}
    assert "emissivity" in bpy.data.materials["Copper"] and "emissivity" not in bpy.data.materials["Oak"]
    assert ["temperature" in thing for thing in things] == [True, False, False]
    assert "temperature" not in bpy.context.scene.world


def test_nothing_selected_sets_nothing(things):
    before = everything()
    assert operator(scope="SELECTED") == {"CANCELLED"}
    assert everything() == before


def test_what_is_not_rendered_is_left_alone(things):
    things[2].hide_render = True
    operator()
    assert "emissivity" not in bpy.data.materials["Oak"] and "temperature" not in things[2]


def test_instances_and_overrides_of_view_layers_are_rendered(things):
    hidden = bpy.data.collections.new("Hidden")
    inside = link("Inside", cube_mesh("Inside"), hidden)
    inside.data.materials.append(shaded("Inside"))
    empty = link("Instance")
    empty.instance_type, empty.instance_collection = "COLLECTION", hidden
    bpy.context.view_layer.material_override = shaded("Override")
    bpy.context.view_layer.world_override = bpy.data.worlds.new("Other sky")
    operator()
    assert all("emissivity" in bpy.data.materials[name] for name in ("Inside", "Override"))
    assert "temperature" in inside and "temperature" in bpy.data.worlds["Other sky"]
    assert "temperature" not in bpy.data.worlds["Sky"]


def test_materials_of_geometry_nodes(things):
    things[0].modifiers.new("Cover", "NODES").node_group = covering(shaded("Cover"))
    operator()
    assert custom_properties(bpy.data.materials["Cover"]) == DULL


def test_temperatures_over_the_surface_count_as_set(things):
    things[0].data.attributes.new("temperature", "FLOAT", "POINT").data.foreach_set("value", np.full(8, 310.0))
    operator()
    assert ["temperature" in thing for thing in things] == [False, True, True]


def test_a_volume_without_a_surface_is_told_and_left(things):
    fog = bpy.data.materials["Oak"]
    fog.node_tree.nodes.remove(principled(fog))
    join(node(fog, "VolumePrincipled"), output(fog).inputs["Volume"])
    operator()
    assert custom_properties(fog) == {}
    assert "volume without a surface" in propose_material(fog).reason.casefold()


def test_linked_data_is_told_and_left(things, tmp_path):
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.objects, wanted.worlds = ["Cube 0"], ["Sky"]
    bpy.context.scene.collection.objects.link(bpy.data.objects["Cube 0"])
    bpy.context.scene.world = bpy.data.worlds["Sky"]
    own = link("Own", cube_mesh("Own"))
    own.data.materials.append(bpy.data.materials["Copper"])
    before = everything()
    assert operator() == {"FINISHED"}
    ambient = bpy.context.scene.infrared.ambient_temperature
    assert everything() == before | {("objects", "Own"): {"temperature": ambient}}


def test_of_library_overrides_it_is_told_that_blender_forgets(things, tmp_path, capfd):
    path = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(path, link=True) as (_, wanted):
        wanted.materials = ["Copper"]
    link("Own", cube_mesh("Own")).data.materials.append(bpy.data.materials["Copper"].override_create())
    assert operator() == {"FINISHED"}
    expected = {"emissivity": "Copper, polished", "specular": 1.0, "roughness": 0.25}
    own = next(material for material in bpy.data.materials if material.override_library)
    assert custom_properties(own) == expected
    assert FORGOTTEN in capfd.readouterr().out
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "own.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "own.blend"))
    own = next(material for material in bpy.data.materials if material.override_library)
    assert not custom_properties(own).keys() & expected.keys()  # if Blender keeps it one day, the warning can go


# The list -------------------------------------------------------------------------------------------------------------


def test_only_what_is_shown_and_ticked_is_set(things):
    """The rows are what the dialog hands over; what came to the scene since is in none."""
    rest = {"kind": "", "values": "shown", "reason": ""}
    rows = [
        {"name": "Copper", "key": "Material Copper", "use": True} | rest,
        {"name": "Cube 1", "key": "Object Cube 1", "use": False} | rest,
    ]
    assert operator(rows=rows) == {"FINISHED"}
    assert "emissivity" in bpy.data.materials["Copper"] and "emissivity" not in bpy.data.materials["Oak"]
    assert not any("temperature" in thing for thing in things)


class Dialog:
    """Stands in for the operator's properties: its list can be filled without a window."""

    class Rows(list):
        def add(self):
            self.append(type("Row", (), {})())
            return self[-1]

    def __init__(self, scope):
        self.scope, self.rows, self.index = scope, self.Rows(), 7


def test_the_list_shows_what_would_be_set(things):
    bpy.context.scene.unit_settings.temperature_unit = "CELSIUS"
    before = everything()
    dialog = Dialog("SCENE")
    thermal_from_shaders.list_proposals(dialog, bpy.context)
    assert everything() == before and dialog.index == 0
    shown = [(row.kind, row.name, row.values) for row in dialog.rows]
    assert shown == [
        ("Material", "Copper", "Emissivity 'Copper, polished',  Specular 1,  Roughness 0.25"),
        ("Material", "Oak", "Emissivity 0.93,  Specular 0"),
        ("World", "Sky", "Temperature 3.91 °C"),
        ("Object", "Cube 0", "Temperature 20.00 °C"),
        ("Object", "Cube 1", "Temperature 20.00 °C"),
        ("Object", "Cube 2", "Temperature 20.00 °C"),
    ]
    assert all(row.reason for row in dialog.rows) and len({row.key for row in dialog.rows}) == 6
    thermal_from_shaders.list_proposals(dialog, bpy.context)
    assert len(dialog.rows) == 6
    dialog.scope = "SELECTED"
    thermal_from_shaders.list_proposals(dialog, bpy.context)
    assert dialog.rows == []


def test_outcomes_are_told(things):
    found = thermal_from_shaders.find_proposals("SCENE", bpy.context)
    outcome = thermal_from_shaders.outcome
    assert outcome(found, []) == "Values set for 2 materials, 3 objects, 1 world"
    assert outcome([], []) == "Nothing was set: nothing was missing"
    assert outcome([], found[:1]) == f"Nothing was set; not for 'Copper': {found[0].reason}"
    assert outcome(found[:1], found[1:]).endswith("; nothing for 'Oak', 'Sky', 'Cube 0', ...")


def test_it_is_one_step_of_undo(things):
    bpy.context.preferences.edit.use_global_undo = True
    bpy.ops.ed.undo_push(message="before")
    before = everything()
    operator("EXEC_DEFAULT", True)
    assert everything() != before
    bpy.ops.ed.undo()
    assert everything() == before


# Skies ----------------------------------------------------------------------------------------------------------------


def test_clear_sky():
    """Swinbank's own form of it: 5.31e-13 T^6 W/m2, as the two are one formula but for the rounding of its factor."""
    for air in (263.0, 283.0, 303.0):
        assert 5.670374e-8 * clear_sky(air) ** 4 == pytest.approx(5.31e-13 * air**6, rel=0.01)
    assert [clear_sky(air) for air in (-5.0, 0.0, 400.0)] == [-5.0, 0.0, 400.0]  # wrong ones are reported as such
