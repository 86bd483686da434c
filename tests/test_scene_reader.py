# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's scene reaches the solver as the artist sees it, and nonsense is refused by name."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix  # noqa: E402

from addon.reading import bands, surfaces  # noqa: E402
from addon.reading.bands import read_adaptive_bands, read_band_range  # noqa: E402
from addon.reading.groups import read_group_temperatures  # noqa: E402
from addon.reading.lights import uneven_beam  # noqa: E402
from addon.reading.settings import read_settings  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from addon.solver import Settings, render  # noqa: E402
from addon.solver.physics import library  # noqa: E402
from addon.solver.scene import AreaLight, PointLight, SceneError, SpotLight, SunLight  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read, read_as_rendered  # noqa: E402


@pytest.fixture(autouse=True)
def with_camera(reset_blender):
    camera()


def corners(scene):
    """(m, 3, 3) positions of the triangle corners."""
    return scene.vertices[scene.triangles]


def area_and_volume(scene):
    """Surface area, and signed volume (positive when the front sides look outwards)."""
    a, b, c = np.moveaxis(corners(scene).astype(np.float64), 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum(), np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0


def strip_mesh():
    """Two triangles and a quad beside them: points, corners and faces differ in number."""
    mesh = bpy.data.meshes.new("Strip")
    points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (2, 1, 0)]
    mesh.from_pydata(points, [], [(0, 1, 2), (0, 2, 3), (1, 4, 5, 2)])
    return mesh


# Geometry -------------------------------------------------------------------------------------------------------------


def smooth_ball(**values):
    """A linked ball of radius 1 that is shaded smooth."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    ball = bpy.context.object
    ball.data.shade_smooth()
    ball["temperature"] = 300.0
    return ball


def test_flat_meshes_have_no_normals():
    link("Cube", cube_mesh(), temperature=300.0)
    assert read()[0].corner_normals is None


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 1, 0.5), (-2, 1, 0.5), (-1, -1, 1)])
def test_smooth_normals_follow_the_object(scale):
    """A ball becomes an ellipsoid: its normals at the corners are the gradient of its equation, to what Blender's mean
    over faces of unequal shape differs from that, and point outwards if the object is mirrored, too. A flat object
    beside it stays flat."""
    ball = smooth_ball()
    ball.scale, ball.rotation_euler, ball.location = scale, (0.3, 0.5, -0.2), (1.0, 2.0, 3.0)
    link("Cube", cube_mesh(), temperature=300.0)
    scene = read()[0]
    smooth = np.any(scene.corner_normals != 0.0, axis=(1, 2))
    assert smooth.sum() == 16 * 2 * 7 and len(smooth) == 16 * 2 * 7 + 12
    matrix = np.array(ball.matrix_world)
    local = (corners(scene)[smooth] - matrix[:3, 3]) @ np.linalg.inv(matrix[:3, :3]).T
    expected = local @ np.linalg.inv(matrix[:3, :3])
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    given = scene.corner_normals[smooth]
    np.testing.assert_allclose(np.linalg.norm(given, axis=2), 1.0, atol=1e-6)
    assert np.sum(given * expected, axis=2).min() > 0.99
    a, b, c = np.moveaxis(corners(scene)[smooth].astype(np.float64), 1, 0)
    assert np.all(np.einsum("mi,mji->mj", np.cross(b - a, c - a), given) > 0.0)


def test_sharp_edges_stay_sharp():
    """A cube that is shaded smooth, with all edges sharp, has the normals of its faces; without, those of corners."""
    cube = link("Cube", cube_mesh(), temperature=300.0)
    cube.data.shade_smooth()
    rounded = read()[0].corner_normals
    np.testing.assert_allclose(np.abs(rounded), 3**-0.5, atol=1e-3)
    for edge in cube.data.edges:
        edge.use_edge_sharp = True
    assert read()[0].corner_normals is None


def test_custom_normals_count():
    cube = link("Cube", cube_mesh(), temperature=300.0)
    cube.data.normals_split_custom_set([(0.0, 0.6, 0.8)] * len(cube.data.loops))
    np.testing.assert_allclose(read()[0].corner_normals, np.broadcast_to((0.0, 0.6, 0.8), (12, 3, 3)), atol=1e-3)


def test_an_object_without_extent_has_no_normals():
    smooth_ball().scale = (1.0, 1.0, 0.0)
    assert read()[0].corner_normals is None


def test_cube_geometry_and_world_transform():
    obj = link("Cube", cube_mesh(), temperature=300.0)
    obj.location, obj.scale = (1.0, 2.0, 3.0), (1.0, 2.0, 4.0)
    obj.rotation_euler = (0.3, 0.2, 0.1)
    scene, _ = read()
    assert scene.triangles.shape == (12, 3) and scene.triangles.dtype == np.int32
    area, volume = area_and_volume(scene)
    assert area == pytest.approx(2 * (1 * 2 + 2 * 4 + 4 * 1), rel=1e-6)
    assert volume == pytest.approx(8.0, rel=1e-6)
    np.testing.assert_allclose(scene.vertices.mean(axis=0), (1, 2, 3), atol=1e-6)


def test_negative_scale_keeps_the_front_outside():
    obj = link("Cube", cube_mesh(), temperature=300.0)
    obj.scale = (-1.0, 1.0, 2.0)
    scene, _ = read()
    assert area_and_volume(scene)[1] == pytest.approx(2.0, rel=1e-6)


def test_mirrored_object_keeps_corner_temperatures_at_their_corners():
    mesh = strip_mesh()
    attribute = mesh.attributes.new("temperature", "FLOAT", "POINT")
    attribute.data.foreach_set("value", np.array([v.co.x * 10 + 300 for v in mesh.vertices], np.float32))
    obj = link("Strip", mesh)
    obj.scale.y = -1.0
    scene, _ = read()
    np.testing.assert_allclose(scene.temperature, corners(scene)[..., 0] * 10 + 300, rtol=1e-6)


def test_far_from_the_origin_keeps_the_shape():
    obj = link("Cube", cube_mesh(), temperature=300.0)
    obj.location.x = 1e6  # float32 would round a corner to 0.06 m
    obj.scale = (0.01, 0.01, 0.01)
    scene, _ = read()
    extent = np.ptp(scene.vertices, axis=0)
    np.testing.assert_allclose(extent, 0.01, rtol=1e-6)


def test_parent_transform_applies():
    parent = link("Parent")
    parent.location.z = 7.0
    link("Cube", cube_mesh(), temperature=300.0).parent = parent
    assert read()[0].vertices[:, 2].mean() == pytest.approx(7.0)


def test_modifier_is_applied_with_its_render_settings():
    obj = link("Cube", cube_mesh(), temperature=300.0)
    subsurf = obj.modifiers.new("Subdivision", "SUBSURF")
    subsurf.levels, subsurf.render_levels = 0, 2
    assert len(read()[0].triangles) == 6 * 4**2 * 2


def test_hidden_objects_and_collections_stay_out():
    link("Seen", cube_mesh(), temperature=300.0)
    link("Hidden", cube_mesh(), temperature=300.0).hide_render = True
    collection = bpy.data.collections.new("Hidden")
    bpy.context.scene.collection.children.link(collection)
    collection.hide_render = True
    link("Inside", cube_mesh(), collection, temperature=300.0)
    link("Viewport only hidden", cube_mesh(), temperature=300.0).hide_viewport = True
    assert len(read()[0].triangles) == 24


def test_every_view_layer_has_its_own_objects():
    scene = bpy.context.scene
    left, right = (bpy.data.collections.new(name) for name in ("Left", "Right"))
    for collection, count in ((left, 1), (right, 2)):
        scene.collection.children.link(collection)
        for _ in range(count):
            link("Cube", cube_mesh(), collection, temperature=300.0)
    other = scene.view_layers.new("Other")
    scene.view_layers[0].layer_collection.children["Right"].exclude = True
    other.layer_collection.children["Left"].exclude = True
    results = read_as_rendered()
    assert {name: len(result[0].triangles) for name, result in results.items()} == {"ViewLayer": 12, "Other": 24}


def test_collection_instances_are_placed_and_share_their_temperature():
    collection = bpy.data.collections.new("Parts")
    link("Cube", cube_mesh(), collection, temperature=350.0)
    for x in (10.0, 20.0):
        empty = link("Instance")
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location.x = x
        empty.scale = (1, -1, 1)
    scene, warnings = read()
    assert len(scene.triangles) == 24 and not [w for w in warnings if "temperature" in w]
    assert sorted({round(float(x)) for x in corners(scene)[..., 0].mean(axis=1)} & {10, 20}) == [10, 20]
    assert np.all(scene.temperature == 350.0)
    assert area_and_volume(scene)[1] == pytest.approx(2.0, rel=1e-6)


def geometry_nodes(obj, build):
    """Give the object a geometry nodes modifier; build(nodes, links) returns the output socket."""
    tree = bpy.data.node_groups.new("Geometry", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(build(tree.nodes, tree.links), output.inputs[0])
    obj.modifiers.new("Nodes", "NODES").node_group = tree


def test_geometry_nodes_instances_of_an_object_and_of_a_mesh():
    part = link("Part", cube_mesh(), temperature=400.0)
    part.hide_render = True
    part.data.materials.append(material("Paint of part", emissivity=0.1))
    inner = material("Paint of instance", emissivity=0.2)

    def build(nodes, links):
        line = nodes.new("GeometryNodeMeshLine")
        line.inputs["Count"].default_value = 3
        info = nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value = part
        info.inputs["As Instance"].default_value = True
        cube, paint = nodes.new("GeometryNodeMeshCube"), nodes.new("GeometryNodeSetMaterial")
        paint.inputs["Material"].default_value = inner
        links.new(cube.outputs["Mesh"], paint.inputs["Geometry"])
        join = nodes.new("GeometryNodeJoinGeometry")
        for source in (info.outputs["Geometry"], paint.outputs["Geometry"]):
            instances = nodes.new("GeometryNodeInstanceOnPoints")
            links.new(line.outputs["Mesh"], instances.inputs["Points"])
            links.new(source, instances.inputs["Instance"])
            links.new(instances.outputs["Instances"], join.inputs[0])
        return join.outputs[0]

    host = link("Host", cube_mesh(), temperature=310.0)
    host.data.materials.append(material("Paint of host", emissivity=0.3))
    geometry_nodes(host, build)
    scene, _ = read()
    assert len(scene.triangles) == 2 * 3 * 12
    emissivity = np.array([m.emissivity for m in scene.materials])[scene.material]
    assert [np.sum((emissivity == e) & (scene.temperature == t)) for e, t in ((0.1, 400), (0.2, 310))] == [36, 36]


def test_temperature_attribute_made_by_geometry_nodes():
    def build(nodes, links):
        cube, store = nodes.new("GeometryNodeMeshCube"), nodes.new("GeometryNodeStoreNamedAttribute")
        store.data_type, store.domain = "FLOAT", "FACE"
        store.inputs["Name"].default_value = "temperature"
        store.inputs["Value"].default_value = 333.0
        links.new(cube.outputs["Mesh"], store.inputs["Geometry"])
        return store.outputs["Geometry"]

    geometry_nodes(link("Host", cube_mesh(), temperature=310.0), build)
    np.testing.assert_array_equal(read()[0].temperature, 333.0)


def test_particle_instances():
    part = link("Part", cube_mesh(), temperature=400.0)
    part.location.z = 50.0
    host = link("Host", cube_mesh(), temperature=300.0)
    bpy.context.view_layer.objects.active = host
    host.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = host.particle_systems[0].settings
    settings.type, settings.count = "HAIR", 5
    settings.render_type, settings.instance_object = "OBJECT", part
    host.show_instancer_for_render = False
    scene, _ = read()
    assert len(scene.triangles) == 12 + 5 * 12
    assert np.all(scene.temperature == 400.0)


@pytest.mark.parametrize("kind", ["text", "curve", "surface", "metaball"])
def test_curves_texts_surfaces_and_metaballs_become_surfaces(kind):
    if kind == "text":
        data = bpy.data.curves.new("Text", "FONT")
        data.body, data.extrude = "K", 0.1
    elif kind == "curve":
        data = bpy.data.curves.new("Curve", "CURVE")
        data.dimensions, data.bevel_depth = "3D", 0.1
        spline = data.splines.new("POLY")
        spline.points.add(1)
        spline.points[1].co = (1, 0, 0, 1)
    elif kind == "metaball":
        data = bpy.data.metaballs.new("Ball")
        data.elements.new()
    if kind == "surface":
        bpy.ops.surface.primitive_nurbs_surface_sphere_add()
        obj = bpy.context.object
        obj["temperature"] = 321.0
    else:
        obj = link("Shape", data, temperature=321.0)
    obj.location.z = -3.0
    obj.data.materials.append(material("Paint", emissivity=0.7))
    scene, warnings = read()
    assert len(scene.triangles) > 10 and not warnings
    assert np.all(scene.temperature == 321.0) and scene.materials[scene.material[0]].emissivity == 0.7
    assert scene.vertices[:, 2].mean() == pytest.approx(-3.0, abs=0.3)


def test_instances_of_one_mesh_are_read_once(monkeypatch):
    calls = []
    real = surfaces.read_mesh
    monkeypatch.setattr(surfaces, "read_mesh", lambda *args: calls.append(args) or real(*args))
    mesh = cube_mesh()
    for i in range(4):
        link(f"Cube {i}", mesh, temperature=300.0 + i)
    scene, _ = read()
    assert len(calls) == 1
    assert sorted(set(scene.temperature)) == [300, 301, 302, 303]


# Temperature ----------------------------------------------------------------------------------------------------------


def test_temperature_from_property_and_ambient_with_one_warning():
    bpy.context.scene.infrared.ambient_temperature = 280.0
    link("Warm", cube_mesh(), temperature=310)  # an integer is a number too
    for i in range(7):
        link(f"Bare {i}", cube_mesh())
    scene, warnings = read()
    values, counts = np.unique(scene.temperature, return_counts=True)
    assert values.tolist() == [280, 310] and counts.tolist() == [7 * 12, 12]
    (warning,) = [w for w in warnings if "temperature" in w]
    assert "'Bare 0'" in warning and "and 2 more" in warning and "280 K" in warning and "Warm" not in warning


@pytest.mark.parametrize("domain", ["POINT", "CORNER", "FACE"])
def test_temperature_attribute_wins_and_varies(domain):
    mesh = strip_mesh()
    attribute = mesh.attributes.new("temperature", "FLOAT", domain)
    values = np.arange(len(attribute.data), dtype=np.float32) + 300
    attribute.data.foreach_set("value", values)
    link("Strip", mesh, temperature=1000.0)
    link("Cube", cube_mesh(), temperature=250.0)
    scene, warnings = read()
    assert not [w for w in warnings if "temperature" in w]
    found = np.broadcast_to(scene.temperature.reshape(16, -1), (16, 3))
    strip = found[found[:, 0] != 250.0]
    assert np.all(found[-12:] == 250) or np.all(found[:12] == 250)
    if domain == "FACE":
        np.testing.assert_array_equal(strip, np.repeat([300, 301, 302, 302], 3).reshape(-1, 3))
    elif domain == "POINT":
        triangles = scene.triangles[found[:, 0] != 250.0]
        np.testing.assert_array_equal(strip, triangles - triangles.min() + 300)
    else:
        np.testing.assert_array_equal(strip[:2], [[300, 301, 302], [303, 304, 305]])
        assert sorted(set(strip[2:].ravel())) == [306, 307, 308, 309]


@pytest.mark.parametrize("kind, domain", [("INT", "POINT"), ("FLOAT_VECTOR", "POINT"), ("FLOAT", "EDGE")])
def test_unusable_temperature_attribute_falls_back_with_a_warning(kind, domain):
    mesh = cube_mesh()
    mesh.attributes.new("temperature", kind, domain)
    link("Odd one", mesh, temperature=299.0)
    scene, warnings = read()
    assert np.all(scene.temperature == 299.0)
    assert any("'Odd one'" in w and "attribute 'temperature'" in w for w in warnings)


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_impossible_object_temperature(value):
    link("Radiator", cube_mesh(), temperature=value)
    with pytest.raises(SceneError, match=f"Object 'Radiator'.*{value:g}"):
        read()


@pytest.mark.parametrize("value", ["hot", [300.0, 301.0], {"kelvin": 300}, True])
def test_temperature_of_a_wrong_type(value):
    link("Radiator", cube_mesh(), temperature=value)
    with pytest.raises(SceneError, match="Object 'Radiator': temperature is .*expected a number"):
        read()


@pytest.mark.parametrize("domain", ["POINT", "CORNER", "FACE"])
@pytest.mark.parametrize("value", [-3.0, float("nan")])
def test_impossible_attribute_temperature(domain, value):
    mesh = cube_mesh()
    attribute = mesh.attributes.new("temperature", "FLOAT", domain)
    attribute.data.foreach_set("value", np.full(len(attribute.data), 300.0, np.float32))
    attribute.data[3].value = value
    link("Radiator", mesh)
    with pytest.raises(SceneError, match=f"'Radiator'.*{value:g}"):
        read()


@pytest.mark.parametrize("value", [-2.0, float("nan")])
def test_impossible_ambient_world_and_light_temperatures(value):
    link("Cube", cube_mesh(), temperature=300.0)
    bpy.context.scene.infrared.ambient_temperature = value
    with pytest.raises(SceneError, match=f"Panel 'Where Nothing Is Set': temperature {value:g} K"):
        read()
    bpy.context.scene.infrared.ambient_temperature = 300.0
    world = bpy.context.scene.world = bpy.data.worlds.new("Night")
    world["temperature"] = value
    with pytest.raises(SceneError, match=f"World 'Night'.*{value:g}"):
        read()
    world["temperature"] = 200.0
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"), temperature=value)
    with pytest.raises(SceneError, match=f"Light 'Lamp'.*{value:g}"):
        read()


def test_world_temperature_and_its_absence():
    link("Cube", cube_mesh(), temperature=300.0)
    assert read()[0].world_temperature == 0.0
    bpy.context.scene.world = bpy.data.worlds.new("Sky")
    assert read()[0].world_temperature == 0.0
    bpy.context.scene.world["temperature"] = 250.0
    assert read()[0].world_temperature == 250.0


def test_a_view_layers_own_world_counts_in_it():
    """As it is at the frame, in the surroundings, in its group and in what adaptive bands count on."""
    scene = bpy.context.scene
    link("Cube", cube_mesh(), temperature=300.0)
    sky, night = (bpy.data.worlds.new(name) for name in ("Sky", "Night"))
    scene.world, sky["temperature"], sky["temperature_group"] = sky, 250.0, "sky"
    night["temperature"], night["temperature_group"] = 0.0, "night"
    night.driver_add('["temperature"]').driver.expression = "frame + 100"
    scene.view_layers.new("Other").world_override = night
    scene.frame_set(51)
    scene.infrared.group_exr_path = "//groups"
    assert read()[0].world_temperature == 250.0 and read()[0].groups == ("sky",)
    other = read("Other")[0]
    assert other.world_temperature == pytest.approx(151.0) and other.groups == ("night",)
    night.driver_remove('["temperature"]')
    night["temperature"] = 3000.0
    assert read_group_temperatures(scene) == {"sky": 250.0, "night": 3000.0}
    assert read_group_temperatures(scene, scene.view_layers["Other"]) == {"night": 3000.0}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bands, "_choose_bands", lambda *spectra, **_: spectra)
        assert read_adaptive_bands(scene.infrared)[3] == (250.0, 300.0, 3000.0)
    night["temperature"] = -1.0
    with pytest.raises(SceneError, match="World 'Night': temperature -1 K"):
        read("Other")
    assert "World 'Night'" in str(scene_checks(scene, scene.view_layers["Other"]))
    assert "World 'Night'" not in str(scene_checks(scene, scene.view_layers["ViewLayer"]))


def test_keyframes_and_drivers_on_custom_properties():
    obj = link("Cube", cube_mesh(), temperature=300.0)
    obj.keyframe_insert('["temperature"]', frame=1)
    obj["temperature"] = 400.0
    obj.keyframe_insert('["temperature"]', frame=101)
    paint = material("Paint", emissivity=0.5)
    obj.data.materials.append(paint)
    paint.driver_add('["emissivity"]').driver.expression = "frame / 1000"
    scene = bpy.context.scene
    scene.infrared.driver_add("wavelength_min").driver.expression = "frame / 10"
    world = scene.world = bpy.data.worlds.new("Sky")
    world["temperature"] = 0.0
    world.driver_add('["temperature"]').driver.expression = "frame + 100"
    scene.frame_set(51)
    result, _ = read()
    assert np.all(np.abs(result.temperature - 350.0) < 0.1)
    assert result.materials[0].emissivity == pytest.approx(0.051)
    assert result.band_edges[0] == pytest.approx(5.1)
    assert result.world_temperature == pytest.approx(151.0)


# Materials ------------------------------------------------------------------------------------------------------------


def test_material_slots_of_mesh_and_object():
    mesh = cube_mesh()
    mesh.materials.append(material("Mesh A", emissivity=0.1, specular=0.25, roughness=0.5))
    mesh.materials.append(material("Mesh B", emissivity=0.2))
    for polygon in mesh.polygons:
        polygon.material_index = int(polygon.index >= 2)
    link("First", mesh, temperature=300.0)
    second = link("Second", mesh, temperature=301.0)
    second.material_slots[1].link = "OBJECT"
    second.material_slots[1].material = material("Object's own", emissivity=0.3)
    scene, _ = read()
    found = {(float(t), scene.materials[m].name) for t, m in zip(scene.temperature, scene.material, strict=True)}
    assert found == {(300, "Mesh A"), (300, "Mesh B"), (301, "Mesh A"), (301, "Object's own")}
    assert np.bincount(scene.material).sum() == 24 and len(scene.materials) == 3
    first = next(m for m in scene.materials if m.name == "Mesh A")
    assert (first.specular, first.roughness) == (0.25, 0.5)


def test_material_index_beyond_the_last_slot_takes_the_last():
    mesh = cube_mesh()
    mesh.materials.append(material("Only", emissivity=0.1))
    mesh.polygons[0].material_index = 7
    link("Cube", mesh, temperature=300.0)
    scene, _ = read()
    assert [m.name for m in scene.materials] == ["Only"]


def test_faces_without_a_material_take_the_default_with_a_warning():
    bpy.context.scene.infrared.default_emissivity = 0.75
    link("Bare", cube_mesh(), temperature=300.0)
    mesh = cube_mesh()
    mesh.materials.append(material("No emissivity"))
    mesh.materials.append(None)
    link("Painted", mesh, temperature=300.0)
    scene, warnings = read()
    assert [m.emissivity for m in scene.materials] == pytest.approx([0.75, 0.75])
    (warning,) = [w for w in warnings if "material" in w]
    assert "'Bare'" in warning and "0.75" in warning and "Painted" not in warning


def test_view_layer_material_override():
    mesh = cube_mesh()
    mesh.materials.append(material("Paint", emissivity=0.1))
    link("Cube", mesh, temperature=300.0)
    bpy.context.view_layer.material_override = material("Override", emissivity=0.6)
    assert [m.name for m in read()[0].materials] == ["Override"]


@pytest.mark.parametrize(
    "value, expected",
    [(0.5, 0.5), (1, 1.0), ([8.0, 0.9, 14.0, 0.7], [[8, 0.9], [14, 0.7]]), ([8, 1, 14, 0], [[8, 1], [14, 0]])],
)
def test_emissivity_number_and_list(value, expected):
    mesh = cube_mesh()
    mesh.materials.append(material("Paint", emissivity=value))
    link("Cube", mesh, temperature=300.0)
    np.testing.assert_allclose(read()[0].materials[0].emissivity, expected)


@pytest.mark.parametrize(
    "value, message",
    [
        (1.5, "1.5 is outside 0..1"),
        (-0.1, "-0.1 is outside"),
        (float("nan"), "nan is outside"),
        ([8.0, 0.9, 14.0], "3 numbers, expected pairs"),
        ([], "0 numbers, expected pairs"),
        ([8.0, 0.9, 7.0, 0.9], "must increase"),
        ([8.0, 1.9], "1.9 is outside"),
        ([-8.0, 0.9], "finite and above 0"),
        ([True, False], "expected a number"),
        (["a", "b"], "expected a number"),
        ([[8.0, 0.9], [9.0, 0.9]], "expected a number"),
        ({"um": 1.0}, "expected a number"),
        (True, "expected a number"),
    ],
)
def test_impossible_emissivity(value, message):
    mesh = cube_mesh()
    mesh.materials.append(material("Paint", emissivity=value))
    link("Cube", mesh, temperature=300.0)
    with pytest.raises(SceneError, match="Material 'Paint'.*") as error:
        read()
    assert message in str(error.value)


@pytest.mark.parametrize("key", ["specular", "roughness"])
@pytest.mark.parametrize("value", [1.5, -0.5, float("nan"), "shiny", [0.5, 0.5]])
def test_impossible_specular_and_roughness(key, value):
    mesh = cube_mesh()
    mesh.materials.append(material("Paint", **{key: value}))
    link("Cube", mesh, temperature=300.0)
    with pytest.raises(SceneError, match=f"Material 'Paint': {key}"):
        read()


def test_impossible_default_emissivity():
    bpy.context.scene.infrared.default_emissivity = 1.25
    link("Cube", cube_mesh(), temperature=300.0)
    with pytest.raises(SceneError, match="'Where Nothing Is Set': emissivity 1.25"):
        read()


def test_library_emissivity_and_unknown_names():
    name = library.names()[0]
    mesh = cube_mesh()
    paint = material("Paint", emissivity=name)
    mesh.materials.append(paint)
    link("Cube", mesh, temperature=300.0)
    np.testing.assert_array_equal(read()[0].materials[0].emissivity, library.find(name))
    paint["emissivity"] = name + "x"
    with pytest.raises(SceneError, match=f"Material 'Paint'.*'{name}x'.*close names:.*'{name}'"):
        read()


# Lights ---------------------------------------------------------------------------------------------------------------


def light(kind, name="Lamp", matrix=None, temperature=None, **properties):
    data = bpy.data.lights.new(name, kind)
    for key, value in properties.items():
        setattr(data, key, value)
    obj = link(name, data)
    if matrix is not None:
        obj.matrix_world = matrix
    if temperature is not None:
        obj["temperature"] = temperature
    link("Cube", cube_mesh(), temperature=300.0)
    return obj


def read_light():
    (result,) = read()[0].lights
    return result


def test_point_light():
    light("POINT", matrix=Matrix.Translation((1, 2, 3)) @ Matrix.Scale(3, 4), energy=40.0, shadow_soft_size=0.25)
    result = read_light()
    assert isinstance(result, PointLight) and result.name == "Lamp"
    np.testing.assert_allclose(result.position, (1, 2, 3))
    assert (result.power, result.radius, result.temperature) == (40.0, 0.25, 2856.0)


@pytest.mark.parametrize(("system", "unit"), [("METRIC", 0.001), ("IMPERIAL", 0.001), ("NONE", 1.0)])
def test_power_counts_in_units_of_the_scene(system, unit):
    """1 W at 1 m brings 1 / (4 pi) W m-2, whether the metre is one unit or a thousand; irradiances stay."""
    lamp = light("POINT", energy=40.0).data
    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = system, 0.001
    assert read_light().power == pytest.approx(40.0 / unit**2)
    lamp.type = "SUN"
    assert read_light().irradiance == pytest.approx(bpy.data.lights["Lamp"].energy)


def test_spot_light():
    turn = Matrix.Rotation(np.pi / 2, 4, "X")  # local -Z becomes +Y
    light("SPOT", matrix=turn @ Matrix.Scale(2, 4), temperature=3000.0, energy=5.0, spot_size=0.8, spot_blend=0.2)
    result = read_light()
    assert isinstance(result, SpotLight)
    np.testing.assert_allclose(result.direction, (0, 1, 0), atol=1e-6)
    assert (result.power, result.temperature) == (5.0, 3000.0)
    assert (result.cone_angle, result.blend) == pytest.approx((0.8, 0.2))


def angle_of(light, cosine_share):
    """The angle (rad) to its axis at which a spot has faded over this share of its rim, from outside."""
    edge = np.cos(0.5 * light.cone_angle)
    return np.arccos(edge + (1.0 - edge) * light.blend * cosine_share)


@pytest.mark.parametrize("scale", [(1, 1, 3), (2, 2, 1), (0.2, 0.2, 0.5), (-1, 1, 2), (1, 1, -0.5), (3, -3, 3)])
def test_the_beam_of_a_spot_follows_its_scale(scale):
    """As in Cycles: where it fades is said in the space of the light (spot_light_to_local in its kernel/light/spot.h).
    Blender's matrices and angles are rounded to 1e-7."""
    matrix = Matrix.Rotation(0.7, 4, "X") @ Matrix.Diagonal((*scale, 1.0))
    light("SPOT", matrix=matrix, energy=5.0, spot_size=1.2, spot_blend=0.3)
    result = read_light()
    own = SpotLight(np.zeros(3), np.zeros(3), 1.0, 1.2, 0.3)
    for share in (0.0, 1.0):  # both edges of the rim
        angle = angle_of(result, share)
        way = np.cos(angle) * result.direction + np.sin(angle) * np.array((1.0, 0.0, 0.0))
        local = np.linalg.inv(np.array(matrix)[:3, :3]) @ way
        assert np.arctan2(np.hypot(local[0], local[1]), -local[2]) == pytest.approx(angle_of(own, share), abs=1e-5)
    assert result.power == 5.0


def test_an_uneven_beam_of_a_spot_is_named_and_of_the_mean_width():
    """It lights as large an area as the ellipse would."""
    obj = light("SPOT", matrix=Matrix.Diagonal((2, 0.5, 1, 1)), energy=5.0, spot_size=0.8)
    scene, warnings = read()
    assert scene.lights[0].cone_angle == pytest.approx(0.8)
    expected = "its scale would make the spot's beam elliptical or oblique; it is even and of the mean width"
    assert f"'Lamp': {expected}" in warnings
    bpy.context.view_layer.update()
    found = scene_checks(bpy.context.scene, bpy.context.view_layer)
    assert f"Light 'Lamp': {expected}" in [check.text for check in found]
    obj.matrix_world = Matrix.Rotation(0.7, 4, (1.0, 2.0, 3.0)) @ Matrix.Scale(3.0, 4)
    assert not any("beam" in warning for warning in read()[1])
    oblique = np.array([[1.0, 0.0, 0.5, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    assert uneven_beam(obj.data, oblique) == expected


def test_a_beam_without_width_is_refused():
    light("SPOT", matrix=Matrix.Diagonal((0, 1, 1, 1)), energy=5.0)
    with pytest.raises(SceneError, match="Light 'Lamp': its scale across its beam is 0"):
        read()


def test_sun_light():
    turn = Matrix.Rotation(-np.pi / 2, 4, "Y")  # local -Z becomes +X
    light("SUN", matrix=turn, energy=1361.0, angle=0.01)
    result = read_light()
    assert isinstance(result, SunLight)
    np.testing.assert_allclose(result.direction, (1, 0, 0), atol=1e-6)
    assert (result.irradiance, result.temperature) == (1361.0, 5772.0)
    assert result.angle == pytest.approx(0.01)


@pytest.mark.parametrize(
    "shape, half_y, ellipse",
    [("SQUARE", 1.0, False), ("RECTANGLE", 0.25, False), ("DISK", 1.0, True), ("ELLIPSE", 0.25, True)],
)
@pytest.mark.parametrize("mirrored", [False, True])
def test_area_light(shape, half_y, ellipse, mirrored):
    scale = Matrix.Diagonal((-3.0 if mirrored else 3.0, 2.0, 1.0, 1.0))
    light("AREA", matrix=Matrix.Translation((0, 0, 4)) @ scale, energy=9.0, shape=shape, size=2.0, size_y=0.5)
    result = read_light()
    assert isinstance(result, AreaLight) and result.ellipse == ellipse and result.power == 9.0
    assert np.linalg.norm(result.axis_u) == pytest.approx(3.0)
    assert np.linalg.norm(result.axis_v) == pytest.approx(2.0 * half_y)
    towards = np.cross(result.axis_v, result.axis_u)
    np.testing.assert_allclose(towards / np.linalg.norm(towards), (0, 0, -1), atol=1e-6)


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA", "SUN"])
def test_exposure_doubles_what_a_light_sends(kind):
    light(kind, energy=40.0, exposure=3.0)
    result = read_light()
    assert (result.irradiance if kind == "SUN" else result.power) == 320.0


@pytest.mark.parametrize("unit", [1.0, 0.001])
@pytest.mark.parametrize(
    ("kind", "settings", "factor"),
    [
        ("POINT", {"shadow_soft_size": 0.5}, np.pi),  # 4 pi r^2
        ("POINT", {"shadow_soft_size": 0.0}, None),
        ("SPOT", {"shadow_soft_size": 0.5}, np.pi),
        ("AREA", {"shape": "RECTANGLE", "size": 0.5, "size_y": 3.0}, 1.5),
        ("AREA", {"shape": "ELLIPSE", "size": 0.5, "size_y": 3.0}, 1.5 * np.pi / 4.0),
        ("SUN", {"angle": 0.2}, np.pi * np.sin(0.1) ** 2),
        ("SUN", {"angle": 0.0}, None),
    ],
)
def test_a_light_that_is_not_normalized_has_its_energy_by_its_size(kind, settings, factor, unit):
    """Whatever the unit, as its radiance is given; what has no size (None) counts as normalized, as in Cycles."""
    light(kind, energy=40.0, normalize=False, **settings)
    units = bpy.context.scene.unit_settings
    units.system, units.scale_length = "METRIC", unit
    result = read_light()
    if kind == "SUN":
        assert result.irradiance == pytest.approx(40.0 * (factor or 1.0))
    else:
        assert result.power == pytest.approx(40.0 * factor if factor else 40.0 / np.float32(unit) ** 2)


@pytest.mark.parametrize(("given", "read_as"), [(np.pi, np.pi), (1.0, 1.0), (0.0, np.pi / 180.0)])
def test_spread_of_an_area_light(given, read_as):
    light("AREA", spread=given)
    assert read_light().spread == pytest.approx(read_as, rel=1e-7)
    assert read_light().spread <= np.pi


def test_square_spot():
    turn = Matrix.Rotation(np.pi / 2, 4, "X") @ Matrix.Rotation(0.3, 4, "Z") @ Matrix.Scale(2, 4)
    light("SPOT", matrix=turn, use_square=True)
    np.testing.assert_allclose(read_light().square, np.array(turn)[:3, 0] / 2.0, atol=1e-6)
    bpy.data.lights["Lamp"].use_square = False
    assert read_light().square is None


def test_a_light_without_a_direction_may_have_no_scale():
    lamp = light("POINT", matrix=Matrix.Translation((1, 2, 3)) @ Matrix.Diagonal((0.0, 0.0, 0.0, 1.0)), energy=40.0)
    np.testing.assert_allclose(read_light().position, (1, 2, 3))
    lamp.data.type = "SPOT"
    with pytest.raises(SceneError, match="Light 'Lamp': its scale is 0, so it points nowhere"):
        read()


def test_dark_light_is_dropped_and_negative_energy_refused():
    obj = light("POINT", energy=0.0)
    assert read()[0].lights == ()
    obj.data.energy = -3.0
    with pytest.raises(SceneError, match="Light 'Lamp'.*-3"):
        read()


def test_instanced_lights_shine_too():
    collection = bpy.data.collections.new("Lamps")
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"), collection)
    link("Cube", cube_mesh(), temperature=300.0)
    empty = link("Instance")
    empty.instance_type, empty.instance_collection = "COLLECTION", collection
    empty.location.y = 4.0
    np.testing.assert_allclose(read_light().position, (0, 4, 0))


# Refused scenes and warnings ------------------------------------------------------------------------------------------


def test_empty_scene_and_scene_without_faces():
    with pytest.raises(SceneError, match="View layer 'ViewLayer' has nothing to render"):
        read()
    mesh = bpy.data.meshes.new("Wire")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0)], [(0, 1)], [])
    link("Wire", mesh, temperature=300.0)
    link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    with pytest.raises(SceneError, match="no visible object has faces"):
        read()


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_non_finite_vertex_names_the_object(value):
    mesh = cube_mesh()
    positions = np.array([v.co for v in mesh.vertices], dtype=np.float32)
    positions[3, 1] = value
    mesh.attributes["position"].data.foreach_set("vector", positions.ravel())
    link("Broken", mesh, temperature=300.0)
    with pytest.raises(SceneError, match="Object 'Broken': vertex 3 is not finite"):
        read()


def test_objects_that_hold_nothing_are_no_trouble():
    link("Cube", cube_mesh(), temperature=300.0)
    link("Fur", bpy.data.hair_curves.new("Fur"))
    link("Smoke", bpy.data.volumes.new("Smoke"))
    link("Dust", bpy.data.pointclouds.new("Dust"))
    _, warnings = read()
    assert not any("'Fur'" in warning or "'Dust'" in warning for warning in warnings)
    assert any("'Smoke'" in w and "the volume is left out" in w for w in warnings)  # it has no grids


@pytest.mark.parametrize(
    "text, message",
    [
        ("3, five, 8", "'five' is not a number"),
        ("", "'' is not a number"),
        ("3", "at least two"),
        ("3, 5, 4", "ascend"),
        ("3, 3", "ascend"),
        ("0, 3", "above 0"),
        ("3, nan", "finite"),
        ("3, inf", "finite"),
        ("3,,5", "'' is not a number"),
    ],
)
def test_bad_band_edges(text, message):
    link("Cube", cube_mesh(), temperature=300.0)
    infrared = bpy.context.scene.infrared
    infrared.band_mode, infrared.band_edges = "CUSTOM", text
    with pytest.raises(SceneError) as error:
        read()
    assert message in str(error.value)


def test_bands():
    link("Cube", cube_mesh(), temperature=300.0)
    infrared = bpy.context.scene.infrared
    np.testing.assert_allclose(read()[0].band_edges, np.linspace(7.5, 14.0, 17))
    infrared.band_mode, infrared.band_edges = "CUSTOM", " 3, 5,8.25 "
    np.testing.assert_array_equal(read()[0].band_edges, [3, 5, 8.25])
    infrared.band_mode, infrared.wavelength_min, infrared.wavelength_max = "UNIFORM", 0.9, 1.7
    infrared.band_count = 8
    np.testing.assert_array_equal(read()[0].band_edges, np.linspace(0.9, 1.7, 9))  # not of 0.9 as a float32
    assert read_band_range(infrared) == (0.9, 1.7)
    infrared.wavelength_min = 20.0
    with pytest.raises(SceneError, match="ascend"):
        read()


def test_settings_defaults_are_the_solvers():
    infrared = bpy.context.scene.infrared
    assert read_settings(infrared) == Settings()
    infrared.passes = 0
    with pytest.raises(SceneError) as error:
        read_settings(infrared)
    expected = "Panel 'Photons': Nothing stops this render: set Passes, Time Limit or Target Noise (K)"
    assert str(error.value) == expected


@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
def test_constant_attribute_is_seen_as_it_is(domain):
    """Rounding while it is interpolated must not take a pixel below the coldest temperature there is, to 0 K."""
    mesh = cube_mesh()
    attribute = mesh.attributes.new("temperature", "FLOAT", domain)
    attribute.data.foreach_set("value", np.full(len(attribute.data), 293.15, np.float32))
    mesh.materials.append(material(emissivity=1.0))
    link("Wall", mesh)
    bpy.context.scene.world = bpy.data.worlds.new("Hall")
    bpy.context.scene.world["temperature"] = 293.15
    film = render(read()[0], Settings(passes=4, photons_per_pass=1000))
    np.testing.assert_allclose(film.temperature(), 293.15, rtol=1e-6)
    assert film.photons == 0  # walls and surroundings at one temperature


def test_objects_in_edit_mode_are_read():
    obj = link("Cube", cube_mesh(), temperature=310.0)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    scene, _ = read()
    bpy.ops.object.mode_set(mode="OBJECT")
    assert len(scene.triangles) == 12
