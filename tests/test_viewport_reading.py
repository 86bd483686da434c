# SPDX-License-Identifier: GPL-3.0-or-later
"""A viewport reads of Blender's scene what changed, and asks for another picture only if something did."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading import scene_reader, surfaces  # noqa: E402
from addon.rendering import viewport  # noqa: E402
from tests.helpers.blender import cube_mesh, link, material  # noqa: E402


class Engine:
    """A stand-in for Blender's engine, which reading does not need."""


@pytest.fixture
def objects(reset_blender):
    """Two cubes of a mesh each, and a world."""
    first, second = (link(name, cube_mesh(name), temperature=kelvin) for name, kelvin in (("A", 300.0), ("B", 320.0)))
    second.location.x = 3.0
    for obj in (first, second):
        obj.data.materials.append(material(obj.name, emissivity=0.7))
    bpy.context.scene.world = bpy.data.worlds.new("World")
    return first, second


@pytest.fixture
def live(objects, monkeypatch):
    """A Viewport that reads whenever Blender has evaluated its scene, and the names of the meshes it read."""
    read, names = surfaces.read_mesh, []

    def counted(mesh, owner, warnings, layers):
        names.append(owner)
        return read(mesh, owner, warnings, layers)

    monkeypatch.setattr(surfaces, "read_mesh", counted)
    result, space = viewport.Viewport(Engine()), SimpleNamespace(space=None)

    def evaluated(_scene, depsgraph):
        result.read(depsgraph, space.space)

    bpy.app.handlers.depsgraph_update_post.append(evaluated)
    bpy.context.scene.update_tag()
    bpy.context.view_layer.update()
    yield SimpleNamespace(viewport=result, names=names, looks=space)
    bpy.app.handlers.depsgraph_update_post.remove(evaluated)


def wanted(live):
    """What the viewport would render now, and the names of the meshes that it read since the last call."""
    bpy.context.view_layer.update()
    names = sorted(live.names)
    live.names.clear()
    return live.viewport._wanted, names


def from_scratch():
    """What another viewport would render now."""
    other = viewport.Viewport(Engine())
    other.read(bpy.context.evaluated_depsgraph_get(), None)
    return other._wanted


def heat(obj):
    obj["temperature"] = 350.0
    obj.update_tag()


def move(obj):
    obj.location.z = 2.0


def dent(obj):
    obj.data.vertices[0].co.x -= 0.5
    obj.data.update()


def add_modifier(obj):
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 1


def darken(obj):
    obj.active_material["emissivity"] = 0.3
    obj.active_material.update_tag()


def warm_world(_obj):
    bpy.context.scene.world["temperature"] = 250.0
    bpy.context.scene.world.update_tag()


def more_passes(_obj):
    bpy.context.scene.infrared.passes += 1
    bpy.context.scene.update_tag()


def other_palette():
    bpy.context.scene.infrared.palette = "VIRIDIS"


def other_parameters():
    infrared = bpy.context.scene.infrared
    infrared.assumed_emissivity, infrared.optics_transmission, infrared.optics_temperature = 0.5, 0.9, 310.0


def hide(obj):
    obj.hide_set(True)


def mix(obj):
    obj.data.attributes.new("wet", "FLOAT", "POINT").data.foreach_set("value", [0.25] * 8)
    obj.active_material["mix"], obj.active_material["mix_material"] = "wet", material("Water")
    obj.active_material.update_tag()


def heat_by_image(obj):
    """It needs a UV map, so the mesh is read again, too."""
    obj.data.uv_layers.new()
    obj["temperature_image"], obj["temperature_range"] = bpy.data.images.new("Heat", 2, 2), [300.0, 310.0]
    obj.update_tag()


@pytest.mark.parametrize("edit", [other_palette, other_parameters])
def test_what_acts_on_the_picture_asks_for_no_other(objects, live, edit):
    before, _ = wanted(live)
    edit()
    bpy.context.scene.update_tag()
    assert viewport.same(wanted(live)[0], before)


@pytest.mark.parametrize(
    ("edit", "shapes"),
    [
        (heat, "A"),
        (heat_by_image, "A"),
        (move, ""),
        (dent, "A"),
        (add_modifier, "A"),
        (darken, "A"),
        (mix, "A"),
        (warm_world, ""),
        (more_passes, ""),
        (hide, ""),
    ],
)
def test_edits_are_seen_and_only_changed_shapes_are_read(objects, live, edit, shapes):
    """shapes: the meshes that Blender itself evaluates again; no other may be read."""
    before, names = wanted(live)
    assert names == ["A", "B"]
    edit(objects[0])
    after, names = wanted(live)
    assert set(names) <= set(shapes)
    assert not viewport.same(after, before)
    assert viewport.same(after, from_scratch())


def fill(obj):
    obj.active_material["absorption"] = 0.5
    obj.active_material.update_tag()


def thicken(obj):
    obj.active_material["gas"] = "Steam"
    obj.active_material.update_tag()


def compress(obj):
    obj["pressure"] = 2e5
    obj.update_tag()


def fill_world(_obj):
    world = bpy.context.scene.world
    world["absorption"], world["depth"] = 0.01, 100.0
    world.update_tag()


def test_gas_is_seen_live(objects, live):
    """Whatever changes in it: what its material, its object, its mesh and the world say."""
    seen = [wanted(live)[0]]
    for edit in (fill, thicken, compress, heat, move, dent, fill_world, warm_world):
        edit(objects[0])
        seen.append(wanted(live)[0])
        assert not viewport.same(seen[-1], seen[-2]), edit
        assert viewport.same(seen[-1], from_scratch())
    assert [len(each.scene.media) for each in seen] == [0, 1, 1, 1, 1, 1, 1, 2, 2]
    assert len(seen[-1].scene.triangles) == 12  # the other cube


def test_selecting_asks_for_nothing(objects, live):
    before, _ = wanted(live)
    objects[0].select_set(True)
    bpy.context.view_layer.objects.active = objects[1]
    bpy.context.scene.update_tag()
    after, names = wanted(live)
    assert after is before and names == []


def test_meshes_of_deleted_objects_are_forgotten(objects, live):
    wanted(live)
    assert {name for name, _ in live.viewport._meshes} == {"A", "B"}
    bpy.data.objects.remove(objects[0])
    after, _ = wanted(live)
    assert {name for name, _ in live.viewport._meshes} == {"B"} and len(after.scene.triangles) == 12


def test_problems_are_named_and_end(objects, live):
    wanted(live)
    heat(objects[0])
    objects[0]["temperature"] = -5.0
    nothing, _ = wanted(live)
    assert nothing is None and "Object 'A': temperature -5 K" in live.viewport._problem
    heat(objects[0])
    something, _ = wanted(live)
    assert something.scene.temperature.max() == 350.0 and live.viewport._problem == ""


def test_what_the_viewport_does_not_show_is_not_rendered(objects, live):
    """Local view and the types of objects that a viewport shows are its own, not the scene's."""
    wanted(live)
    area = next(a for a in bpy.context.window_manager.windows[0].screen.areas if a.type == "VIEW_3D")
    live.looks.space = area.spaces[0]
    lamp = link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    assert len(wanted(live)[0].scene.lights) == 1
    area.spaces[0].show_object_viewport_light = False
    lamp.location.z = 5.0
    assert len(wanted(live)[0].scene.lights) == 0
    area.spaces[0].show_object_viewport_mesh = False
    lamp.location.z = 6.0
    assert wanted(live)[0] is None and "nothing to render" in live.viewport._problem


def test_a_render_of_what_was_read_is_that_of_the_reader(objects, live):
    """Kept meshes make the same Scene as scene_reader.read_scene reads for a final render."""
    bpy.context.scene.camera = link("Camera", bpy.data.cameras.new("Camera"))
    move(objects[1])
    after, _ = wanted(live)
    scene, _ = scene_reader.read_scene(bpy.context.evaluated_depsgraph_get())
    assert viewport.same(after.scene, dataclasses.replace(scene, camera=after.scene.camera))
    assert np.ptp(scene.vertices[:, 2]) > 1.5  # m: the cube that was moved is where it is now


@pytest.mark.parametrize("error", [MemoryError(), KeyError("a mistake of ours")])
def test_whatever_reading_raises_is_told_in_place_of_the_picture(objects, live, monkeypatch, caplog, error):
    before, _ = wanted(live)

    def fail(*_):
        raise error

    with monkeypatch.context() as patched:
        patched.setattr(viewport, "read_settings", fail)
        for obj in objects:
            heat(obj)
            assert wanted(live)[0] is None
    expected = "Out of memory" if isinstance(error, MemoryError) else f"The solver failed: {error!r}"
    assert live.viewport._problem.startswith(expected)
    assert caplog.text.count("Traceback") == isinstance(error, KeyError)  # once, not at every update
    heat(objects[0])
    assert wanted(live)[0] is not None and live.viewport._problem == "" and before is not None


def test_images_are_read_again_if_they_may_have_changed(objects, live):
    """One that is saved is kept; one that was painted on is not, as nothing tells of a stroke."""
    obj = objects[0]
    obj.data.uv_layers.new()
    image = obj["temperature_image"] = bpy.data.images.new("Heat", 2, 2)
    obj["temperature_range"] = [300.0, 310.0]
    obj.update_tag()

    def texture(edit):
        edit(objects[1])
        return wanted(live)[0].scene.textures.images[0]

    first = texture(move)
    assert np.unique(first.values).tolist() == [300.0] and texture(hide) is first
    image.generated_color = (1.0, 1.0, 1.0, 1.0)
    second = texture(heat)
    assert np.unique(second.values).tolist() == [310.0]
    for value in (0.0, 0.2, 0.6):
        image.pixels.foreach_set(np.full(16, value, np.float32))
        obj.update_tag()
        np.testing.assert_allclose(texture(more_passes).values, 300.0 + 10.0 * value, atol=10.0 * 0.5 / 255)
