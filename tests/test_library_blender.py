# SPDX-License-Identifier: GPL-3.0-or-later
"""The material library, curves, presets, checks and assets in Blender."""

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.rendering.checks import scene_checks  # noqa: E402
from addon.solver.physics import library  # noqa: E402
from addon.solver.physics.spectrum import band_radiance  # noqa: E402
from addon.ui import band_presets, checks  # noqa: E402
from addon.ui.materials import (  # noqa: E402
    curve_image,
    curve_points,
    curve_previews,
    material_assets,
    material_library,
)
from tests.helpers.blender import camera, cube_mesh, link, material, read, render_to_exr  # noqa: E402

pytestmark = pytest.mark.usefixtures("reset_blender")
CURVE = [8.0, 0.9, 14.0, 0.8]
operators = bpy.ops.infrared


@pytest.fixture
def own_file(tmp_path, monkeypatch):
    path = tmp_path / "my materials.csv"
    monkeypatch.setenv(library.USER_VARIABLE, str(path))
    return path


@pytest.fixture
def paint():
    """A material, and Blender's context while its panel is shown."""
    paint = material(emissivity=0.5)
    with bpy.context.temp_override(material=paint):
        yield paint


def cube_scene(**properties):
    """A warm cube that fills the camera's middle, with a material, before surroundings that are set to 0 K."""
    camera()
    world = bpy.context.scene.world = bpy.data.worlds.new("Night")
    world["temperature"] = 0.0
    cube = link("Cube", cube_mesh(), temperature=320.0)
    cube.data.materials.append(material(**properties))
    bpy.context.scene.infrared.passes = 1
    bpy.context.scene.infrared.photons_per_pass = 100
    return cube


# The library


def test_library_materials_go_to_all_selected_objects():
    cubes = [link(f"Cube {i}", cube_mesh()) for i in range(4)]
    paints = [material(f"Paint {i}") for i in range(2)]
    for cube, paint in zip(cubes, [*paints, paints[1]], strict=False):  # the last one has no material
        cube.data.materials.append(paint)
    for cube in (cubes[1], cubes[2], cubes[3]):
        cube.select_set(True)
    assert operators.emissivity_library(name="water", target="SELECTED") == {"FINISHED"}
    assert "emissivity" not in paints[0]
    assert paints[1]["emissivity"] == "Water"


def test_unknown_library_names_are_refused(paint):
    with pytest.raises(RuntimeError, match="no material 'Watr'; close names: 'Water'"):
        operators.emissivity_library(name="Watr")
    assert paint["emissivity"] == 0.5


def test_search_finds_names_and_categories():
    metals = material_library.matching_names("METAL polish")
    assert "Gold, polished" in metals
    assert all("polish" in name for name in metals)
    assert material_library.matching_names("") == set(library.names())
    assert material_library.matching_names("no such material") == set()


def test_what_the_search_hides_is_not_chosen():
    names = [SimpleNamespace(name=name) for name in library.names()]
    browser = SimpleNamespace(search="", names=names, index=5)
    material_library.choose_match(browser, None)
    assert browser.index == 5
    browser.search = "polymer"
    material_library.choose_match(browser, None)
    assert names[browser.index].name == "Plastic, PET"
    browser.search = "polycarb"
    material_library.choose_match(browser, None)
    assert names[browser.index].name == "Plastic, polycarbonate"
    browser.search = "no such material"
    material_library.choose_match(browser, None)
    assert names[browser.index].name == "Plastic, polycarbonate"  # nothing to choose; Use refuses


def test_saved_materials_are_rendered_by_name(paint, own_file, tmp_path):
    """In another file that knows only the name: the cube's middle shows eps B(T), and the sky is at 0 K."""
    paint["emissivity"] = CURVE
    assert operators.library_save(name="My Oak", source="me") == {"FINISHED"}
    bpy.ops.wm.read_factory_settings(use_empty=True)
    cube_scene(emissivity="my oak")
    infrared = bpy.context.scene.infrared
    infrared.band_mode, infrared.band_edges = "CUSTOM", "8, 14"
    image = render_to_exr(tmp_path)["ViewLayer"]["Radiance"]
    points = np.array(CURVE).reshape(-1, 2)
    expected = band_radiance(np.array([8.0, 14.0]), np.float32(320.0), (points[:, 0], points[:, 1]))[0]
    assert image[6, 8] == pytest.approx(expected, rel=1e-5)  # float32: emission is exact, and nothing is reflected


def test_names_of_the_library_cannot_be_saved(paint, own_file):
    with pytest.raises(RuntimeError, match="'Water' comes with the add-on"):
        operators.library_save(name="Water")
    operators.library_save(name="Oak")
    with pytest.raises(RuntimeError, match="have 'Oak' already"):
        operators.library_save(name="Oak")
    paint["emissivity"] = 0.7
    operators.library_save(name="Oak", replace=True)
    assert library.find("Oak")[:, 1].tolist() == [0.7]
    operators.library_remove(name="Oak")
    assert library.user_materials() == {}


def test_unknown_name_stops_the_render_with_a_clear_error(tmp_path):
    cube_scene(emissivity="Gold, polishd")
    with pytest.raises(RuntimeError, match="'Paint': the library has no material 'Gold, polishd'; close names"):
        render_to_exr(tmp_path)


def test_spectra_are_imported_as_points_or_into_the_library(paint, own_file, tmp_path):
    path = tmp_path / "oak.csv"
    path.write_text("um,reflectance %\n14,20\n8,10\n")
    arguments = {"filepath": str(path), "quantity": "reflectance", "unit": "percent"}
    assert operators.spectrum_import(**arguments) == {"FINISHED"}
    np.testing.assert_allclose(paint["emissivity"].to_list(), CURVE, rtol=0, atol=1e-12)
    assert not own_file.exists()
    operators.spectrum_import(**arguments, keep=True)
    assert paint["emissivity"] == "oak"
    assert "oak.csv; emissivity = 1 - reflectance" in library.get("oak").source
    path.write_text("um,reflectance %\n14,20\n8,nan\n")
    with pytest.raises(RuntimeError, match=r"oak\.csv, line 3: reflectance nan"):
        operators.spectrum_import(**arguments)
    assert paint["emissivity"] == "oak"


def test_points_as_text_keep_apart_what_measurements_do(paint):
    """Text that is shown and taken again changes nothing."""
    points = [(8.1234567, 0.9), (8.1234569, 0.123456789), (14.0, 0.8)]
    paint["emissivity"] = [number for point in points for number in point]
    text = curve_points.as_text(curve_points.point_list(paint))
    assert text == "8.1234567, 0.9, 8.1234569, 0.123456789, 14, 0.8"
    assert operators.emissivity_curve(points=text) == {"FINISHED"}
    assert curve_points.point_list(paint) == points


@pytest.mark.filterwarnings("ignore:.*blend relative")  # which Blender's base of such operators does not announce
def test_a_spectrum_beside_the_blend_file_is_found(tmp_path):
    (tmp_path / "oak.csv").write_text("um,emissivity\n8,0.9\n14,0.8\n")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    paint = material()
    with bpy.context.temp_override(material=paint):
        assert operators.spectrum_import(filepath="//oak.csv") == {"FINISHED"}
    np.testing.assert_allclose(paint["emissivity"].to_list(), CURVE, rtol=0, atol=1e-12)


def test_without_the_add_on_as_extension_the_environment_names_the_file(own_file):
    assert library.user_file() == own_file


# Curves


def test_points_are_edited_in_the_property_itself(paint):
    paint["emissivity"] = CURVE
    operators.point_add(wavelength=10.0, emissivity=0.5)
    assert paint["emissivity"].to_list() == [8.0, 0.9, 10.0, 0.5, 14.0, 0.8]
    operators.point_edit(index=1, wavelength=15.0, emissivity=0.25)
    assert paint["emissivity"].to_list() == [8.0, 0.9, 14.0, 0.8, 15.0, 0.25]
    operators.point_remove(index=0)
    assert paint["emissivity"].to_list() == [14.0, 0.8, 15.0, 0.25]
    with pytest.raises(RuntimeError, match="a point at 14 µm already"):
        operators.point_add(wavelength=14.0, emissivity=0.5)
    with pytest.raises(RuntimeError, match="no point 7"):
        operators.point_edit(index=7, wavelength=1.0, emissivity=0.5)
    operators.point_remove(index=0)
    with pytest.raises(RuntimeError, match="keeps one point"):
        operators.point_remove(index=0)
    assert paint["emissivity"].to_list() == [15.0, 0.25]


def test_wavelengths_stay_as_typed(paint):
    paint["emissivity"] = CURVE
    operators.point_add(wavelength=8.3, emissivity=0.7)  # float32 in Blender
    assert paint["emissivity"].to_list()[2:4] == [8.3, 0.7]


def test_damaged_points_can_be_mended(paint):
    paint["emissivity"] = [8.0, 1.7, 14.0, 0.8]
    operators.point_edit(index=0, wavelength=8.0, emissivity=0.7)
    assert paint["emissivity"].to_list() == [8.0, 0.7, 14.0, 0.8]


def test_numbers_and_library_curves_become_points(paint):
    operators.points_make()
    assert paint["emissivity"].to_list() == [7.5, 0.5, 14.0, 0.5]  # the scene's bands
    paint["emissivity"] = "Water"
    assert not operators.point_add.poll()
    operators.points_make()
    assert np.array_equal(np.reshape(paint["emissivity"].to_list(), (-1, 2)), library.find("Water"))
    assert curve_points.point_list(paint) is not None


@pytest.mark.parametrize("value", [0.5, "Water", [8.0, 0.9, 14.0], ["8", "0.9"]])
def test_what_is_no_list_of_points_is_not_edited_as_one(paint, value):
    paint["emissivity"] = value
    assert curve_points.point_list(paint) is None


def test_icons_are_drawn_again_when_the_curve_changes():
    points = np.reshape(CURVE, (-1, 2))

    def pixels():
        curve_previews.curve_icon("test", points, (16, 16))
        preview = curve_previews._previews["test"]
        assert tuple(preview.image_size) == (16, 16)
        return np.array(preview.image_pixels_float[:])

    first = pixels()
    assert np.array_equal(first, pixels())
    points[:, 1] = 0.1
    assert not np.array_equal(first, pixels())


def test_nothing_is_left_after_unregistering():
    import addon

    curve_previews.curve_icon("test", np.reshape(CURVE, (-1, 2)))
    addon.unregister()
    try:
        assert curve_previews._previews is None
        assert not hasattr(bpy.types.WindowManager, "infrared_first_point")
        assert not any(handler in getattr(bpy.app.handlers, event) for event, handler in checks.HANDLERS.items())
        assert not bpy.utils.preset_paths(band_presets.SUBFOLDER)
        assert not any("infrared" in name.lower() for name in dir(bpy.types) if "_OT_" in name or "_UL_" in name)
    finally:
        addon.register()


# Presets


@pytest.mark.parametrize(
    ("name", "low", "high"),
    [
        ("SWIR 0.9-1.7 um", 0.9, 1.7),
        ("MWIR 3-5 um", 3.0, 5.0),
        ("LWIR 8-14 um", 8.0, 14.0),
        ("Microbolometer 7.5-14 um", 7.5, 14.0),
    ],
)
def test_band_presets(name, low, high):
    path = bpy.utils.preset_find(name, band_presets.SUBFOLDER, display_name=True)
    assert path
    bpy.context.scene.infrared.band_mode = "CUSTOM"
    bpy.ops.script.execute_preset(filepath=path, menu_idname="INFRARED_PT_band_presets")
    infrared = bpy.context.scene.infrared
    assert infrared.band_mode == "UNIFORM"
    assert (infrared.wavelength_min, infrared.wavelength_max) == pytest.approx((low, high))


# Checks


def texts(level):
    bpy.context.view_layer.update()  # as Blender does before it draws
    found = scene_checks(bpy.context.scene, bpy.context.view_layer)
    return [check.text for check in found if check.level == level]


def test_a_sound_scene_has_nothing_to_report():
    cube_scene(emissivity=0.9)
    assert scene_checks(bpy.context.scene, bpy.context.view_layer) == []


@pytest.mark.parametrize(
    ("emissivity", "message"),
    [
        (1.5, "Material 'Paint': emissivity 1.5 is outside 0..1"),
        ("Watr", "Material 'Paint': the library has no material 'Watr'"),
        ([8.0, 0.9, 14.0], "Material 'Paint': the emissivity list has 3 numbers"),
        ([8.0, 0.9, 8.0, 0.8], "Material 'Paint': emissivity wavelengths must increase"),
    ],
)
def test_checks_report_what_would_stop_the_render(emissivity, message):
    """And the render stops with the same message."""
    cube_scene(emissivity=emissivity)
    (text,) = texts("ERROR")
    assert text.startswith(message)
    with pytest.raises(ValueError) as caught:
        read()
    assert str(caught.value) == text


def test_checks_report_bands_outside_the_data():
    cube = cube_scene(emissivity=[7.5, 0.9, 14.0, 0.8])
    infrared = bpy.context.scene.infrared
    assert texts("WARNING") == []  # the default bands end where the points end
    infrared.wavelength_max = 15.0
    (text,) = texts("WARNING")
    assert "known from 7.5 to 14 µm; the bands reach from 7.5 to 15 µm" in text
    cube.data.materials[0]["emissivity"] = 0.9
    assert texts("WARNING") == []
    infrared.wavelength_max = 7.0
    assert len(texts("ERROR")) == 1


def test_checks_hint_at_what_counts_where_nothing_is_set():
    cube = cube_scene()
    del cube["temperature"]
    assert texts("HINT") == [
        "Material 'Paint': no emissivity; the default 0.95 counts",
        "Object 'Cube': no temperature; the ambient 293.15 K counts",
    ]
    cube.hide_render = True
    assert texts("HINT") == []


def test_checks_report_temperatures():
    cube = cube_scene(emissivity=0.9)
    cube["temperature"] = -1.0
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    world["temperature"] = "cold"
    assert texts("ERROR") == [
        "World 'Sky': temperature is 'cold', expected a number in kelvin or a flat list of zenith angles (degrees) and "
        "temperatures",
        "Object 'Cube': temperature -1 K; temperatures are finite and at least 0 K",
    ]


def test_checks_see_nan_in_the_attribute_and_its_repair():
    cube = cube_scene(emissivity=0.9)
    attribute = cube.data.attributes.new("temperature", "FLOAT", "POINT")
    attribute.data.foreach_set("value", [300.0] * 7 + [float("nan")])
    cube.data.update()
    bpy.context.view_layer.update()
    (text,) = texts("ERROR")
    assert text.startswith("Attribute 'temperature' of object 'Cube': temperature nan K")
    with pytest.raises(ValueError) as caught:
        read()
    assert str(caught.value) == text
    attribute.data[7].value = 300.0
    cube.data.update()
    bpy.context.view_layer.update()
    assert texts("ERROR") == []


def test_checks_name_a_damaged_file_of_my_materials(own_file):
    cube_scene(emissivity=0.9)
    own_file.write_text("nonsense\n")
    (text,) = texts("WARNING")
    assert "my materials.csv, line 1" in text


# Assets


def test_materials_become_assets(paint, tmp_path):
    paint["emissivity"] = "Gold, polished"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "assets.blend"))
    paint = bpy.data.materials["Paint"]
    with bpy.context.temp_override(material=paint):
        assert operators.material_asset() == {"FINISHED"}
        assert operators.material_asset() == {"FINISHED"}  # again: the catalogue is not doubled
    assert "Olmon" in paint.asset_data.description
    assert {tag.name for tag in paint.asset_data.tags} == {"infrared", "metal"}
    assert tuple(paint.preview.image_size) == curve_previews.PANEL_SIZE
    pixels = np.array(paint.preview.image_pixels_float[:]).reshape(-1, 4)
    assert len(np.unique(pixels, axis=0)) > 2
    lines = (tmp_path / material_assets.CATALOGUE_FILE).read_text().splitlines()
    assert lines[0] == "VERSION 1"
    (line,) = [line for line in lines if line.startswith(paint.asset_data.catalog_id)]
    assert line.split(":")[1] == "Infrared Photons/metal"
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "assets.blend"))
    kept = bpy.data.materials["Paint"]
    assert kept.asset_data.catalog_id == line.split(":")[0]
    assert kept["emissivity"] == "Gold, polished"
    assert tuple(kept.preview.image_size) == curve_previews.PANEL_SIZE


def test_catalogues_are_kept_with_the_asset_library(tmp_path):
    blend = tmp_path / "library" / "metals" / "gold.blend"
    assert material_assets.catalogue_folder(blend, []) == blend.parent
    assert material_assets.catalogue_folder(blend, [tmp_path / "library"]) == tmp_path / "library"
    (tmp_path / material_assets.CATALOGUE_FILE).write_text("VERSION 1\n\nabc:Others:Others")
    assert material_assets.catalogue_folder(blend, []) == tmp_path
    material_assets.add_catalogue(tmp_path, "metal")
    lines = (tmp_path / material_assets.CATALOGUE_FILE).read_text().splitlines()
    assert lines[2:] == ["abc:Others:Others", lines[3]] and ":Infrared Photons/metal:" in lines[3]


# Pictures of curves


def test_pictures_show_the_curve_where_it_is():
    """Half way up at 0.5, from edge to edge; grey where the value is held; bands shaded in turn."""
    points = np.array([[4.0, 0.5], [8.0, 0.5]])
    edges = np.array([3.0, 6.0, 9.0])
    image = curve_image.draw_curve(points, 2.0, 10.0, (80, 50), edges)
    assert image.shape == (50, 80, 4) and image.dtype == np.float32
    assert image.min() >= 0.0 and image.max() <= 1.0
    assert np.allclose(image[25, 30], curve_image.CURVE) and np.allclose(image[25, 5], curve_image.HELD)
    for column, colour in ((5, curve_image.BACKGROUND), (20, curve_image.BAND[0]), (50, curve_image.BAND[1])):
        assert np.allclose(image[10, column], colour)


def test_pictures_have_no_gaps_in_steep_curves():
    points = np.array([[3.0, 0.0], [5.0, 0.0], [5.001, 1.0], [5.002, 0.0], [9.0, 0.0]])
    image = curve_image.draw_curve(points, 2.0, 10.0, (80, 50))
    column = image[:, 29:31].max(axis=1)  # 5 um lies between columns 29 and 30
    assert np.all(column[3:47, 0] > 0.9)
