# SPDX-License-Identifier: GPL-3.0-or-later
"""Sensors: their responses, what bands count in them, and temperatures read from what they see."""

import dataclasses

import numpy as np
import pytest

from addon.reading.spectra import SpectrumError, read_response
from addon.solver import Correction, Film, Material, Response, SceneError, Settings, render
from addon.solver.checkpoint import fingerprint
from addon.solver.physics import sensors
from addon.solver.physics.spectrum import apparent_temperature, band_radiance, planck, sensor_radiance, uniform_edges
from tests.helpers.scenes import box, look, make_scene, quad

SENSORS = {name: make() for name, make in sensors.BUILT_IN.items()} | {"BOX": None}
RANGES = {"INSB": (3.0, 5.0), "HGCDTE": (8.0, 11.5), "MICROBOLOMETER": (7.5, 14.0), "BOX": (7.5, 14.0)}
EDGES = uniform_edges(7.5, 14.0, 8)
CAMERA = look((0.5, 0.5, 0.5), (1.0, 0.6, 0.4), 4, 3, 0.8)
QUICK = Settings(passes=2, photons_per_pass=1000)
RAMP = Response("Ramp", np.array([[7.0, 0.0], [15.0, 3.0]]))
BOTH = pytest.mark.parametrize("subtraction", [True, False], ids=["subtraction", "none"])


def room(kelvin=300.0, emissivity=1.0, edges=EDGES, **options):
    return make_scene(*box(), kelvin, [Material("wall", emissivity)], CAMERA, edges, **options)


def film_of(passes, seen=None, weights=None, reference=290.0, **options):
    """A film of one row of pixels with these passes (n, pixels, b)."""
    film = Film(passes.shape[1], 1, EDGES, reference, weights=weights, **options)
    for i, excess in enumerate(passes):
        film.add_pass(excess, np.zeros(len(excess), np.float32) if seen is None else seen[i], 0)
    return film


def random_passes(count, pixels=500, seed=3):
    """Excess radiance (count, pixels, b) float32: 0.5 of the excess at 310 K over 290 K with noise of 20 % of it."""
    rng = np.random.default_rng(seed)
    excess = band_radiance(EDGES, 310.0) - band_radiance(EDGES, 290.0)
    return (excess * (0.5 + 0.2 * rng.normal(size=(count, pixels, len(excess))))).astype(np.float32)


# The target: isothermal black scenes


@BOTH
@pytest.mark.parametrize("name", SENSORS)
def test_an_isothermal_black_scene_has_its_temperature(name, subtraction):
    """To 1 mK from 200 K to 2000 K, with the reference temperature that is chosen and without any."""
    edges = uniform_edges(*RANGES[name], 16)
    for kelvin in (200.0, 300.0, 700.0, 2000.0):
        scene = room(kelvin, edges=edges, response=SENSORS[name])
        film = render(scene, dataclasses.replace(QUICK, reference_subtraction=subtraction))
        np.testing.assert_allclose(film.temperature(), kelvin, rtol=0, atol=1e-3)


@pytest.mark.parametrize("name", SENSORS)
def test_the_calibration_is_inverted(name):
    """Against the sum over bands itself, at all temperatures."""
    kelvin = np.geomspace(200.0, 2000.0, 200)
    edges = uniform_edges(*RANGES[name], 16)
    weights = sensors.band_weights(SENSORS[name], edges)
    seen = band_radiance(edges, kelvin) @ weights
    np.testing.assert_allclose(apparent_temperature(seen, edges, weights), kelvin, rtol=1e-9)


# Responses and weights


@pytest.mark.parametrize(
    "name, peak, half",
    [
        # Gap energies of the semiconductors, eV, as h c / E in um: the response over the wavelength is half there.
        ("INSB", (5.1, 5.45), 1.2398 / 0.2273),
        ("HGCDTE", (9.5, 10.75), 1.2398 / 0.1153),
        ("MICROBOLOMETER", (9.0, 11.0), 13.5),
    ],
)
def test_built_in_responses(name, peak, half):
    wavelengths, values = SENSORS[name].curve
    assert values.max() == 1.0 and values.min() == 0.0 and values[0] == values[-1] == 0.0
    assert peak[0] < wavelengths[values.argmax()] < peak[1]
    level = values if name == "MICROBOLOMETER" else values / wavelengths
    long = wavelengths > wavelengths[values.argmax()]
    at = np.interp(-0.5 * level[wavelengths < half - 0.8].max(), -level[long], wavelengths[long])
    assert at == pytest.approx(half, abs=0.06)  # three steps of the curve; the bolometer's absorber falls there, too


def test_a_photon_detector_counts_photons():
    """Far below its cutoff: twice the wavelength, twice the photons in a watt."""
    curve = SENSORS["INSB"].curve
    assert np.interp(4.0, *curve) / np.interp(2.0, *curve) == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("name", SENSORS)
def test_weights_are_means_over_the_band(name):
    """Against a sum over many wavelengths. The curve is linear between points 0.02 um apart; the sum errs less."""
    edges = uniform_edges(*RANGES[name], 8)
    weights = sensors.band_weights(SENSORS[name], edges)
    for low, high, weight in zip(edges[:-1], edges[1:], weights, strict=True):
        wavelength = low + (high - low) * (np.arange(20_000) + 0.5) / 20_000
        black = planck(wavelength, 300.0)
        response = 1.0 if SENSORS[name] is None else np.interp(wavelength, *SENSORS[name].curve)
        assert weight == pytest.approx(np.sum(black * response) / black.sum(), rel=1e-6, abs=1e-12)


def test_a_response_has_no_scale():
    scaled = Response("Ramp", RAMP.points * (1.0, 7.0))
    np.testing.assert_allclose(sensors.band_weights(scaled, EDGES), sensors.band_weights(RAMP, EDGES), rtol=1e-12)


def test_a_response_is_zero_outside():
    """A measured one that ends high inside a band: the weight is the part of the band's radiance below its end."""
    edges = np.array([8.0, 10.0, 12.0, 14.0])
    weights = sensors.band_weights(Response("cut", np.array([[7.0, 1.0], [11.0, 1.0]])), edges)
    part = band_radiance(np.array([10.0, 11.0]), 300.0)[0] / band_radiance(np.array([10.0, 12.0]), 300.0)[0]
    np.testing.assert_allclose(weights, [1.0, part, 0.0], rtol=1e-7, atol=1e-12)


def test_the_share_outside_the_bands():
    flat = Response("flat", np.array([[5.0, 1.0], [20.0, 1.0]]))
    parts = band_radiance(np.array([5.0, 8.0, 14.0, 20.0]), 300.0)
    lost = sensors.share_outside(flat, 8.0, 14.0, 300.0)
    assert lost == pytest.approx(1.0 - parts[1] / parts.sum(), rel=1e-6)
    assert sensors.share_outside(flat, 4.0, 30.0, 300.0) == pytest.approx(0.0, abs=1e-9)
    assert sensors.share_outside(flat, 30.0, 40.0, 300.0) == 1.0


# Films


def test_a_flat_response_changes_no_bit():
    passes, flat = random_passes(5), Response("flat", np.array([[1.0, 2.0], [100.0, 2.0]]))
    weights = sensors.band_weights(flat, EDGES)
    assert np.all(weights == 1.0)
    plain, weighted = film_of(passes), film_of(passes, weights=weights)
    for name in ("radiance", "temperature", "noise"):
        np.testing.assert_array_equal(getattr(plain, name)(), getattr(weighted, name)())


def test_a_response_changes_no_band():
    scene = room(320.0, 0.5, world_temperature=300.0)
    plain, seen = (render(dataclasses.replace(scene, response=response), QUICK) for response in (None, RAMP))
    np.testing.assert_array_equal(plain.bands(), seen.bands())
    weights = sensors.band_weights(RAMP, EDGES)
    expected = np.tensordot(weights * np.diff(EDGES), seen.bands().astype(float), 1)
    np.testing.assert_allclose(seen.radiance(), expected, rtol=3e-7)  # bands and sum are rounded to float32


def test_noise_is_that_of_the_weighted_sum():
    weights = sensors.band_weights(RAMP, EDGES)
    passes = random_passes(40)
    film = film_of(passes, weights=weights)
    film.estimated[:] = False  # each pixel tells its own noise
    total = passes.astype(float) @ weights
    mean = total.mean(axis=0) + sensor_radiance(EDGES, weights, 290.0)
    error = total.std(axis=0, ddof=1) / np.sqrt(len(total))
    half = 0.5 * (
        apparent_temperature(mean + error, EDGES, weights) - apparent_temperature(mean - error, EDGES, weights)
    )
    np.testing.assert_allclose(film.noise()[0], half, rtol=1e-5)  # of a difference of float64 temperatures, in float32


def test_noise_of_what_is_seen_falls_faster():
    """A pixel that holds an edge between blackbodies: the error of its weighted radiance falls as m^-3/4."""
    weights = sensors.band_weights(RAMP, EDGES)
    edge = band_radiance(EDGES, 330.0) - band_radiance(EDGES, 300.0)
    share = np.random.default_rng(5).random((64, 300, 1))
    passes = (edge * share).astype(np.float32)
    film = film_of(passes, seen=(passes @ weights).astype(np.float32), weights=weights)
    total = (edge @ weights) * share[..., 0]
    error = total.std(axis=0, ddof=1) / len(total) ** 0.75
    mean = total.mean(axis=0) + sensor_radiance(EDGES, weights, 290.0)
    half = 0.5 * (
        apparent_temperature(mean + error, EDGES, weights) - apparent_temperature(mean - error, EDGES, weights)
    )
    np.testing.assert_allclose(film.noise()[0], half, rtol=1e-3)


def test_merged_films_are_the_film_of_all_passes():
    weights = sensors.band_weights(RAMP, EDGES)
    passes = random_passes(20)
    seen = (0.3 * passes.sum(axis=2)).astype(np.float32)
    whole = film_of(passes, seen, weights)
    parts = film_of(passes[:7], seen[:7], weights), film_of(passes[7:], seen[7:], weights, first_pass=7)
    for film in (whole, *parts):
        film.correction = Correction(0.8, 280.0)
    merged = parts[0].merge(parts[1])
    for name in ("radiance", "temperature", "noise"):
        np.testing.assert_allclose(getattr(merged, name)(), getattr(whole, name)(), rtol=1e-6)


def test_films_of_different_sensors_do_not_merge():
    weights = sensors.band_weights(RAMP, EDGES)
    with pytest.raises(ValueError, match="different responses"):
        film_of(random_passes(2)).merge(film_of(random_passes(2), weights=weights, first_pass=2))


def test_a_state_keeps_the_response():
    weights = sensors.band_weights(RAMP, EDGES)
    film = film_of(random_passes(3), weights=weights)
    again = Film.from_state(film.state())
    np.testing.assert_array_equal(again.weights, weights)
    np.testing.assert_array_equal(again.radiance(), film.radiance())
    for bad in (weights[:-1], weights * np.nan, -weights, 0.0 * weights):
        with pytest.raises(ValueError, match="weights"):
            Film.from_state(film.state() | {"weights": bad})


def test_fingerprints_know_the_response_and_not_the_correction():
    scene = room()
    plain = fingerprint(scene, QUICK)
    assert fingerprint(dataclasses.replace(scene, response=RAMP), QUICK) != plain
    corrected = dataclasses.replace(QUICK, assumed_emissivity=0.5, reflected_temperature=250.0)
    assert fingerprint(scene, corrected) == plain


# Correction


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("emissivity", [0.05, 0.5, 0.95])
def test_the_correction_gives_back_the_temperature(name, emissivity):
    """Grey surfaces from 250 K to 1500 K in black surroundings at 290 K, as float64 radiance: exact in every band."""
    edges = uniform_edges(*RANGES[name], 8)
    weights = sensors.band_weights(SENSORS[name], edges)
    kelvin = np.geomspace(250.0, 1500.0, 40)
    excess = emissivity * (band_radiance(edges, kelvin) - band_radiance(edges, 290.0))
    film = Film(len(kelvin), 1, edges, 290.0, weights=weights)
    film.add_pass(excess, np.zeros(len(kelvin), np.float32), 0)
    film.correction = Correction(emissivity, 290.0)
    # B(290 K) is rounded to float32, 6e-8 of it. What it is of the object's radiance grows where the object is cold:
    slope = sensor_radiance(edges, weights, kelvin, derivative=True) / kelvin
    rounding = 6e-8 * sensor_radiance(edges, weights, 290.0) / emissivity / slope + 6e-8 * kelvin
    assert np.all(np.abs(film.temperature()[0] - kelvin) < 1.5 * rounding)


def test_a_render_corrects_as_a_camera_does():
    """A grey floor under a sky, through a real sensor: its own temperature comes out, not the apparent one.

    Only the sky lights it, which four rays look for in each pass. All of them leave, so there is no noise.
    """
    floor = quad((0, 0, 0), (50, 0, 0), (0, 50, 0))
    scene = make_scene(
        *floor, 320.0, [Material("floor", 0.7)], look((0, 0, 1), (0.1, 0, 0), 4, 3, 0.3), EDGES,
        world_temperature=260.0, response=SENSORS["MICROBOLOMETER"],
    )  # fmt: skip
    settings = dataclasses.replace(QUICK, passes=4, assumed_emissivity=0.7, reflected_temperature=260.0)
    film = render(scene, settings)
    assert np.all(film.noise() < 1e-3)
    np.testing.assert_allclose(film.temperature(), 320.0, rtol=0, atol=2e-3)
    film.correction = Correction()
    assert np.all(film.temperature() < 310.0)


def test_a_corrected_noise_is_the_spread_of_corrected_temperatures():
    """2000 pixels of 30 passes each: their spread is known to 1 / sqrt(2 * 2000), 1.6 %; three such errors.

    The noise is small against the temperature, so that the calibration is straight over it.
    """
    weights = sensors.band_weights(RAMP, EDGES)
    film = film_of(random_passes(30, pixels=2000), weights=weights)
    film.correction = Correction(0.4, 285.0)
    spread = film.temperature()[0].std(dtype=float)
    assert np.sqrt(np.mean(film.noise()[0].astype(float) ** 2)) == pytest.approx(spread, rel=3 * 0.016)


def test_too_much_reflection_is_no_temperature():
    """The surroundings alone would send more than was seen: 0 K, no NaN, and a finite noise."""
    film = film_of(random_passes(10))
    film.correction = Correction(0.1, 400.0)
    assert np.all(film.temperature() == 0.0)
    assert np.all(np.isfinite(film.noise())) and np.all(film.noise() >= 0.0)


def test_a_correction_changes_neither_bands_nor_radiance():
    film = film_of(random_passes(4))
    before = film.bands(), film.radiance()
    film.correction = Correction(0.5, 250.0)
    np.testing.assert_array_equal(film.bands(), before[0])
    np.testing.assert_array_equal(film.radiance(), before[1])


# Mistakes


@pytest.mark.parametrize(
    "points, message",
    [
        ([[8.0, 1.0]], "two or more"),
        ([8.0, 1.0], "two or more"),
        ([[8.0, 1.0], [7.0, 1.0]], "8 um is followed by 7 um"),
        ([[0.0, 1.0], [7.0, 1.0]], "response at 0 um"),
        ([[8.0, 1.0], [9.0, -0.1]], "response -0.1"),
        ([[8.0, 1.0], [9.0, np.nan]], "response nan"),
        ([[8.0, 0.0], [9.0, 0.0]], "0 at every wavelength"),
    ],
)
def test_a_senseless_response_is_told(points, message):
    with pytest.raises(SceneError, match=f"Sensor 'mine'.*{message}"):
        Response("mine", np.array(points))


@pytest.mark.parametrize("points", [[[3.0, 1.0], [7.5, 1.0]], [[14.0, 1.0], [20.0, 1.0]], [[7.0, 1.0], [7.5, 0.0]]])
def test_a_sensor_that_sees_nothing_is_told(points):
    with pytest.raises(SceneError, match="Sensor 'blind' does not respond between 7.5 and 14 um"):
        room(response=Response("blind", np.array(points)))


@pytest.mark.parametrize("settings", [{"assumed_emissivity": 0.0}, {"assumed_emissivity": 1.1}])
def test_a_senseless_emissivity_is_told(settings):
    with pytest.raises(ValueError, match="assumed_emissivity"):
        Settings(**settings)


def test_a_senseless_reflected_temperature_is_told():
    with pytest.raises(ValueError, match="reflected_temperature"):
        Settings(reflected_temperature=-1.0)


# Files


def test_a_table_is_a_response(tmp_path):
    path = tmp_path / "camera.csv"
    path.write_text("# measured\nwavelength (um); response (A/W)\n9; 2.0\n7; -0.01\n8; 1.5\n\n10; 0\n")
    np.testing.assert_array_equal(read_response(path), [[7, 0], [8, 1.5], [9, 2], [10, 0]])


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "empty"),
        ("# nothing\n", "only comments"),
        ("8 1\n", "two points or more"),
        ("8 1\n9 2 3\n", "line 2: '9 2 3'"),
        ("8 1\n8 2\n", "line 2: wavelength 8 um stands in line 1"),
        ("8000 1\n9000 1\n", "line 1: wavelength 8000 is outside"),
        ("wavelength (nm), response\n8 1\n9 1\n", "line 1: the titles .* nanometres"),
        ("8 1\n9 -0.5\n", "line 2: response -0.5"),
        ("8 1\n9 nan\n", "line 2: response nan"),
        ("8 1\n9 inf\n", "response inf"),
        ("8 0\n9 0\n", "0 at every wavelength"),
    ],
)
def test_a_file_that_is_no_response_is_told(tmp_path, text, message):
    path = tmp_path / "camera.csv"
    path.write_text(text)
    with pytest.raises(SpectrumError, match=message) as error:
        read_response(path)
    assert str(path) in str(error.value)


def test_a_damaged_table_is_a_response_or_named(tmp_path):
    """With one to three bytes changed, or cut off anywhere."""
    whole = b"wavelength, response\n7,0\n8.5,0.9\n13,0.8\n14,0\n"
    path, rng, refused = tmp_path / "camera.csv", np.random.default_rng(7), 0
    for _ in range(500):
        damaged = bytearray(whole[: rng.integers(1, len(whole))] if rng.random() < 0.2 else whole)
        for place in rng.integers(len(damaged), size=rng.integers(1, 4)):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            Response("camera", read_response(path))
        except SpectrumError as error:
            assert str(path) in str(error)
            refused += 1
    assert 100 < refused < 500
