# SPDX-License-Identifier: GPL-3.0-or-later
"""The material library: every material is valid, agrees with independent literature, and damage is refused."""

import re

import numpy as np
import pytest

from addon.solver.physics import library
from addon.solver.scene import Material, SceneError
from docs.tools.paths import DOCS
from docs.tools.plot_materials import table_of_materials

MATERIALS = library.load()
C2 = 14387.768775  # um K


def emissivity(name, wavelength):
    return np.interp(wavelength, *library.find(name).T)


def band_mean(name, low, high):
    return np.mean(emissivity(name, np.linspace(low, high, 2001)))


def lowest(name, low, high):
    """Wavelength (um) and value of the minimum inside low..high."""
    wavelength = np.linspace(low, high, 4001)
    values = emissivity(name, wavelength)
    return wavelength[np.argmin(values)], np.min(values)


def test_there_are_about_forty_materials_or_more():
    assert len(MATERIALS) >= 40
    assert library.names() == sorted(MATERIALS, key=str.casefold)


@pytest.mark.parametrize("name", MATERIALS)
def test_material_is_valid(name):
    material = MATERIALS[name]
    Material(name, emissivity=material.points)  # raises if the solver would refuse it
    assert material.points.dtype == np.float64
    assert np.all(np.diff(material.points[:, 0]) > 0)
    assert np.all((material.points[:, 1] >= 0.0) & (material.points[:, 1] <= 1.0))
    assert min(14.0, material.points[-1, 0]) - max(3.0, material.points[0, 0]) >= 1.0, "covers nothing of 3-14 um"
    assert re.search(r"\b(19|20)\d\d\b|Publ\. No\.", material.source), "no year and no publication number"
    assert material.note and material.category


def test_find_ignores_case_and_gives_read_only_points():
    points = library.find(" gOLD, Polished ")
    assert points is MATERIALS["Gold, polished"].points
    with pytest.raises(ValueError, match="read-only"):
        points[0, 1] = 1.0


def test_unknown_name_suggests_close_ones():
    with pytest.raises(KeyError) as caught:
        library.find("Gold, polishd")
    assert "'Gold, polishd'" in caught.value.args[0] and "'Gold, polished'" in caught.value.args[0]
    with pytest.raises(KeyError) as caught:
        library.find("0000")
    assert "close" not in caught.value.args[0]


# Reflectance of evaporated films at 10 um: J. M. Bennett and E. J. Ashley, Appl. Opt. 4, 221 (1965), and H. E. Bennett,
# M. Silver, E. J. Ashley, J. Opt. Soc. Am. 53, 1089 (1963): silver .995, gold .994, aluminium .987. Tolerance .005: how
# far films of different makers lie apart.
@pytest.mark.parametrize(
    ("name", "reflectance"), [("Silver, polished", 0.995), ("Gold, polished", 0.994), ("Aluminium, polished", 0.987)]
)
def test_mirrors_reflect_as_measured(name, reflectance):
    assert emissivity(name, 10.0) == pytest.approx(1.0 - reflectance, abs=0.005)


@pytest.mark.parametrize("name", [name for name, m in MATERIALS.items() if m.category == "metal"])
def test_polished_metals_emit_less_at_longer_wavelengths(name):
    """Free electrons (Drude): emissivity falls with wavelength; 5 % slack for what the measurements scatter."""
    values = emissivity(name, np.array([3.0, 5.0, 8.0, 12.0]))
    assert np.all(values[1:] <= values[:-1] * 1.05)
    assert values[-1] < 0.06


def test_water_is_nearly_black():
    """Segelstein's table (1981), made apart from the one used here (1973), gives .9943 at 11 um and .9917 at 10 um;
    they differ by up to .003 in 4-12 um. The trap: .67 in tables of hand-held meters."""
    assert emissivity("Water", np.array([10.0, 11.0])) == pytest.approx([0.9917, 0.9943], abs=0.003)
    assert band_mean("Water", 8.0, 14.0) > 0.97


def test_ice_is_darker_than_water_beyond_11_um():
    """S. G. Warren's older compilation, Appl. Opt. 23, 1206 (1984), gives .9535 at 12 um; both differ by up to .002."""
    assert emissivity("Ice", 12.0) == pytest.approx(0.9535, abs=0.003)
    assert emissivity("Ice", 12.5) < emissivity("Water", 12.5) - 0.02


def test_snow_lies_between_ice_and_black():
    assert emissivity("Ice", 12.0) < emissivity("Snow, coarse-grained", 12.0) < 1.0


def test_window_glass_agrees_with_the_standard():
    """EN 12898 gives uncoated float glass a normal emissivity of .89 at 283 K, over 5.5-50 um. The curve ends at 25 um
    (it is held beyond); the standard's value is rounded and a mean of thirty points: tolerance .01."""
    wavelength = np.linspace(5.5, 50.0, 20001)
    planck = wavelength**-5 / np.expm1(C2 / (wavelength * 283.0))
    mean = np.sum(emissivity("Glass, window", wavelength) * planck) / np.sum(planck)
    assert mean == pytest.approx(0.89, abs=0.01)


def test_fused_silica_has_its_reststrahlen_dip():
    """Popova et al. (1972), fitted by Kitamura et al., Appl. Opt. 46, 8118 (2007): .344 at 9.0 um, .656 at 9.5 um, .800
    at 10 um, from another sample. Tolerance .03: samples differ by that much on the steep sides of the band."""
    expected = {9.0: 0.344, 9.5: 0.656, 10.0: 0.800}
    assert emissivity("Fused silica", np.array(list(expected))) == pytest.approx(list(expected.values()), abs=0.03)


def test_silicon_carbide_mirrors_between_its_phonons():
    """TO 793 1/cm is 12.6 um, LO 969 1/cm is 10.3 um: nearly a mirror in between, black near 10 um where n = 1."""
    at, value = lowest("Silicon carbide", 8.0, 14.0)
    assert 1e4 / 969 < at < 1e4 / 793 and value < 0.05
    assert emissivity("Silicon carbide", 10.0) > 0.95


def test_minerals_show_their_bands():
    """Carbonate: out-of-plane bend of calcite at 872 1/cm (V. C. Farmer, The Infrared Spectra of Minerals, 1974);
    silicate and quartz: Si-O stretch at 8-10 um. Within .3 um: composition and grain size shift bands that much."""
    assert lowest("Limestone", 10.5, 12.5)[0] == pytest.approx(1e4 / 872, abs=0.3)
    for name in ("Sandstone", "Granite", "Kaolinite", "Brick, new"):
        assert 8.0 <= lowest(name, 8.0, 13.0)[0] <= 10.0


def test_anodised_aluminium_differs_between_bands():
    """The mean of two finishes is .64 in 3-5 um and .96 in 8-14 um."""
    finishes = ("Aluminium, anodised black", "Aluminium, anodised grey")
    assert np.mean([band_mean(name, 3.0, 5.0) for name in finishes]) == pytest.approx(0.64, abs=0.005)
    assert np.mean([band_mean(name, 8.0, 14.0) for name in finishes]) == pytest.approx(0.96, abs=0.005)


def test_plastics_follow_their_refractive_index():
    """Away from bands k is small and n is 1.4 to 1.65, so eps = 4n/(n+1)^2 is .94 to .97."""
    for name, material in MATERIALS.items():
        if material.category == "polymer":
            assert 0.92 < np.median(emissivity(name, np.linspace(3.5, 5.0, 101))) < 0.98


POINTS = "material,wavelength_um,emissivity\nTin,3,0.1\nTin,5,0.2\n"
SOURCES = "material,category,kind,source,note\nTin,metal,measured,A. Author (2000),none\n"


def read(tmp_path, points=POINTS, sources=SOURCES):
    (tmp_path / "points.csv").write_bytes(points.encode() if isinstance(points, str) else points)
    (tmp_path / "sources.csv").write_text(sources, encoding="utf-8")
    return library.read(tmp_path / "points.csv", tmp_path / "sources.csv")


def test_reads_a_small_library(tmp_path):
    assert np.array_equal(read(tmp_path)["Tin"].points, [[3.0, 0.1], [5.0, 0.2]])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ("", r"points\.csv, line 1: the header"),
        (POINTS + "Tin,7\n", r"points\.csv, line 4: expected material"),
        (POINTS + "\n", r"points\.csv, line 4: expected material"),
        (POINTS + "Tin,seven,0.3\n", r"points\.csv, line 4: seven, 0\.3 are not two numbers"),
        (POINTS + "Tin,7,1.2\n", r"points\.csv, line 4: emissivity 1\.2 is outside"),
        (POINTS + "Tin,7,nan\n", r"points\.csv, line 4: emissivity nan is outside"),
        (POINTS + "Tin,5,0.3\n", r"points\.csv, line 4: wavelength 5 um of 'Tin' must be finite and above 5"),
        (POINTS + "Tin,inf,0.3\n", r"points\.csv, line 4: wavelength inf"),
        (POINTS + 'Tin,"7,0.3\n', r"points\.csv, line 4: unexpected end of data"),
        (POINTS + "Lead,7,0.3\n", r"material 'Lead' is not listed in sources\.csv"),
        (POINTS.encode() + b"\xff,7,0.3\n", r"points\.csv, line \d: .*can't decode"),
    ],
)
def test_damaged_points_are_refused(tmp_path, points, message):
    with pytest.raises(library.LibraryError, match=message):
        read(tmp_path, points=points)


@pytest.mark.parametrize(
    ("sources", "message"),
    [
        ("material,source\n", r"sources\.csv, line 1: the header"),
        (SOURCES + "TIN,metal,measured,B. Author,none\n", r"sources\.csv, line 3: material 'TIN' is listed twice"),
        (SOURCES + "Lead,metal,measured,B. Author,none\n", r"sources\.csv, line 3: material 'Lead' has no points"),
        (SOURCES.replace("A. Author (2000)", " "), r"sources\.csv, line 2: material 'Tin' has no source"),
        (SOURCES.replace("measured", "guessed"), r"sources\.csv, line 2: kind is 'guessed'"),
    ],
)
def test_damaged_sources_are_refused(tmp_path, sources, message):
    with pytest.raises(library.LibraryError, match=message):
        read(tmp_path, sources=sources)


def test_missing_table_is_refused(tmp_path):
    with pytest.raises(library.LibraryError, match=r"nowhere\.csv: No such file"):
        library.read(tmp_path / "nowhere.csv", tmp_path / "nowhere.csv")


def test_page_shows_the_library_as_it_is():
    """`python -m docs.tools.plot_materials` writes the table again."""
    assert table_of_materials() in (DOCS / "materials.md").read_text(encoding="utf-8")


# The artist's own materials -------------------------------------------------------------------------------------------

CURVE = np.array([[8.0, 0.9], [14.0, 0.8]])


@pytest.fixture
def own_file(tmp_path, monkeypatch):
    """The artist's file, which does not exist yet."""
    path = tmp_path / "my materials.csv"
    monkeypatch.setenv(library.USER_VARIABLE, str(path))
    return path


def test_without_a_file_there_are_no_own_materials(own_file):
    assert library.user_materials() == {}
    assert library.materials() == MATERIALS


def test_own_materials_are_kept_exactly_and_found(own_file):
    third = np.array([[0.1 + 0.2, 1.0 / 7.0], [1.0 / 3.0, 0.5]])
    library.add_user_material("Oak, oiled", CURVE, "measured\nby me")
    library.add_user_material("Paint", third, "")
    library._read_user.cache_clear()  # as in the next Blender
    assert np.array_equal(library.find("oak, OILED"), CURVE)
    assert np.array_equal(library.find("Paint"), third)
    assert library.get("Oak, oiled").source == "measured by me"
    assert "Paint" in library.names() and "Water" in library.names()
    assert "Paint" not in library.load()
    assert own_file.read_text(encoding="utf-8").startswith("material,wavelength_um,emissivity,source\n")
    library.remove_user_material("Oak, oiled")
    assert list(library.user_materials()) == ["Paint"]


def test_changes_by_another_program_are_seen(own_file):
    library.add_user_material("Oak", CURVE, "")
    own_file.write_text(own_file.read_text(encoding="utf-8").replace("Oak", "Walnut"), encoding="utf-8")
    assert list(library.user_materials()) == ["Walnut"]


def test_names_that_are_taken_are_refused(own_file):
    with pytest.raises(library.LibraryError, match="'WATER' comes with the add-on"):
        library.add_user_material("WATER", CURVE, "")
    with pytest.raises(library.LibraryError, match="needs a name"):
        library.add_user_material("  ", CURVE, "")
    library.add_user_material("Oak", CURVE, "")
    with pytest.raises(library.LibraryError, match="have 'Oak' already"):
        library.add_user_material("oak", CURVE / 2.0, "")
    library.add_user_material("oak", CURVE * [1.0, 0.5], "", replace=True)
    assert list(library.user_materials()) == ["oak"]
    assert np.array_equal(library.find("Oak"), CURVE * [1.0, 0.5])
    with pytest.raises(library.LibraryError, match="'Water' is none of my materials"):
        library.remove_user_material("Water")


@pytest.mark.parametrize("points", [CURVE[::-1], CURVE + 1.0, CURVE * np.nan])
def test_own_materials_must_be_emissivities(own_file, points):
    with pytest.raises(SceneError, match="'Oak'"):
        library.add_user_material("Oak", points, "")
    assert not own_file.exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Oak,8,0.9,x\nOak,nine,0.8,\n", r"my materials\.csv, line 3: nine, 0\.8 are not two numbers"),
        ("Oak,8,1.9,x\n", r"my materials\.csv, line 2: emissivity 1\.9 is outside"),
        ("Water,8,0.9,x\n", r"my materials\.csv, line 2: 'Water' comes with the add-on"),
        ("Oak,8,0.9,x\noak,9,0.9,x\n", r"my materials\.csv, line 3: 'oak' comes with the add-on or is listed twice"),
        ("Oak,8,0.9\n", r"my materials\.csv, line 2: expected"),
        ("\x00\x01", r"my materials\.csv, line 2"),
    ],
)
def test_a_damaged_file_is_named_and_left_out(own_file, caplog, text, message):
    own_file.write_text("material,wavelength_um,emissivity,source\n" + text, encoding="utf-8")
    assert re.search(message, library.user_problem())
    assert library.materials() == MATERIALS
    assert re.search(message, caplog.text)
    assert library.find("Water") is MATERIALS["Water"].points
    with pytest.raises(KeyError) as caught:
        library.find("Oak")
    assert re.search(message, caught.value.args[0])
    with pytest.raises(library.LibraryError, match=message):  # what is left of the file is not overwritten
        library.add_user_material("Beech", CURVE, "")


def test_without_a_place_nothing_is_kept(monkeypatch, tmp_path):
    monkeypatch.delenv(library.USER_VARIABLE, raising=False)
    with pytest.raises(OSError, match=library.USER_VARIABLE):
        library.add_user_material("Oak", CURVE, "")
    (tmp_path / "file").write_text("a file, not a folder")
    monkeypatch.setenv(library.USER_VARIABLE, str(tmp_path / "file" / "my.csv"))
    with pytest.raises(library.LibraryError, match="file"):
        library.add_user_material("Oak", CURVE, "")


def test_the_folder_is_made_when_there_is_something_to_keep(monkeypatch, tmp_path):
    path = tmp_path / "datafiles" / "infrared_photons" / "my.csv"
    monkeypatch.setenv(library.USER_VARIABLE, str(path))
    assert library.user_materials() == {} and not list(tmp_path.iterdir())
    library.add_user_material("Oak", CURVE, "")
    assert path.exists() and list(library.user_materials()) == ["Oak"]


def test_a_file_at_the_earlier_place_is_copied_once_and_stays(tmp_path):
    earlier, path = tmp_path / "library" / "my.csv", tmp_path / "data" / "infrared_photons" / "my.csv"
    earlier.parent.mkdir()
    library.copy_once(earlier, path)
    assert not path.parent.exists()  # there was nothing to copy
    earlier.write_text("whatever the artist has, even damaged")
    library.copy_once(earlier, path)
    assert path.read_bytes() == earlier.read_bytes() == b"whatever the artist has, even damaged"
    path.unlink()
    library.copy_once(earlier, path)
    assert not path.exists()  # the artist wanted it away


def test_no_copy_replaces_a_file_of_the_artist(tmp_path):
    earlier, path = tmp_path / "library" / "my.csv", tmp_path / "my.csv"
    earlier.parent.mkdir()
    earlier.write_text("old")
    path.write_text("mine")
    library.copy_once(earlier, path)
    assert (earlier.read_text(), path.read_text()) == ("old", "mine")
