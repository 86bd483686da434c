# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperature groups in Blender: the custom property, the file of a render, and images recombined from it."""

import re
import sys

import numpy as np
import OpenEXR
import pytest

bpy = pytest.importorskip("bpy")

from addon.output.group_exr import read_group_exr  # noqa: E402
from addon.reading.groups import read_group_temperatures  # noqa: E402
from addon.rendering import final_render, recombine  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from addon.ui.temperatures import temperature_groups  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read, render_to_exr  # noqa: E402


@pytest.fixture
def scene(reset_blender, tmp_path):
    """Two cubes over a grey floor that reflects them, under a sky; one cube and the sky are groups."""
    camera(width=16, height=12)
    bpy.context.scene.world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world["temperature"] = 250.0
    bpy.context.scene.world["temperature_group"] = "sky"
    floor = link("Floor", cube_mesh("Floor"), temperature=290.0)
    floor.scale, floor.location = (8.0, 8.0, 0.1), (0.0, 0.0, -1.0)
    floor.data.materials.append(material(emissivity=0.4))
    engine = link("Engine", cube_mesh("Engine"), temperature=330.0, temperature_group="engine")
    engine.location.x = -0.7
    link("Box", cube_mesh("Box"), temperature=310.0).location.x = 0.7
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 4, 2000, 3, 2
    infrared.group_exr_path = str(tmp_path / "groups")
    return bpy.context.scene


def channel(path, name):
    return OpenEXR.File(str(path), separate_channels=True).channels()[f"{name}.V"].pixels[::-1].copy()


def test_without_a_path_there_are_no_groups(scene):
    scene.infrared.group_exr_path = ""
    assert read()[0].groups == ()


def test_groups_are_read(scene):
    link("Pipe", cube_mesh("Pipe"), temperature=330.0, temperature_group="engine")
    lamp = link("Lamp", bpy.data.lights.new("Lamp", "POINT"), temperature_group="engine")
    lamp.data.energy = 10.0
    solver_scene, warnings = read()
    assert sorted(solver_scene.groups) == ["engine", "sky"]
    assert solver_scene.groups[solver_scene.world_group] == "sky"
    temperatures = solver_scene.temperature[solver_scene.group == solver_scene.groups.index("engine")]
    assert len(temperatures) == 24 and np.all(temperatures == 330.0)
    assert np.count_nonzero(solver_scene.group == -1) == 24
    assert any("'Lamp': temperature groups are for surfaces" in each for each in warnings)
    assert read_group_temperatures(scene) == {"engine": 330.0, "sky": 250.0}


def test_objects_that_no_view_layer_renders_have_no_say(scene):
    """Else Recombine would refuse what the render accepts."""
    hidden = bpy.data.collections.new("Hidden")
    scene.collection.children.link(hidden)
    link("Old engine", cube_mesh("Old engine"), hidden, temperature=400.0, temperature_group="engine")
    with pytest.raises(
        SceneError,
        match=r"Object '(Old engine|Engine)' \((400|330) K\) and Object '(Old engine|Engine)' \((400|330) K\) are in",
    ):
        read_group_temperatures(scene)
    for attribute, place in (("hide_render", hidden), ("exclude", scene.view_layers[0].layer_collection.children[0])):
        setattr(place, attribute, True)
        assert read_group_temperatures(scene) == {"engine": 330.0, "sky": 250.0}
        setattr(place, attribute, False)


def test_recombined_is_the_render_at_these_temperatures(scene, tmp_path):
    """Of what is seen directly exactly; of the floor's mean within 1 %, where three standard errors are below that."""
    own = render_to_exr(tmp_path)["ViewLayer"]
    assert list(final_render.finished_groups) == ["ViewLayer"]
    assert set(read_group_exr(tmp_path / "groups.exr")[0].temperatures) == {"engine", "sky"}
    out = str(tmp_path / "new.exr")
    assert bpy.ops.infrared.recombine(filepath=out) == {"FINISHED"}
    for name in ("Radiance", "Temperature"):
        np.testing.assert_allclose(channel(out, name), own[name], rtol=1e-6)
    bpy.data.objects["Engine"]["temperature"] = 420.0
    scene.world["temperature"] = 280.0
    assert bpy.ops.infrared.recombine(filepath=out, pictures=False) == {"FINISHED"}
    new, fresh = channel(out, "Radiance"), render_to_exr(tmp_path)["ViewLayer"]["Radiance"]
    assert fresh.mean() > 1.1 * own["Radiance"].mean()
    assert new.mean() == pytest.approx(fresh.mean(), rel=0.01)
    engine = np.s_[6, 3:5]
    np.testing.assert_allclose(new[engine], fresh[engine], rtol=0.01)
    shown = bpy.data.images[recombine.PICTURE]
    assert tuple(shown.size) == (16, 12)
    pixels = np.empty((12, 16, 4), np.float32)
    shown.pixels.foreach_get(pixels.ravel())
    assert np.ptp(pixels[..., :3]) > 0.5 and np.all(pixels[..., 3] == 1.0)


def test_an_animation_takes_keyed_temperatures(scene, tmp_path):
    render_to_exr(tmp_path)
    engine = bpy.data.objects["Engine"]
    for frame, kelvin in ((1, 330.0), (3, 430.0)):
        engine["temperature"] = kelvin
        engine.keyframe_insert('["temperature"]', frame=frame)
    scene.frame_start, scene.frame_end = 1, 3
    scene.frame_set(2, subframe=0.25)
    assert bpy.ops.infrared.recombine(filepath=str(tmp_path / "new_##.exr"), source="ANIMATION") == {"FINISHED"}
    assert scene.frame_float == 2.25
    means = [channel(tmp_path / f"new_{frame:02d}.exr", "Radiance").mean() for frame in (1, 2, 3)]
    assert means[0] < means[1] < means[2]
    assert all((tmp_path / f"new_{frame:02d}.png").stat().st_size > 100 for frame in (1, 2, 3))


def test_the_command_writes_a_series(scene, tmp_path, capsys):
    render_to_exr(tmp_path)
    table = tmp_path / "series.csv"
    table.write_text("frame,engine,sky\n10,300,250\n11,400,260\n")
    arguments = [str(tmp_path / "groups.exr"), str(tmp_path / "new####.exr"), "--series", str(table)]
    assert temperature_groups.recombine_by_command([*arguments, "--pictures"]) == 0
    assert "2 images written, the last one to" in capsys.readouterr().out
    written = {f"new00{number}.{ending}" for number in (10, 11) for ending in ("exr", "png")}
    assert {file.name for file in tmp_path.glob("new*")} == written
    table.write_text("frame,engine\n10,300\n11,nan\n")
    (tmp_path / "new0010.exr").unlink()
    assert temperature_groups.recombine_by_command(arguments) == 1
    assert f"'{table}', frame 11: Temperature group 'engine': temperature nan K" in capsys.readouterr().err
    assert not (tmp_path / "new0010.exr").exists()  # nothing is written if anything is wrong
    assert temperature_groups.recombine_by_command([str(tmp_path / "none.exr"), "x.exr"]) == 1
    assert "none.exr" in capsys.readouterr().err


TABLE = b"frame,time,engine,sky\n10,0.0,300,250\n11,0.5,400,260\n"


def read_table(path):
    return list(recombine.moments(bpy.context, "SERIES", str(path), ["engine", "sky"]))


@pytest.mark.parametrize(
    "content, message",
    [
        (None, "No such file"),
        (b"", "needs a line of titles"),
        (b"\x93NUMPY", "codec can't decode byte 0x93"),
        (b"frame,motor\n1,300", "column 'motor', but"),
        (b"frame,engine\n1,300\n2,warm", "Line 3 of the series: engine is 'warm'"),
        (b"frame,engine\n1,300,5", "Line 2 of the series has 3 values"),
        (b"frame,engine\n1,300\n1,300", "a frame twice"),
        (b"frame,engine\n1," + b"9" * 200_000, "field larger than"),
    ],
)
def test_a_table_that_makes_no_sense_is_named(tmp_path, content, message):
    path = tmp_path / "series.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises((SceneError, OSError), match=message) as error:
        read_table(path)
    assert f"'{path}'" in str(error.value)


def test_a_damaged_table_is_read_or_named(tmp_path):
    """With one to three bytes changed, or cut off anywhere."""
    path, rng, refused = tmp_path / "series.csv", np.random.default_rng(4), 0
    for _ in range(500):
        damaged = bytearray(TABLE[: rng.integers(1, len(TABLE))] if rng.random() < 0.2 else TABLE)
        for place in rng.integers(len(damaged), size=rng.integers(1, 4)):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            assert all(isinstance(kelvin, float) for _, row in read_table(path) for kelvin in row.values())
        except (SceneError, OSError) as error:
            assert f"'{path}'" in str(error)
            refused += 1
    assert 100 < refused < 500


def test_a_render_without_groups_says_so(scene, tmp_path):
    del bpy.data.objects["Engine"]["temperature_group"], scene.world["temperature_group"]
    assert read()[0].groups == ()
    render_to_exr(tmp_path)
    assert not (tmp_path / "groups.exr").exists() and not final_render.finished_groups
    with pytest.raises(RuntimeError, match="no render with temperature groups yet"):
        bpy.ops.infrared.recombine(filepath=str(tmp_path / "new.exr"))


def test_groups_are_never_replaced_by_their_images(scene, tmp_path):
    render_to_exr(tmp_path)
    groups = tmp_path / "groups.exr"
    before = groups.read_bytes()
    with pytest.raises(RuntimeError, match=f"'{groups}' is read, and would be replaced"):
        bpy.ops.infrared.recombine(filepath=str(groups))
    assert groups.read_bytes() == before


def test_a_missing_library_is_named(scene, tmp_path, monkeypatch):
    render_to_exr(tmp_path)
    monkeypatch.delitem(sys.modules, "addon.rendering.recombine")
    monkeypatch.setitem(sys.modules, "addon.output.group_exr", None)
    with pytest.raises(RuntimeError, match="A library of the solver is missing"):
        bpy.ops.infrared.recombine(filepath=str(tmp_path / "new.exr"))


@pytest.mark.parametrize("source", ["render", "recombine"])
@pytest.mark.parametrize(
    "change, message",
    [
        (("Box", "temperature_group", "engine"), r"\(3[13]0 K\) and .* are in the temperature group 'engine'"),
        (("Engine", "temperature_group", 3), "'Engine': temperature_group is 3, expected the name of a group"),
        (("Engine", "temperature", float("nan")), "'Engine'.* temperature nan K"),
    ],
)
def test_groups_that_make_no_sense_are_named(scene, tmp_path, change, message, source):
    if source == "recombine":
        render_to_exr(tmp_path)

    name, key, value = change
    bpy.data.objects[name][key] = value
    with pytest.raises(RuntimeError, match=message):
        if source == "render":
            render_to_exr(tmp_path)
        else:
            bpy.ops.infrared.recombine(filepath=str(tmp_path / "new.exr"))


def test_a_temperature_that_varies_is_refused(scene, tmp_path):
    mesh = bpy.data.objects["Engine"].data
    mesh.attributes.new("temperature", "FLOAT", "POINT").data.foreach_set("value", np.linspace(300.0, 310.0, 8))
    with pytest.raises(RuntimeError, match="'Engine': its temperature varies from 300 to 310 K, .* group 'engine'"):
        render_to_exr(tmp_path)


def test_groups_that_were_not_rendered_are_named(scene, tmp_path):
    render_to_exr(tmp_path)
    bpy.data.objects["Box"]["temperature_group"] = "box"
    with pytest.raises(RuntimeError, match="groups.exr', frame 1: .* no temperature group 'box', only 'engine', 'sky'"):
        bpy.ops.infrared.recombine(filepath=str(tmp_path / "new.exr"))


def test_view_layers_have_files_of_their_own(scene, tmp_path):
    scene.view_layers.new("Second")
    render_to_exr(tmp_path)
    assert {file.name for file in tmp_path.glob("groups*")} == {"groups_ViewLayer.exr", "groups_Second.exr"}
    assert bpy.ops.infrared.recombine(filepath=str(tmp_path / "new.exr"), pictures=False) == {"FINISHED"}
    assert {file.name for file in tmp_path.glob("new*")} == {"new_ViewLayer.exr", "new_Second.exr"}


def test_the_property_is_set_as_a_text(scene):
    box = bpy.data.objects["Box"]
    with bpy.context.temp_override(object=box):
        assert bpy.ops.infrared.property_add(owner="OBJECT", key="temperature_group") == {"FINISHED"}
    assert box["temperature_group"] == "" and read()[0].groups == ("engine", "sky")
    assert re.search("renders? keeps? apart", box.id_properties_ui("temperature_group").as_dict()["description"])
