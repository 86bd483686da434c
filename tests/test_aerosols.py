# SPDX-License-Identifier: GPL-3.0-or-later
"""Aerosols: Mie's theory against published values, the tables of the library, and what the camera sees of fog."""

import math

import numpy as np
import pytest

from addon.solver import Material, Medium, SceneError, Settings, mix_in, render
from addon.solver.physics.aerosols import aerosols
from addon.solver.physics.gases import find_gas, gases
from addon.solver.physics.media import band_anisotropy, build_medium_table
from addon.solver.physics.soot import soot_curve
from addon.solver.physics.spectrum import band_radiance
from docs.tools.mie import aggregate, efficiencies
from tests.helpers.scenes import box, look, make_scene, mean_and_error

DROPLETS = {radius: f"Water droplets {radius} um" for radius in (1, 2, 5, 10, 20)}


def at(name, wavelength):
    """Extinction, m2/g, single-scattering albedo and asymmetry of an aerosol of the library."""
    table = aerosols()[name]
    absorption, scattering, asymmetry = (np.interp(wavelength, table[:, 0], column) for column in table.T[1:])
    return absorption + scattering, scattering / (absorption + scattering), asymmetry


@pytest.mark.parametrize("index, size, expected", [
    (1.5 + 1.0j, 1.0, (2.336321, 0.663454, 0.192136)),
    (1.5 + 1.0j, 100.0, (2.097502, 1.283697, 0.850252)),
    (1.33 + 1e-5j, 1.0, (0.093952, 0.093923, 0.184517)),
    (1.33 + 1e-5j, 100.0, (2.101321, 2.096594, 0.868959)),
    (10.0 + 10.0j, 1.0, (2.532993, 2.049405, -0.110664)),
    (10.0 + 10.0j, 100.0, (2.071124, 1.836785, 0.556215)),
])  # fmt: skip
def test_mie_series(index, size, expected):
    """W. J. Wiscombe, Mie scattering calculations, NCAR/TN-140+STR (1979), test cases: extinction, scattering, g; small
    spheres beside them in the same call."""
    found = [each[-1] for each in efficiencies(np.array([0.01, 0.3, size]), index)]
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_limits_of_mie_series():
    """Small spheres: absorption and scattering of dipoles (Bohren and Huffman, section 5.1). Large ones: twice the
    shadow, by the theory of diffraction, to the edge's part, which goes as size^(-2/3)."""
    index = 1.59 + 0.66j
    contrast = (index**2 - 1.0) / (index**2 + 2.0)
    extinction, scattering, asymmetry = (float(each[0]) for each in efficiencies(np.array([0.01]), index))
    assert extinction - scattering == pytest.approx(0.04 * contrast.imag, rel=1e-3)
    assert scattering == pytest.approx(8.0 / 3.0 * 1e-8 * abs(contrast) ** 2, rel=1e-3)
    assert abs(asymmetry) < 1e-3
    large = np.array([100.0, 1000.0])
    beyond = efficiencies(large, 1.33 + 0.1j)[0] - 2.0
    assert 0.0 < beyond[1] < 0.03 and beyond[1] / beyond[0] == pytest.approx(10.0 ** (-2.0 / 3.0), rel=0.05)


def test_an_aggregate_of_one_sphere_is_a_small_sphere():
    index = 1.9 + 0.8j
    for whole, alone in zip(aggregate(0.01, index, 1.0, 0.0), efficiencies(np.array([0.01]), index), strict=True):
        assert whole == pytest.approx(float(alone[0]), rel=1e-3, abs=1e-3)


@pytest.mark.parametrize("wavelength, albedo, asymmetry, extinction", [
    (4.0, 0.95, 0.78, None), (10.0, 0.61, 0.82, 172.0), (12.0, 0.25, 0.77, None),
])  # fmt: skip
def test_droplets_of_5_um(wavelength, albedo, asymmetry, extinction):
    """Values for spheres of one size, computed apart from these; of the library's, of sizes around it, to 0.02."""
    found = at("Water droplets 5 um", wavelength)
    print(f"{wavelength} um: {found[0] * 1e3:.1f} 1/km for 1 g/m3, albedo {found[1]:.3f}, g {found[2]:.3f}")
    assert found[1] == pytest.approx(albedo, abs=0.01) and found[2] == pytest.approx(asymmetry, abs=0.02)
    assert extinction is None or found[0] * 1e3 == pytest.approx(extinction, rel=0.01)


@pytest.mark.parametrize("wavelength, n, k, albedo, asymmetry, extinction", [
    (4.0, 1.351, 0.0046, 0.95, 0.78, None),
    (10.0, 1.218, 0.0508, 0.61, 0.82, 172.0),
    (12.0, 1.111, 0.199, 0.245, 0.77, None),
])  # fmt: skip
def test_droplets_of_one_size(wavelength, n, k, albedo, asymmetry, extinction):
    """The same values to their rounding, from the refractive index of Hale and Querry (1973)."""
    total, scattered, g = (float(each[0]) for each in efficiencies(np.array([10.0 * np.pi / wavelength]), n + 1j * k))
    assert scattered / total == pytest.approx(albedo, abs=0.005) and g == pytest.approx(asymmetry, abs=0.005)
    by_mass = 1e3 * 3.0 * total / (4.0 * 5.0)  # 1/km for 1 g/m3 of 1 g/cm3
    assert extinction is None or by_mass == pytest.approx(extinction, rel=0.003)


def test_tables_make_sense():
    for name, table in aerosols().items():
        wavelength, absorption, scattering, asymmetry = table.T
        assert np.all(np.diff(wavelength) > 0.0), name
        assert (wavelength[0], wavelength[-1]) == (0.8, 30.0), name
        assert np.all(absorption >= 0.0) and np.all(scattering >= 0.0) and np.all(np.abs(asymmetry) <= 1.0), name


def test_large_droplets_take_twice_their_shadow():
    """3 / (2 density radius), where they are large against the wavelength: within 5 %."""
    for radius in (10, 20):
        assert at(DROPLETS[radius], 0.8)[0] == pytest.approx(1.5 / radius, rel=0.08)


def test_soot_aggregates_absorb_as_soot_by_volume():
    """A gram of 1.8 g/cm3: within the 1 % of the tables, apart from what aggregates scatter."""
    wavelength, by_volume = soot_curve()
    for name in ("Soot, small aggregates", "Soot, large aggregates"):
        inside = (wavelength > 0.8) & (wavelength < 30.0)
        table = aerosols()[name]
        absorption = np.interp(wavelength, table[:, 0], table[:, 1])
        np.testing.assert_allclose(absorption[inside], by_volume[inside] * 1e-6 / 1.8, rtol=0.015)
    assert at("Soot, small aggregates", 4.0)[1] < 0.01 < at("Soot, large aggregates", 4.0)[1]


def test_contents_add_to_a_medium():
    """Letter case ignored; a scene in centimetres; g is weighted with what each part scatters."""
    base = Medium("air", 0.01, 280.0, np.array([[8.0, 0.0], [12.0, 0.04]]), 0.5, metres=0.01)
    medium = mix_in(base, {"H2O": 0.01, "soot": 1e-8, "water DROPLETS 5 um": 20.0, "Ice 10 um": 10.0})
    assert medium.gas == {"H2O": 0.01, "soot": 1e-8} and medium.scatters and medium.temperature == 280.0
    for wavelength in (8.0, 10.0, 11.3):
        drops, ice = (at(name, wavelength) for name in ("Water droplets 5 um", "Ice 10 um"))
        of_each = np.array([0.01 * (wavelength - 8.0), 0.2 * drops[0] * drops[1], 0.1 * ice[0] * ice[1]])
        absorbed = 0.01 + 0.2 * drops[0] * (1.0 - drops[1]) + 0.1 * ice[0] * (1.0 - ice[1])
        g = of_each @ (0.5, drops[2], ice[2]) / of_each.sum()
        found = [np.interp(wavelength, *medium.curve(each)) for each in ("absorption", "scattering", "anisotropy")]
        np.testing.assert_allclose(found, [absorbed, of_each.sum(), g], rtol=1e-3)


def test_without_aerosols_a_medium_keeps_its_numbers():
    medium = mix_in(Medium("air", 0.5, 300.0, 0.1, 0.2), {"CO2": 0.1})
    assert (medium.absorption, medium.scattering, medium.anisotropy, medium.gas) == (0.5, 0.1, 0.2, {"CO2": 0.1})


@pytest.mark.parametrize("contents, message", [
    ({"Water drops 5 um": 0.1}, r"Medium 'fog': unknown species 'Water drops 5 um'; .* close names: 'Water droplets 5"),
    ({"NH3": 0.1}, "Medium 'fog': unknown species 'NH3'; known are H2O"),
    ({"Ice 10 um": -0.1}, "Medium 'fog': -0.1 g/m3 of Ice 10 um; it is finite and at least 0"),
    ({"Ice 10 um": np.nan}, "Medium 'fog': nan g/m3 of Ice 10 um"),
    ({"CO2": 1.5}, "Medium 'fog': the fraction of CO2 is 1.5"),
])  # fmt: skip
def test_contents_that_make_no_sense_are_named(contents, message):
    with pytest.raises(SceneError, match=message):
        mix_in(Medium("fog", temperature=280.0), contents)


def test_named_mixtures_hold_aerosols():
    named = {name for mixture in gases().values() for name in mixture}
    assert "Water droplets 5 um" in named and named - {"H2O", "CO2", "CO", "CH4", "soot"} <= set(aerosols())
    assert find_gas("fog, DENSE")["Water droplets 10 um"] == 0.4


def fog(grams, kelvin, radius=5, **medium):
    return mix_in(Medium("fog", temperature=kelvin, **medium), {DROPLETS[radius]: grams})


def test_anisotropy_of_bands():
    """Means over what is scattered; one column in the table where no medium's differs."""
    edges, grey = np.array([3.0, 5.0, 8.0, 12.0]), Medium("a", 0.0, 300.0, 1.0, 0.25)
    found = band_anisotropy(fog(0.1, 300.0, 2), edges)
    np.testing.assert_allclose(found[[0, 2]], [at(DROPLETS[2], 4.3)[2], at(DROPLETS[2], 9.7)[2]], atol=0.04)
    assert build_medium_table((grey, grey), edges, 0.0, np.zeros(3)).anisotropy.tolist() == [[0.25], [0.25]]
    table = build_medium_table((grey, fog(0.1, 300.0, 2)), edges, 0.0, np.zeros(3))
    assert table.anisotropy.shape == (2, 3) and np.all(table.anisotropy[0] == 0.25)


@pytest.mark.long
def test_fog_of_one_temperature_is_black():
    """Without subtraction, several bands: mean within 4 standard errors; with it exactly."""
    edges = np.array([3.0, 5.0, 8.0, 12.0])
    vertices, triangles = box((2.0, 3.0, 2.5))
    scene = make_scene(
        vertices, triangles[:, ::-1], 350.0, [Material("grey", 0.3)], look((1, 0.2, 1.2), (1, 3, 1), 8, 6, 0.6), edges,
        world_depth=5.0, media=(fog(3.0, 350.0),),
    )  # fmt: skip
    assert np.all(np.abs(render(scene, Settings(passes=1)).temperature() - 350.0) < 1e-4)
    black = float(band_radiance(edges, 350.0).sum())
    mean, error = mean_and_error(scene, Settings(passes=10, photons_per_pass=10_000, reference_temperature=400.0))
    print(f"{mean / black - 1:+.3%} +- {error / mean:.3%}")
    assert abs(mean - black) < 4 * error and error < 0.01 * mean


@pytest.mark.once
@pytest.mark.long
def test_a_slab_of_fog():
    """A slab of droplets of 5 um at 10 um, an optical depth of 2, made endless by mirrors, over a black plate: what it
    lets through and what it shines, against a random walk of 4e5 photons with the library's albedo and g. 4 standard
    errors."""
    edges = np.array([9.95, 10.05])
    grams = 2.0 / at(DROPLETS[5], 10.0)[0]
    _, albedo, g = at(DROPLETS[5], 10.0)
    through, uncertain = walk_through(2.0, albedo, g, 400_000)
    vertices, triangles = box((1.0, 1.0, 1.0))
    materials = [Material("mirror", 0.0, 1.0), Material("black", 1.0)]
    temperature = np.repeat([0.0] * 4 + [400.0, 0.0], 2)
    scene = make_scene(
        vertices, triangles[:, ::-1], temperature, materials, look((0.5, 0.5, 1.0 - 1e-6), (0.5, 0.5, 0.0), 4, 3, 1e-3),
        edges, np.repeat([0, 0, 0, 0, 1, 1], 2), world_depth=1.0, media=(fog(grams, 0.0),),
    )  # fmt: skip
    mean, error = mean_and_error(scene, Settings(passes=400, photons_per_pass=1000))
    black = float(band_radiance(edges, 400.0)[0])
    print(f"{mean / black:.4f} +- {error / black:.4f}, walk {through:.4f} +- {uncertain:.4f}")
    assert error < 0.01 * black
    assert abs(mean / black - through) < 4 * math.hypot(error / black, uncertain) + 2e-3 * through


def walk_through(depth, albedo, g, count):
    """Share of light that leaves a slab of an optical depth at the far side, if it enters along the normal, and its
    standard error: by reciprocity what a camera sees of a black plate behind it."""
    rng = np.random.default_rng(1)
    z, mu, weight, passed = np.zeros(count), np.ones(count), np.ones(count), 0.0
    squares = 0.0
    while len(z):
        z = z + mu * rng.exponential(size=len(z))
        arrived = weight[z >= depth]
        passed, squares = passed + arrived.sum(), squares + (arrived**2).sum()
        inside = (z > 0.0) & (z < depth) & (weight > 1e-6)
        z, mu, weight = z[inside], mu[inside], weight[inside] * albedo
        s = (1.0 - g * g) / (1.0 - g + 2.0 * g * rng.random(len(z)))
        cosine = np.clip((1.0 + g * g - s * s) / (2.0 * g), -1.0, 1.0)
        across = np.sqrt((1.0 - cosine**2) * (1.0 - mu**2)) * np.cos(2.0 * np.pi * rng.random(len(z)))
        mu = mu * cosine + across
    return passed / count, math.sqrt(squares - passed**2 / count) / count


def test_coefficients_of_bands_are_means_over_them():
    medium = fog(0.1, 283.0)
    table = build_medium_table((medium,), np.array([8.0, 12.0]), 0.0, np.zeros(1))
    grid = np.linspace(8.0, 12.0, 2001)
    light = np.array([band_radiance(np.array([x, x + 1e-3]), 283.0)[0] for x in grid])
    for quantity in ("absorption", "scattering"):
        mean = light @ np.interp(grid, *medium.curve(quantity)) / light.sum()
        assert getattr(table, quantity)[0, 0] == pytest.approx(mean, rel=1e-3)
