# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of every format from Blender: written with a render, frame by frame, and by the export operator."""

import re
from types import SimpleNamespace

import numpy as np
import OpenEXR
import pytest
import tifffile
from spectral.io import envi

bpy = pytest.importorskip("bpy")

from addon.output.formats import EXTENSIONS, FORMATS  # noqa: E402
from addon.rendering.render_files import check_paths  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from addon.ui.exporter import Exporter  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, read_exr, render_to_exr, use_multilayer_exr  # noqa: E402

ENDINGS = [".exr", "_spectral.exr", ".hdr", ".raw", ".tif", "_16bit.tif"]


@pytest.fixture
def infrared(reset_blender):
    """A warm cube under the cold sky, in three bands."""
    camera(width=8, height=6)
    link("Cube", cube_mesh(), temperature=310.0)
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 2, 1000, 3, 1
    infrared.file_formats = set(FORMATS)
    return infrared


def bands(passes):
    """The images of the bands, by rising wavelength."""
    return [passes[name] for name in sorted((name for name in passes if "um" in name), key=lambda n: float(n[:4]))]


def assert_files_hold(stem, passes):
    """The files of a frame hold what Blender's own file does."""
    channels = OpenEXR.File(f"{stem}.exr").channels()
    np.testing.assert_array_equal(channels["Noise.V"].pixels[::-1], passes["Noise"])
    channels = OpenEXR.File(f"{stem}_spectral.exr").channels()
    names = sorted((name for name in channels if name.startswith("S0")), key=lambda n: float(n[3:-2].replace(",", ".")))
    cube = envi.open(f"{stem}.hdr").open_memmap(interleave="bsq")
    assert len(bands(passes)) == len(names) == len(cube) == 3
    for band, name, image in zip(bands(passes), names, cube, strict=True):
        np.testing.assert_array_equal(channels[name].pixels[::-1], band / np.float32(1000))
        np.testing.assert_array_equal(image[::-1], band)
    np.testing.assert_array_equal(tifffile.imread(f"{stem}.tif")[::-1], passes["Temperature"])
    counts = tifffile.imread(f"{stem}_16bit.tif")[::-1]
    np.testing.assert_array_equal(counts, np.rint(passes["Temperature"].astype(float) * 100))


def test_a_render_writes_every_format(infrared, tmp_path):
    infrared.band_exr_path = str(tmp_path / "bands.exr")
    passes = render_to_exr(tmp_path)["ViewLayer"]
    assert passes["Temperature"].max() > 300  # there is something in the picture
    assert {file.name for file in tmp_path.glob("bands*")} == {f"bands{ending}" for ending in ENDINGS}
    assert_files_hold(tmp_path / "bands", passes)
    header = OpenEXR.File(str(tmp_path / "bands.exr"), header_only=True).header()
    assert (header["photonsPerPass"], header["neighbours"]) == ("1000", str(infrared.neighbours))


def test_an_animation_numbers_them(infrared, tmp_path):
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 4, 5
    infrared.band_exr_path = str(tmp_path / "bands")
    scene.render.engine, scene.render.filepath = "INFRARED_PHOTONS", str(tmp_path / "image_####")
    use_multilayer_exr()
    bpy.ops.render.render(animation=True)
    names = {f"bands{frame}{ending}" for frame in ("0004", "0005") for ending in ENDINGS}
    assert {file.name for file in tmp_path.glob("bands*")} == names
    for frame in ("0004", "0005"):
        assert_files_hold(tmp_path / f"bands{frame}", read_exr(tmp_path / f"image_{frame}.exr")["ViewLayer"])


@pytest.mark.parametrize("path", ["bands.tif", "bands.HDR", "bands"])
def test_one_format_alone_whatever_the_extension_says(infrared, tmp_path, path):
    infrared.band_exr_path, infrared.file_formats = str(tmp_path / path), {"ENVI"}
    render_to_exr(tmp_path)
    assert {file.name for file in tmp_path.glob("bands*")} == {"bands.hdr", "bands.raw"}


def test_the_operator_exports_every_format_of_every_view_layer(infrared, tmp_path):
    bpy.context.scene.view_layers.new("Other")
    passes = render_to_exr(tmp_path)
    assert set(passes) == {"ViewLayer", "Other"}
    for file_format, each in FORMATS.items():
        path = tmp_path / f"bands{each.ending}"
        assert bpy.ops.infrared.export_bands(filepath=str(path), file_format=file_format) == {"FINISHED"}
    exported = {}  # the operator puts the layer last, the files of a render have it before the ending
    for ending in ENDINGS:
        stem, extension = ending.split(".")
        exported |= {f"bands{stem}_{layer}.{extension}": f"bands_{layer}{ending}" for layer in passes}
    assert {file.name for file in tmp_path.glob("bands*")} == set(exported)
    for old, new in exported.items():
        (tmp_path / old).rename(tmp_path / new)
    for layer, images in passes.items():
        assert_files_hold(tmp_path / f"bands_{layer}", images)


def test_a_render_names_the_view_layer_before_the_ending(infrared, tmp_path):
    """Even where two names differ only in what file names do not keep."""
    bpy.context.scene.view_layers[0].name = "A.1"
    bpy.context.scene.view_layers.new("A_1")
    infrared.band_exr_path = str(tmp_path / "bands_22.5")
    passes = render_to_exr(tmp_path)
    expected = {f"bands_22.5_A_1{number}{ending}" for number in ("", "_2") for ending in ENDINGS}
    assert {file.name for file in tmp_path.glob("bands*")} == expected and len(passes) == 2


@pytest.mark.parametrize(
    ("paths", "both"),
    [
        ({"band_exr_path": "same", "group_exr_path": "same.EXR"}, "Band Images and Temperature Groups"),
        ({"band_exr_path": "a", "group_exr_path": "a_spectral"}, "Band Images and Temperature Groups"),
        ({"film_path": "some_####", "checkpoint_path": "x/../some_0001"}, "Checkpoint and Keep Film"),
        ({"band_exr_path": "", "group_exr_path": "", "label_path": "", "film_path": ""}, "Band Images and Temp"),
        ({"band_exr_path": "a", "group_exr_path": "b", "label_path": "a", "film_path": "a"}, ""),
    ],
)
def test_two_settings_never_write_the_same_file(infrared, tmp_path, paths, both):
    """That of the later one would be all that is left."""
    for name, path in paths.items():
        setattr(infrared, name, f"{tmp_path}/{path}")
    if not both:
        assert check_paths(infrared) is None
        return
    with pytest.raises(RuntimeError, match=f"{both}.* would both write '{tmp_path}"):
        render_to_exr(tmp_path)
    assert not list(tmp_path.iterdir())


def test_blenders_own_file_is_not_that_of_a_setting(infrared, tmp_path):
    """Blender would write its picture over the bands."""
    infrared.band_exr_path = bpy.context.scene.render.filepath = f"{tmp_path}/image_####"
    bpy.context.scene.render.image_settings.file_format = "OPEN_EXR"
    with pytest.raises(SceneError, match="Band Images and Blender's Output would both write"):
        check_paths(infrared, animation=True)
    bpy.context.scene.render.filepath = f"{tmp_path}/other_####"
    check_paths(infrared, animation=True)


def test_files_in_a_folder_are_called_after_the_frame(infrared, tmp_path):
    folder = tmp_path / "bands"
    folder.mkdir()
    infrared.band_exr_path = infrared.label_path = infrared.film_path = f"{folder}/"
    infrared.file_formats = {"BAND_EXR", "TIFF"}
    bpy.context.scene.frame_set(12)
    render_to_exr(tmp_path)
    assert {path.name for path in folder.iterdir()} == {f"0012.{end}" for end in ("exr", "tif", "json", "npz")}


def test_what_follows_a_dot_belongs_to_the_name_of_an_export(infrared, tmp_path):
    """Else a series of such names would write one file."""
    render_to_exr(tmp_path)
    for name in ("run_293.2", "run_293.7", "run_300.EXR"):
        bpy.ops.infrared.export_bands(filepath=str(tmp_path / name), file_format="TIFF")
    for name in ("run_293.2", "run_293.7", "run_300.PNG"):
        bpy.ops.infrared.export_picture(filepath=str(tmp_path / name))
    expected = {f"{stem}{ending}" for stem in ("run_293.2", "run_293.7", "run_300") for ending in (".tif", ".png")}
    assert {file.name for file in tmp_path.glob("run*")} == expected


@pytest.mark.parametrize("chosen", ["run_293.2", "run_293.2.exr", "run_293.2.TIF"])
def test_the_file_browser_shows_the_name_that_is_written(chosen):
    dialog = SimpleNamespace(filepath=f"/tmp/{chosen}", extensions=EXTENSIONS, filename_ext=".hdr")
    dialog.target = lambda: Exporter.target(dialog)
    assert Exporter.check(dialog, None) and dialog.filepath == "/tmp/run_293.2.hdr"
    assert not Exporter.check(dialog, None)


@pytest.mark.parametrize("file_format", FORMATS)
def test_what_cannot_be_written_is_named_and_the_picture_kept(infrared, tmp_path, file_format):
    infrared.band_exr_path, infrared.file_formats = str(tmp_path / "missing" / "bands"), {file_format}
    bpy.context.scene.render.engine = "INFRARED_PHOTONS"
    with pytest.raises(RuntimeError, match=re.escape(str(tmp_path / "missing"))):
        bpy.ops.render.render()
    with pytest.raises(RuntimeError, match=re.escape(str(tmp_path / "missing"))):
        bpy.ops.infrared.export_bands(filepath=str(tmp_path / "missing" / "bands"), file_format=file_format)
    assert bpy.ops.infrared.export_bands(filepath=str(tmp_path / "kept"), file_format=file_format) == {"FINISHED"}
    assert list(tmp_path.glob("kept*"))
