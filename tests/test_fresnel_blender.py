# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel's law as artists set it: material["fresnel"], library materials with n and k, the panel and the checks."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.rendering.checks import material_checks  # noqa: E402
from addon.solver.physics import library  # noqa: E402
from addon.solver.scene import SceneError  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, link, material, read  # noqa: E402


@pytest.fixture(autouse=True)
def with_camera(reset_blender):
    camera()


def read_material(**properties):
    """The solver's material of a cube in Blender's scene."""
    mesh = cube_mesh()
    paint = material("Paint", **properties)
    mesh.materials.append(paint)
    link("Cube", mesh, temperature=300.0)
    scene, _ = read()
    return next(each for each in scene.materials if each.name == paint.name)


def test_it_is_off_unless_set():
    assert not read_material(specular=1.0).fresnel
    assert not read_material(specular=1.0, fresnel=False).fresnel


@pytest.mark.parametrize("value", [True, 1])
def test_a_number_is_that_of_a_dielectric(value):
    paint = read_material(emissivity=0.9, specular=0.4, fresnel=value)
    assert paint.follows_fresnel and paint.constants is None and paint.emissivity == 0.9


def test_library_materials_bring_n_and_k():
    """Those that have them, only if asked for, letter case ignored."""
    water = read_material(emissivity="water", specular=1.0, fresnel=True)
    np.testing.assert_array_equal(water.constants, library.find_constants("Water"))
    assert read_material(emissivity="Water", specular=1.0).constants is None
    assert read_material(emissivity="Brick, new", specular=0.2, fresnel=True).constants is None


@pytest.mark.parametrize("value", [2, -1, 0.5, float("nan"), "yes", [True, False]])
def test_bad_values_are_named(value):
    with pytest.raises(SceneError, match="Material 'Paint': fresnel is .*expected true or false"):
        read_material(fresnel=value)


def test_property_has_a_tooltip_and_changes_nothing_when_added():
    paint = material()
    with bpy.context.temp_override(material=paint):
        assert bpy.ops.infrared.property_add(owner="MATERIAL", key="fresnel") == {"FINISHED"}
        assert paint["fresnel"] is False or paint["fresnel"] == 0
        assert "grazing" in paint.id_properties_ui("fresnel").as_dict()["description"]
        assert paint.is_property_overridable_library('["fresnel"]')
        paint["fresnel"] = True
        assert bpy.ops.infrared.property_remove(owner="MATERIAL", key="fresnel") == {"FINISHED"}
    assert "fresnel" not in paint


def test_checks():
    infrared = bpy.context.scene.infrared
    assert [c.text for c in material_checks(material("A", emissivity=0.9, fresnel=True), infrared)] == [
        "Material 'A': fresnel changes nothing without a specular share above 0"
    ]
    assert not material_checks(material("B", emissivity=0.9, specular=0.5, fresnel=True), infrared)
    bad = material_checks(material("C", emissivity=0.9, fresnel="maybe"), infrared)
    assert [check.level for check in bad] == ["ERROR"]
    infrared.wavelength_max = 25.0
    germanium = material_checks(material("D", emissivity="Germanium", specular=1.0, fresnel=True), infrared)
    assert len(germanium) == 1 and "emissivity is known from" in germanium[0].text
