# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures that fail to be what somebody wanted: drivers that give none, and surroundings that were given none.

The render and the Checks panel name the owner and say what counts instead.
"""

import logging

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

import bmesh  # noqa: E402

from addon.reading.openness import surely_open  # noqa: E402
from addon.rendering import final_render  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read  # noqa: E402

ROOM = 20.0  # m


@pytest.fixture
def cube(reset_blender):
    """A scene of which nothing is to be said: a cube, a lamp, and surroundings that somebody set to 0 K."""
    scene = bpy.context.scene
    camera()
    cube = link("Cube", cube_mesh(), temperature=300.0)
    cube.data.materials.append(material(emissivity=0.9))
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"), temperature=3000.0)
    scene.world = bpy.data.worlds.new("Sky")
    scene.world["temperature"] = 0.0
    scene.render.engine = "INFRARED_PHOTONS"
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 1, 1000, 2, 1
    return cube


def checks(level="WARNING"):
    """Texts of a level in the panel."""
    bpy.context.view_layer.update()
    every = scene_checks(bpy.context.scene, bpy.context.view_layer)
    return [check.text for check in every if check.level == level]


def rendered(caplog):
    """The warnings of a render."""
    caplog.clear()
    bpy.ops.render.render()
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


def drive(owner, expression, key="temperature"):
    """Drive a custom property of a data block."""
    curve = owner.driver_add(f'["{key}"]')
    curve.driver.expression = expression
    return curve


# Drivers --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("expression", ["1 / 0", "sqrt(-1)", "missing + 1", "'warm'", "300 +"])
def test_a_driver_that_fails_is_named(cube, caplog, expression):
    """Blender has put 0 in the property."""
    drive(cube, expression)
    remark = f"the driver '{expression}' of temperature fails; what the property holds counts: 0 K"
    assert checks() == [f"Object 'Cube': {remark}"]
    assert rendered(caplog) == [f"'Cube': {remark}"]


def test_a_driver_without_what_it_depends_on_is_named(cube, caplog):
    driver = drive(cube, "").driver
    driver.type = "AVERAGE"
    variable = driver.variables.new()
    variable.targets[0].id, variable.targets[0].data_path = cube, '["nothing"]'
    assert checks() == ["Object 'Cube': the driver of temperature fails; what the property holds counts: 0 K"]
    assert rendered(caplog) == ["'Cube': the driver of temperature fails; what the property holds counts: 0 K"]


@pytest.mark.parametrize("expression", ["float('nan')", "float('inf')"])
def test_a_driver_that_gives_no_number_is_named(cube, caplog, expression):
    drive(cube, expression)
    remark = (
        f"the driver '{expression}' of temperature gives 0 K, as it does if its result is no number or scripts may not "
        "run; 0 K counts"
    )
    assert checks() == [f"Object 'Cube': {remark}"]
    assert rendered(caplog) == [f"'Cube': {remark}"]


@pytest.mark.parametrize("owner, called", [("Lamp", "Light 'Lamp'"), ("Sky", "World 'Sky'")])
def test_drivers_of_lights_and_worlds_are_named_too(cube, owner, called):
    drive(bpy.context.scene.world if owner == "Sky" else bpy.data.objects[owner], "float('nan')")
    (check,) = checks()
    assert check.startswith(f"{called}: the driver 'float('nan')' of temperature gives 0 K")
    assert read()[1] == [check.replace(called, f"'{owner}'")]


@pytest.mark.parametrize("key", ["emissivity", "specular", "absorption"])
def test_drivers_of_materials_are_named_too(cube, key):
    paint = cube.data.materials[0]
    paint[key] = 0.5
    drive(paint, "1 / 0", key)
    told = f"the driver '1 / 0' of {key} fails; what the property holds counts: 0"
    assert f"Material '{paint.name}': {told}" in checks()
    link("Floor", cube_mesh(), temperature=300.0)  # as gas needs a surface
    assert f"'{paint.name}': {told}" in read()[1]


def test_drivers_of_settings_are_named_too(cube):
    bpy.context.scene.driver_add("infrared.ambient_temperature").driver.expression = "missing"
    told = "the driver 'missing' of ambient_temperature fails; what the setting holds counts: 0.0"
    assert f"Scene: {told}" in checks()
    assert f"'{bpy.context.scene.name}': {told}" in read()[1]


def test_an_object_of_many_instances_is_named_once(cube):
    drive(cube, "1 / 0")
    things = bpy.data.collections.new("Things")
    bpy.context.scene.collection.children.link(things)
    things.objects.link(cube)
    for place in range(3):
        empty = link(f"Instance {place}")
        empty.instance_type, empty.instance_collection = "COLLECTION", things
    assert len(checks()) == len(read()[1]) == 1


def test_nothing_is_said_of_drivers_that_do_not_count(cube, caplog):
    """One that works, one that is muted, and one on a property that an attribute of the mesh outdoes."""
    drive(cube, "300 + frame")
    other = link("Muted", cube.data, temperature=310.0)
    drive(other, "1 / 0").mute = True
    painted = link("Painted", cube_mesh(), temperature=320.0)
    painted.data.materials.append(cube.data.materials[0])
    painted.data.attributes.new("temperature", "FLOAT", "FACE").data.foreach_set("value", np.full(6, 330.0, np.float32))
    drive(painted, "1 / 0")
    other.location.x, painted.location.x = 2.0, -2.0
    assert (checks(), rendered(caplog)) == ([], [])


# Surroundings ---------------------------------------------------------------------------------------------------------


def unset(with_world):
    """Take the temperature of the surroundings away, or the world with it; returns what messages begin with."""
    scene = bpy.context.scene
    if not with_world:
        scene.world = None
        return "The scene has no world"
    del scene.world["temperature"]
    return "World 'Sky' has no temperature"


@pytest.mark.parametrize("with_world", [True, False])
def test_surroundings_without_a_temperature_are_named_in_an_open_scene(cube, caplog, with_world):
    begin = unset(with_world)
    place = "0 K. Set it in World properties, panel Surroundings"
    assert checks() == [f"{begin}, and the scene is open: rays that leave it see {place}"]
    assert rendered(caplog) == [f"ViewLayer: {begin}, and the scene is open: rays that leave it see {place}"]


def test_surroundings_that_somebody_set_are_not_named(cube, caplog):
    """Not even at 0 K."""
    assert (checks(), checks("HINT"), rendered(caplog)) == ([], [], [])


def room(hole=False):
    """A closed room of separate walls around the cube and the camera, or one without its ceiling."""
    half, walls = 0.5 * ROOM, []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            if hole and (axis, sign) == (2, 1.0):
                continue
            wall = link(f"Wall {axis} {sign:g}", cube_mesh(), temperature=290.0)
            wall.data.materials.append(bpy.data.materials[0])
            wall.location[axis] = sign * half
            wall.scale = [1.0 if i == axis else ROOM + 1.0 for i in range(3)]
            walls.append(wall)
    return walls


def test_a_closed_room_needs_no_surroundings(cube, caplog):
    room()
    begin = unset(True)
    assert (checks(), checks("HINT")) == ([], [f"{begin}: if rays leave the scene, they see 0 K"])
    assert rendered(caplog) == []


def test_a_room_without_a_ceiling_is_open(cube, caplog):
    """The camera sees the floor alone; what it does not see leaves."""
    room(hole=True)
    unset(True)
    assert len(checks()) == len(rendered(caplog)) == 1


def test_a_way_out_of_a_mesh_is_for_the_render_to_find(cube, caplog):
    """The box around a shell has no hole, so the panel says it as a hint."""
    shell = link("Shell", cube_mesh(), temperature=290.0)
    shell.data.materials.append(bpy.data.materials[0])
    shell.scale = (ROOM, ROOM, ROOM)
    unset(True)
    assert (len(checks("WARNING")), len(checks("HINT")), rendered(caplog)) == (0, 1, [])
    shape = bmesh.new()
    shape.from_mesh(shell.data)
    bmesh.ops.delete(shape, geom=[face for face in shape.faces if face.normal.z > 0.5], context="FACES_ONLY")
    shape.to_mesh(shell.data)
    shape.free()
    assert (len(checks("WARNING")), len(checks("HINT")), len(rendered(caplog))) == (0, 1, 1)


def test_what_is_hidden_in_the_viewport_may_close_the_scene(cube):
    """The render shows it, and the viewport's depsgraph knows no box of it."""
    walls = room()
    unset(True)
    walls[-1].hide_viewport = True
    assert (len(checks("WARNING")), len(checks("HINT"))) == (0, 1)
    walls[-1].hide_render = True
    assert len(checks("WARNING")) == 1


def test_instances_close_a_scene_too(cube):
    walls = room()
    scene, hidden = bpy.context.scene, bpy.data.collections.new("Walls")
    for wall in walls:
        scene.collection.objects.unlink(wall)
        hidden.objects.link(wall)
    empty = link("Room")
    empty.instance_type, empty.instance_collection = "COLLECTION", hidden
    bpy.context.view_layer.update()
    rendered_objects = {cube: None, empty: None, **dict.fromkeys(walls)}
    depsgraph = bpy.context.view_layer.depsgraph
    assert not surely_open(depsgraph, rendered_objects, scene.camera)
    empty.location.x = 3 * ROOM
    bpy.context.view_layer.update()
    assert surely_open(depsgraph, rendered_objects, scene.camera)


def test_few_rays_that_slip_through_do_not_open_a_room(cube, caplog, monkeypatch):
    unset(True)
    monkeypatch.setattr(final_render, "LEAST_OPENNESS", 1.0)
    assert rendered(caplog) == []
