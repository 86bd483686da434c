# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair curves, particle hair and point clouds of Blender, and their instances, as the engine reads and renders them."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.reading import surfaces  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read, render_to_exr  # noqa: E402

AMBIENT = 293.15


@pytest.fixture(autouse=True)
def empty():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    camera(location=(0.0, 0.0, 5.0), width=64, height=48)


def curves(*hairs, radius=None, **attributes):
    """A Curves data-block with hairs through points, (n, 3) each. attributes: (type, domain, values)."""
    data = bpy.data.hair_curves.new("Fur")
    data.add_curves([len(hair) for hair in hairs])
    points = np.concatenate([np.asarray(hair, np.float32) for hair in hairs])
    data.attributes["position"].data.foreach_set("vector", points.ravel())
    if radius is not None:
        attributes["radius"] = "FLOAT", "POINT", np.broadcast_to(np.float32(radius), len(points))
    for name, (kind, domain, values) in attributes.items():
        data.attributes.new(name, kind, domain).data.foreach_set("value", np.ascontiguousarray(values))
    return data


def lines(count, length=1.0, points=2):
    """Straight hairs along z, side by side."""
    z = np.linspace(0.0, length, points)
    return [np.column_stack((np.full(points, 0.1 * i), np.zeros(points), z)) for i in range(count)]


def area(scene):
    a, b, c = scene.vertices[scene.triangles].swapaxes(0, 1)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def furry(count=20, **settings):
    """A plane of 1 m with particle hair that points up."""
    mesh = bpy.data.meshes.new("Skin")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    host = link("Furry", mesh, temperature=305.0)
    host.modifiers.new("Hair", "PARTICLE_SYSTEM")
    hair = host.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length = "HAIR", count, 0.5
    for name, value in settings.items():
        setattr(hair, name, value)
    return host


def geometry_nodes(obj, build):
    """A modifier whose nodes build() makes: from nodes, links and the geometry that comes in."""
    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    given, made = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(build(tree.nodes, tree.links, given.outputs[0]), made.inputs[0])
    obj.modifiers.new("Nodes", "NODES").node_group = tree


def point_cloud(nodes, links, geometry, radius=0.05, count=50):
    """Points on a mesh."""
    points = nodes.new("GeometryNodeMeshToPoints")
    grid = nodes.new("GeometryNodeMeshGrid")
    grid.inputs["Vertices X"].default_value, grid.inputs["Vertices Y"].default_value = count, 2
    links.new(grid.outputs["Mesh"], points.inputs[0])
    points.inputs["Radius"].default_value = radius
    return points.outputs[0]


# Hair curves ----------------------------------------------------------------------------------------------------------


def test_hair_curves_have_the_surface_of_round_hairs():
    """Thick ones, thin ones, and one whose radius Blender does not tell, which is Cycles' 5 mm."""
    for radius, known in ((0.1, 0.1), (1e-4, 1e-4), (None, 0.005)):
        fur = link("Fur", curves(*lines(3, points=5), radius=radius), temperature=300.0)
        scene, warnings = read()
        faces = 2.0 if len(scene.triangles) == 3 * 2 else 1.0  # ribbons have two sides
        ends = 0.0 if faces == 2.0 else 6.0 * np.pi * known**2
        assert area(scene) * faces == pytest.approx(3.0 * 2.0 * np.pi * known + ends, rel=0.02)
        assert (scene.temperature == 300.0).all() and not [w for w in warnings if "temperature" in w]
        bpy.data.objects.remove(fur)


def test_thin_hairs_are_ribbons_and_near_ones_have_many_sides():
    link("Fur", curves(*lines(2), radius=1e-4))
    link("Rope", curves([(0, 0, 4), (0, 1, 4)], radius=0.2))
    scene, _ = read()
    counts = np.bincount(scene.vertices[scene.triangles[:, 0], 2] > 2.0)
    assert counts[0] == 2 * 2  # of the hairs
    assert counts[1] >= 24 * 2
    assert scene.corner_normals is not None


@pytest.mark.parametrize("domain", ["POINT", "CURVE"])
def test_temperatures_of_points_and_of_curves(domain):
    values = np.array([300.0, 310.0, 320.0, 300.0, 310.0, 320.0] if domain == "POINT" else [300.0, 330.0], np.float32)
    link("Fur", curves(*lines(2, points=3), radius=0.01, temperature=("FLOAT", domain, values)), temperature=250.0)
    scene, warnings = read()
    at = scene.vertices[scene.triangles]
    expected = 300.0 + 20.0 * at[:, :, 2] if domain == "POINT" else np.where(at[:, :, 0] > 0.05, 330.0, 300.0)
    np.testing.assert_allclose(
        np.broadcast_to(scene.temperature.reshape(len(at), -1), at.shape[:2]), expected, rtol=1e-6
    )
    assert not [w for w in warnings if "temperature" in w]


def test_hair_gets_no_image_of_temperatures():
    bpy.context.view_layer.objects.active = link("Fur", curves(*lines(2)))
    assert not bpy.ops.infrared.temperature_image.poll()
    bpy.context.view_layer.objects.active = link("Cube", cube_mesh())
    assert bpy.ops.infrared.temperature_image.poll()


def test_materials_of_curves():
    fur = curves(*lines(3), radius=0.01, material_index=("INT", "CURVE", np.array([1, 0, 7], np.int32)))
    for emissivity in (0.5, 0.9):
        fur.materials.append(material(emissivity=emissivity))
    link("Fur", fur, temperature=300.0)
    scene, _ = read()
    hair = np.round(scene.vertices[scene.triangles[:, 0], 0] / 0.1).astype(int)
    found = [{scene.materials[i].emissivity for i in scene.material[hair == each]} for each in range(3)]
    assert found == [{0.9}, {0.5}, {0.9}]  # beyond the last slot the last counts, as for faces


@pytest.mark.parametrize("kind", ["CATMULL_ROM", "POLY", "BEZIER", "NURBS"])
def test_types_of_curves(kind):
    """A hat of two spans: straight, or round, and then longer."""
    data = curves([(0, 0, 0), (1, 0, 1), (2, 0, 0)], radius=0.002)
    data.set_types(type=kind)
    if kind == "BEZIER":
        for name in ("handle_left", "handle_right"):
            attribute = data.attributes.get(name) or data.attributes.new(name, "FLOAT_VECTOR", "POINT")
            attribute.data.foreach_set("vector", np.array([0, 0, 0.5, 1, 0, 2, 2, 0, 0.5], np.float32))
    link("Hat", data, temperature=300.0)
    scene, warnings = read()
    highest = scene.vertices[:, 2].max()
    if kind == "POLY":
        assert len(scene.triangles) == 4 and highest == pytest.approx(1.0, abs=0.01)
    elif kind == "BEZIER":  # each span is highest at t = 2/3 or more: its polynomial says
        t = np.linspace(0.0, 1.0, 10_001)
        exact = (3 * t * (1 - t) ** 2 * 0.5 + 3 * t**2 * (1 - t) * 2 + t**3).max()
        assert highest == pytest.approx(exact, abs=0.02)
    else:
        assert len(scene.triangles) > 4
    assert any("NURBS" in w for w in warnings) == (kind == "NURBS")


def test_cyclic_curves_are_closed():
    angle = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]
    ring = np.column_stack((np.cos(angle), np.sin(angle), 0.0 * angle))
    link("Ring", curves(ring, radius=0.05, cyclic=("BOOLEAN", "CURVE", np.array([True]))), temperature=300.0)
    scene, _ = read()
    assert area(scene) == pytest.approx(2.0 * np.pi * 0.05 * 2.0 * np.pi + 2.0 * np.pi * 0.05**2, rel=0.02)


def test_hairs_that_cannot_be_rendered_are_named():
    hairs = [*lines(5, points=3), [(0, 1, 0)], [(0, 2, 0), (0, 2, 0)]]
    hairs[1][1, 1] = np.nan
    data = curves(*hairs, radius=0.01)
    radius = np.full(18, 0.01, np.float32)
    radius[6:9], radius[9] = 0.0, np.inf
    data.attributes["radius"].data.foreach_set("value", radius)
    link("Fur", data, temperature=300.0)
    scene, warnings = read()
    assert np.isfinite(scene.vertices).all()
    said = [warning.removeprefix("'Fur': ") for warning in warnings if "'Fur'" in warning]
    assert "2 of 7 hairs have a position or radius that is not finite (the first is 1) and are left out" in said
    assert "2 of 7 hairs have fewer than two points that lie apart (the first is 5) and are left out" in said
    assert "1 of 7 hairs have no radius above 0 (the first is 2) and are left out" in said
    used = np.unique(np.round(scene.vertices[scene.triangles][:, :, 0] / 0.1))
    np.testing.assert_array_equal(used, [0, 4])


def test_a_scene_of_nothing_but_broken_hair_has_nothing_to_render():
    link("Fur", curves(*lines(3), radius=0.0))
    with pytest.raises(SceneError, match="nothing to render"):
        read()


def test_a_temperature_that_makes_no_sense_names_the_hair():
    link("Fur", curves(*lines(2), temperature=("FLOAT", "CURVE", np.array([300.0, -4.0], np.float32))))
    with pytest.raises(SceneError, match="Attribute 'temperature' of object 'Fur'"):
        read()


def test_more_hair_than_there_is_memory_for_is_named(monkeypatch):
    monkeypatch.setattr("addon.solver.memory.available_memory", lambda: 1000)
    link("Fur", curves(*lines(100)))
    with pytest.raises(SceneError, match="Object 'Fur' has 100 hairs, .* it alone needs about"):
        read()


# Instances ------------------------------------------------------------------------------------------------------------


def test_instances_of_hair_share_their_triangles(monkeypatch):
    made, real = [], surfaces.triangles_of
    monkeypatch.setattr(surfaces, "triangles_of", lambda *args: made.append(args[2]) or real(*args))
    collection = bpy.data.collections.new("Wig")
    link("Fur", curves(*lines(4), radius=0.002), collection, temperature=310.0)
    for i in range(5):
        empty = link(f"Head{i}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location, empty.scale = (0.1 * i, 0.2 * i, -10.0), (1.0, 1.0, 2.0)
    scene, _ = read()
    assert made == ["Fur"]
    assert len(scene.triangles) == 5 * 4 * 2 and (scene.temperature == 310.0).all()
    assert np.ptp(scene.vertices[:, 2]) == pytest.approx(2.0)


def test_curves_and_points_that_geometry_nodes_instance():
    fur, host = link("Fur", curves(*lines(2), radius=0.002), temperature=320.0), link("Host", cube_mesh())
    fur.hide_render = True
    host["temperature"] = 300.0

    def build(nodes, links, geometry):
        info, instances = nodes.new("GeometryNodeObjectInfo"), nodes.new("GeometryNodeInstanceOnPoints")
        info.inputs["Object"].default_value = fur
        info.inputs["As Instance"].default_value = True
        links.new(geometry, instances.inputs["Points"])
        links.new(info.outputs["Geometry"], instances.inputs["Instance"])
        return instances.outputs[0]

    geometry_nodes(host, build)
    scene, _ = read()
    assert len(scene.triangles) == 8 * 2 * 2
    assert (scene.temperature == 320.0).all()


def test_curves_that_geometry_nodes_make_beside_a_mesh_are_named():
    host = link("Host", cube_mesh(), temperature=300.0)

    def build(nodes, links, geometry):
        circle, both = nodes.new("GeometryNodeCurvePrimitiveCircle"), nodes.new("GeometryNodeJoinGeometry")
        links.new(geometry, both.inputs[0])
        links.new(circle.outputs[0], both.inputs[0])
        return both.outputs[0]

    geometry_nodes(host, build)
    assert any("'Host'" in warning and "Curve to Mesh" in warning for warning in read()[1])


# Particle hair --------------------------------------------------------------------------------------------------------


def test_particle_hair_becomes_tapered_tubes():
    """Hairs of 0.5 m that taper from 10 mm to nothing: cones, whose surface is pi r l; here ribbons of two sides."""
    furry(20, root_radius=2.0, tip_radius=0.0, radius_scale=0.01)
    scene, warnings = read()
    assert not [warning for warning in warnings if "temperature" in warning]
    skin = 1.0
    assert 2.0 * (area(scene) - skin) == pytest.approx(20 * np.pi * 0.01 * 0.5, rel=1e-3)
    assert scene.vertices[:, 2].max() == pytest.approx(0.5, rel=1e-5)
    assert (scene.temperature == 305.0).all()


def test_children_are_rendered_in_place_of_their_parents():
    furry(10, child_type="SIMPLE", rendered_child_count=7, render_step=2, radius_scale=1e-4)
    assert len(read()[0].triangles) == 2 + 10 * 7 * 1  # pointed ribbons of one triangle


def test_hair_has_the_material_of_its_slot_and_its_own_temperature():
    host = furry(5, material=2)
    for emissivity in (0.3, 0.97):
        host.data.materials.append(material(emissivity=emissivity))
    host.data.attributes.new("temperature", "FLOAT", "FACE").data.foreach_set("value", [309.0])
    scene, _ = read()
    emissivity = np.array([each.emissivity for each in scene.materials])[scene.material]
    temperature = scene.temperature.reshape(len(scene.triangles), -1)
    np.testing.assert_array_equal(emissivity[:2], 0.3)
    np.testing.assert_array_equal(emissivity[2:], 0.97)
    np.testing.assert_array_equal(temperature[:2], 309.0)
    np.testing.assert_array_equal(temperature[2:], 305.0)
    del host["temperature"]
    said = "its particle hair has no temperature; the ambient 293.15 K counts"
    assert any(said in warning for warning in read()[1])
    found = scene_checks(bpy.context.scene, bpy.context.view_layer)
    assert any(check.text == f"Object 'Furry': {said}" for check in found)


def test_hair_of_a_hidden_surface_and_hidden_hair():
    host = furry(5, radius_scale=1e-4)
    host.show_instancer_for_render = False
    assert len(read()[0].triangles) == 5
    host.show_instancer_for_render, host.modifiers[0].show_render = True, False
    assert len(read()[0].triangles) == 2


def test_instances_of_furry_objects():
    """Each hair stands on its own skin, wherever the object itself is and however it is scaled."""
    collection = bpy.data.collections.new("Herd")
    host = furry(6, radius_scale=1e-4)
    bpy.context.scene.collection.objects.unlink(host)
    collection.objects.link(host)
    host.location, host.rotation_euler = (3.0, 0.0, 1.0), (0.0, 0.4, 0.0)
    for i in range(3):
        empty = link(f"Animal{i}", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location, empty.scale = (2.0 * i, 0.0, -20.0), (1.0, 2.0, 3.0)
    scene, _ = read()
    assert len(scene.triangles) == 3 * (2 + 6)
    part = 2 + 6
    for i in range(1, 3):
        moved = scene.vertices[scene.triangles[i * part : (i + 1) * part]]
        first = scene.vertices[scene.triangles[:part]]
        np.testing.assert_allclose(moved - first, np.broadcast_to((2.0 * i, 0, 0), first.shape), atol=2e-3)


def test_labels_count_hair_with_its_skin():
    furry(5)
    link("Fur", curves(*lines(2)), temperature=300.0)
    bpy.context.scene.infrared.label_path = "//labels"
    read_by = []
    real = surfaces.SurfaceReader.arrays

    def arrays(self, world):
        read_by.append(self)
        return real(self, world)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(surfaces.SurfaceReader, "arrays", arrays)
        scene, _ = read()
    numbers = read_by[0].labels("instance")
    assert [each.name for each in read_by[0].instances] == ["Furry", "Fur"]
    assert len(numbers) == len(scene.triangles)
    assert set(numbers[scene.temperature == 305.0]) == {1} and set(numbers[scene.temperature == 300.0]) == {2}


# Point clouds ---------------------------------------------------------------------------------------------------------


def test_points_of_a_cloud_have_the_surface_of_spheres():
    geometry_nodes(link("Host", cube_mesh(), temperature=300.0), point_cloud)
    scene, _ = read()
    assert area(scene) == pytest.approx(100 * 4.0 * np.pi * 0.05**2, rel=1e-4)
    assert (scene.temperature == 300.0).all()


def test_points_that_cannot_be_rendered_are_named():
    geometry_nodes(link("Host", cube_mesh(), temperature=300.0), lambda *args: point_cloud(*args, radius=0.0, count=2))
    link("Cube", cube_mesh(), temperature=300.0)
    said = "4 of 4 points have no radius above 0 (the first is 0) and are left out"
    assert any(said in warning for warning in read()[1])


def test_temperatures_of_points():
    def build(nodes, links, geometry):
        store, index = nodes.new("GeometryNodeStoreNamedAttribute"), nodes.new("GeometryNodeInputIndex")
        store.inputs["Name"].default_value = "temperature"
        above = nodes.new("ShaderNodeMath")
        above.inputs[1].default_value = 300.0
        links.new(index.outputs[0], above.inputs[0])
        links.new(above.outputs[0], store.inputs["Value"])
        links.new(point_cloud(nodes, links, geometry, count=3), store.inputs["Geometry"])
        return store.outputs["Geometry"]

    geometry_nodes(link("Host", cube_mesh(), temperature=250.0), build)
    scene, _ = read()
    kelvin, counts = np.unique(scene.temperature, return_counts=True)
    np.testing.assert_array_equal(kelvin, 300.0 + np.arange(6))
    assert len(set(counts)) == 1


# Renders --------------------------------------------------------------------------------------------------------------


def sky(kelvin):
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    scene.world["temperature"] = kelvin
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.threads, infrared.band_count = 8, 1000, 2, 2
    infrared.default_emissivity = 1.0
    return infrared


def image(folder):
    return next(iter(render_to_exr(folder).values()))


@pytest.mark.once
def test_black_hair_covers_what_round_hair_does(tmp_path):
    """Hairs of 0.2 pixel, 8 to a pixel in a row across the whole picture, far enough apart not to hide each other from
    above: they cover d / s of it, d their diameter and s their distance. Their angles are spread evenly, so the cover
    is known to a few per cent."""
    infrared = sky(0.0)
    bpy.context.scene.camera.data.type, bpy.context.scene.camera.data.ortho_scale = "ORTHO", 0.64
    pixel, count = 0.01, 640
    x = (np.arange(count) + 0.5) / count * 0.8 - 0.4
    spacing, radius = 0.8 / count, 0.2 * 0.8 / count
    hairs = [[(each, -0.4, 0.0), (each, 0.4, 0.0)] for each in x]
    assert radius < 0.3 * pixel
    link("Fur", curves(*hairs, radius=radius), temperature=300.0)
    infrared.passes = 16
    radiance = image(tmp_path)["Radiance"]
    bpy.data.objects.remove(bpy.data.objects["Fur"])
    mesh = cube_mesh()
    link("Wall", mesh, temperature=300.0).scale = (2.0, 2.0, 0.1)
    whole = image(tmp_path)["Radiance"].mean()
    assert radiance.mean() / whole == pytest.approx(2.0 * radius / spacing, rel=0.03)


def test_hair_and_skin_of_one_temperature_are_exactly_black(tmp_path):
    infrared = sky(300.0)
    infrared.default_emissivity = 0.6
    host = furry(300, radius_scale=0.004)
    host["temperature"], host.location = 300.0, (-0.5, -0.5, 2.0)
    temperature = image(tmp_path)["Temperature"]
    np.testing.assert_allclose(temperature, 300.0, atol=1e-3)


@pytest.mark.once
def test_dense_fur_looks_the_same_when_it_is_simplified(tmp_path, monkeypatch):
    """3000 hairs of 0.03 pixel stand upright on a plate and cover about a quarter of it; 1000 wider ones in their place
    leave the mean as it is. Cover by n hairs at random is known to about 1 / sqrt(n), 3 %, of itself."""
    infrared = sky(250.0)
    bpy.context.scene.camera.data.type, bpy.context.scene.camera.data.ortho_scale = "ORTHO", 1.0
    rng = np.random.default_rng(3)
    begin = np.column_stack((rng.uniform(-0.6, 0.6, (3000, 2)), np.zeros(3000)))
    lean = np.column_stack((rng.normal(0.0, 0.2, (3000, 2)), np.full(3000, 0.1)))
    radius = 0.5 * 0.03 / 64
    link("Fur", curves(*np.stack((begin, begin + lean), axis=1), radius=radius), temperature=320.0)
    plate = link("Plate", cube_mesh(), temperature=280.0)
    plate.scale, plate.location = (2.0, 2.0, 0.1), (0.0, 0.0, -0.1)
    infrared.passes = 4
    means = []
    for few in (10_000, 1000):
        monkeypatch.setattr("addon.reading.strands.FEW", few)
        means.append(image(tmp_path)["Temperature"].mean())
    hair = means[0] - 280.0
    assert hair > 1.0 and means[0] != means[1]
    assert means[1] - means[0] == pytest.approx(0.0, abs=4.0 / np.sqrt(1000.0) * hair)
