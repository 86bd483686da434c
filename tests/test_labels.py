# SPDX-License-Identifier: GPL-3.0-or-later
"""Labels in COCO's format, read back by COCO's own library."""

import json
import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from pycocotools import mask as coco_mask  # noqa: E402
from pycocotools.coco import COCO  # noqa: E402

from addon.output.coco import box_of, run_lengths  # noqa: E402
from addon.rendering.last_render import finished_layers  # noqa: E402
from addon.rendering.render_passes import LAYER_SWITCHES  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material  # noqa: E402

pytestmark = [
    pytest.mark.usefixtures("reset_blender"),
    pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning"),  # by COCO's library
]
KINDS = ("person", "car", "tree")


@pytest.mark.parametrize("shape", [(1, 1), (5, 7), (40, 30)])
def test_run_lengths_are_cocos(shape):
    for share in (0.0, 0.2, 0.9, 1.0):
        mask = np.random.default_rng(3).random(shape) < share
        pixels = np.flatnonzero(mask.ravel(order="F"))
        lengths = {"size": list(shape), "counts": run_lengths(pixels, mask.size)}
        np.testing.assert_array_equal(coco_mask.decode(coco_mask.frPyObjects(lengths, *shape)), mask)
        if mask.any():
            encoded = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
            assert box_of(pixels, shape[0]) == coco_mask.toBbox(encoded).tolist()


def scene_of(count, width=120, height=90):
    """Cubes of three categories at random places before a camera, each with its own object index; every fourth is of
    none. One category is that of a collection."""
    rng, mesh = np.random.default_rng(7), cube_mesh("Thing")
    mesh.materials.append(material("Paint", emissivity=0.9))
    forest = bpy.data.collections.new("Forest")
    bpy.context.scene.collection.children.link(forest)
    forest["category"] = "tree"
    things = []
    for i in range(count):
        kind = ("", *KINDS)[i % 4]
        thing = link(f"Thing {i}", mesh, forest if kind == "tree" else None, temperature=280.0 + 0.25 * i)
        if kind and kind != "tree":
            thing["category"] = kind
        thing.location, thing.rotation_euler = rng.uniform((-6, -4.5, -8), (6, 4.5, -2)), rng.uniform(0, 3, 3)
        thing.scale = rng.uniform(0.3, 1.0, 3)
        thing.pass_index = i + 1
        things.append((thing, kind))
    camera((0.0, 0.0, 5.0), width, height)
    scene = bpy.context.scene
    scene.render.engine, scene.world = "INFRARED_PHOTONS", bpy.data.worlds.new("Sky")
    scene.world["temperature"] = 270.0
    scene.view_layers[0].use_pass_object_index = True
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 1, 500, 1, 1
    return things


def labels(path):
    bpy.context.scene.infrared.label_path = str(path)
    bpy.ops.render.render()
    images = finished_layers["ViewLayer"]
    index = images["further"][LAYER_SWITCHES["object_index"][1].name].image
    return COCO(str(path)), index[::-1], images["temperature"][::-1]


def test_labels_of_200_objects(tmp_path):
    """Masks are those of the object index, pixel by pixel; what has no category has none; boxes and temperatures are
    those of the masks."""
    things = scene_of(200)
    coco, index, temperature = labels(tmp_path / "labels.json")
    assert {each["name"]: each["id"] for each in coco.loadCats(coco.getCatIds())} == {"car": 1, "person": 2, "tree": 3}
    found = coco.loadAnns(coco.getAnnIds())
    seen = {int(i) for i in np.unique(index[index > 0])}
    assert {each["name"] for each in found} == {
        thing.name for thing, kind in things if kind and thing.pass_index in seen
    }
    assert len(found) > 40  # of 150; others hide the rest
    kinds = {thing.name: (thing.pass_index, kind) for thing, kind in things}
    for each in found:
        number, kind = kinds[each["name"]]
        mask = index == number
        np.testing.assert_array_equal(coco.annToMask(each), mask)
        assert coco.loadCats(each["category_id"])[0]["name"] == kind
        encoded = coco_mask.encode(np.asfortranarray(mask.astype(np.uint8)))
        assert each["area"] == mask.sum() and each["bbox"] == coco_mask.toBbox(encoded).tolist()
        assert each["temperature"]["maximum"] == temperature[mask].max()
        assert each["temperature"]["mean"] == pytest.approx(temperature[mask].mean(), rel=1e-6)


def test_boxes_of_what_is_hidden(tmp_path):
    """An instance alone, all of which is seen, fills its box to a pixel; the box stays when another stands before."""
    things = scene_of(24)
    coco, _, _ = labels(tmp_path / "all.json")
    boxes = {each["name"]: each["amodal_bbox"] for each in coco.loadAnns(coco.getAnnIds())}
    inside = (name for name, (x, y, w, h) in boxes.items() if min(x, y) > 1 and x + w < 119 and y + h < 89)
    chosen = bpy.data.objects[next(inside)]
    amodal = boxes[chosen.name]
    for thing, _ in things:
        thing.hide_render = thing is not chosen
    alone = labels(tmp_path / "alone.json")[0].loadAnns([1])[0]
    assert alone["amodal_bbox"] == amodal
    x, y, width, height = alone["bbox"]
    assert amodal[0] == pytest.approx(x, abs=1.0) and amodal[1] == pytest.approx(y, abs=1.0)
    assert amodal[2] == pytest.approx(width, abs=2.0) and amodal[3] == pytest.approx(height, abs=2.0)


def test_the_camera_projects_as_it_says(tmp_path):
    """A point by the matrices of the file lies where Blender says; also in a border."""
    from bpy_extras.object_utils import world_to_camera_view

    scene_of(4)
    scene, point = bpy.context.scene, np.array((0.7, -0.4, -3.0))
    scene.camera.rotation_euler, scene.camera.data.shift_x = (0.1, -0.05, 0.3), 0.1
    render = scene.render
    for border in (False, True):
        render.use_border = render.use_crop_to_border = border
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.8, 0.3, 0.9
        coco, _, _ = labels(tmp_path / f"{border}.json")
        facts = coco.loadImgs(1)[0]["camera"]
        pose = np.array(facts["camera_to_world"])
        x, y, z = (point - pose[:3, 3]) @ pose[:3, :3]
        u, v, w = np.array(facts["intrinsics"]) @ (x, -y, -z)
        expected = world_to_camera_view(scene, scene.camera, __import__("mathutils").Vector(point))
        left, top = (30, 90 - 81) if border else (0, 0)
        assert u / w == pytest.approx(expected.x * 120 - left, abs=2e-3)
        assert v / w == pytest.approx((1 - expected.y) * 90 - top, abs=2e-3)


def test_instances_are_told_apart(tmp_path):
    """Two instances of a collection are two of its category."""
    scene_of(0)
    source = bpy.data.collections.new("Car")
    body = link("Body", cube_mesh("Body"), source, temperature=320.0)
    body["category"] = "car"
    for i, x in enumerate((-1.5, 1.5)):
        holder = link(f"Holder {i}")
        holder.instance_type, holder.instance_collection, holder.location = "COLLECTION", source, (x, 0.0, 0.0)
    found = labels(tmp_path / "labels.json")[0]
    assert len(found.getAnnIds()) == 2
    left, right = (each["bbox"] for each in found.loadAnns(found.getAnnIds()))
    assert abs(left[0] - right[0]) > 20


def test_an_empty_gives_what_it_places_its_category(tmp_path):
    """Unless an object has one of its own; that of a collection counts last. Grass is not of the ground's category."""
    scene_of(0)
    source, fleet = (bpy.data.collections.new(name) for name in ("Model", "Fleet"))
    bpy.context.scene.collection.children.link(fleet)
    for name, y in (("Body", 1.0), ("Driver", -1.0)):
        link(name, cube_mesh(name), source, temperature=320.0).location.y = y
    bpy.data.objects["Driver"]["category"], source["category"], fleet["category"] = "person", "part", "fleet"
    for name, x in (("Plain", -1.5), ("Truck", 1.5)):
        holder = link(name, None, fleet)
        holder.instance_type, holder.instance_collection, holder.location.x = "COLLECTION", source, x
    bpy.data.objects["Truck"]["category"] = "truck"
    ground = link("Ground", cube_mesh("Ground"), temperature=300.0)
    ground["category"], ground.location.z, ground.instance_type = "ground", -3.0, "VERTS"
    link("Grass", cube_mesh("Grass"), temperature=310.0).parent = ground

    def found(name):
        coco = labels(tmp_path / f"{name}.json")[0]
        kinds = {each["id"]: each["name"] for each in coco.loadCats(coco.getCatIds())}
        return {
            (each["name"], kinds[each["category_id"]], each["bbox"][0] > 60) for each in coco.loadAnns(coco.getAnnIds())
        }

    left, right = False, True
    driver, truck = {("Driver", "person", left), ("Driver", "person", right)}, {("Body", "truck", right)}
    assert found("all") == driver | truck | {("Body", "part", left)}
    del source["category"]
    assert found("fleet") == driver | truck | {("Body", "fleet", left)}


def test_blanks_are_no_category(tmp_path):
    """KITTI's text would have a line without a type."""
    things = scene_of(3)
    things[0][0]["category"] = "  "
    found = labels(tmp_path / "labels.json")[0]
    assert [each["name"] for each in found.loadCats(found.getCatIds())] == ["car", "person", "tree"]
    assert "Thing 0" not in {each["name"] for each in found.loadAnns(found.getAnnIds())}


@pytest.mark.parametrize(
    ("formats", "name"),
    [({"TIFF", "CAMERA_TIFF"}, "bands_0001.tif"), ({"BAND_EXR", "TIFF"}, "bands_0001.exr"), (None, "labels_1.exr")],
)
def test_labels_name_a_picture_that_is_written(tmp_path, formats, name):
    scene_of(2)
    if formats:
        infrared = bpy.context.scene.infrared
        infrared.band_exr_path, infrared.file_formats = str(tmp_path / "bands_####"), formats
    assert labels(tmp_path / "labels_1.json")[0].loadImgs(1)[0]["file_name"] == name
    assert not formats or (tmp_path / name).exists()


def test_a_category_that_is_no_name_is_told(tmp_path, caplog):
    things = scene_of(3)
    things[1][0]["category"] = 5
    found = labels(tmp_path / "labels.json")[0]
    assert "'Thing 1': category is 5, expected a name" in caplog.text
    assert "Thing 1" not in {each["name"] for each in found.loadAnns(found.getAnnIds())}


def test_what_is_behind_the_camera_has_no_box(tmp_path):
    """Nor does a wall that reaches behind it break the box of what is before it."""
    scene_of(0)
    wall = link("Wall", cube_mesh("Wall"), temperature=300.0)
    wall["category"], wall.location, wall.scale = "wall", (2.0, 0.0, 5.0), (0.1, 2.0, 20.0)
    path = tmp_path / "labels.json"
    found = labels(path)[0].loadAnns([1])[0]
    x, _, width, _ = found["amodal_bbox"]
    assert math.isfinite(x) and x < found["bbox"][0] + 1 and x + width > 120  # it goes on beside the picture
    assert "NaN" not in path.read_text() and json.loads(path.read_text())["images"][0]["frame"] == 1


def test_a_folder_that_is_missing_is_told_before_the_render(tmp_path):
    scene_of(2)
    with pytest.raises(RuntimeError, match="Cannot write the labels"):
        labels(tmp_path / "no" / "labels.json")
