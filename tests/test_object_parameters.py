# SPDX-License-Identifier: GPL-3.0-or-later
"""Object parameters by ISO 18434-1: forwards and back, the air's transmission, and what makes no sense."""

import numpy as np
import pytest

from addon.measuring.correcting import Sensor, corrected, corrected_noise
from addon.measuring.object_parameters import (
    ObjectParameters,
    camera_air_transmission,
    gas_transmission,
    vapour_density,
)
from addon.solver import Correction, Film
from addon.solver.physics import sensors
from addon.solver.physics.aerosols import mix_in
from addon.solver.physics.gases import find_gas
from addon.solver.physics.humidity import saturation_pressure
from addon.solver.physics.spectrum import apparent_temperature, sensor_radiance, uniform_edges
from addon.solver.scene import Medium, SceneError

EDGES = uniform_edges(7.5, 13.0, 11)
SENSORS = {"ideal": np.ones(11), "bolometer": sensors.band_weights(sensors.microbolometer(), EDGES)}
R = 8.314462618  # J/(mol K), CODATA
WATER = 18.01528  # g/mol


def random_parameters(rng) -> ObjectParameters:
    """Those of a camera that works near room temperature, with losses up to nine tenths in each place."""
    emissivity, air, optics = rng.uniform(0.1, 1.0, 3)
    reflected, of_air, of_optics = rng.uniform(230.0, 330.0, 3)
    return ObjectParameters(
        emissivity, reflected, air_temperature=of_air, air_transmission=air,
        optics_transmission=optics, optics_temperature=of_optics,
    )  # fmt: skip


def seen(kelvin, parameters, weights):
    """Radiance of grey objects by the standard, written out term by term: emitted, reflected, of the air, of optics."""

    def black(at):
        return sensor_radiance(EDGES, weights, at)

    e, air, optics = parameters.emissivity, parameters.air_transmission, parameters.optics_transmission
    total = e * air * optics * black(kelvin)
    total = total + (1 - e) * air * optics * black(parameters.reflected_temperature)
    total = total + (1 - air) * optics * black(parameters.air_temperature)
    return total + (1 - optics) * black(parameters.optics_temperature)


# Forwards and back


@pytest.mark.parametrize("sensor", SENSORS)
def test_an_objects_temperature_comes_back(sensor):
    """200 sets of parameters, objects from 220 K to 1500 K: within 1 mK. float32 of 1500 K is 0.06 mK."""
    weights, rng = SENSORS[sensor], np.random.default_rng(1)
    kelvin, worst = np.geomspace(220.0, 1500.0, 60), 0.0
    for _ in range(200):
        parameters = random_parameters(rng)
        found = corrected(seen(kelvin, parameters, weights), Sensor(EDGES, weights), parameters.correction)
        worst = max(worst, np.abs(found - kelvin).max())
    print(f"{sensor}: at most {1000.0 * worst:.2g} mK")
    assert worst < 1e-3


def test_without_air_and_optics_it_is_the_older_correction_to_the_last_bit():
    """(L - (1 - e) L(reflected)) / e, as it was before air and optics were known."""
    weights = SENSORS["bolometer"]
    radiance = sensor_radiance(EDGES, weights, np.linspace(280.0, 400.0, 50))
    for emissivity, reflected in ((1.0, 293.15), (0.8, 280.0), (0.35, 301.5)):
        older = (radiance - (1.0 - emissivity) * sensor_radiance(EDGES, weights, reflected)) / emissivity
        np.testing.assert_array_equal(
            Correction(emissivity, reflected).object_radiance(radiance, EDGES, weights), older
        )
        found = corrected(radiance, Sensor(EDGES, weights), ObjectParameters(emissivity, reflected).correction)
        np.testing.assert_array_equal(found, apparent_temperature(older, EDGES, weights).astype(np.float32))


def test_a_film_corrects_by_the_same_function():
    """One place: the temperatures that a render delivers are those that follow from its radiance."""
    weights, parameters = SENSORS["bolometer"], random_parameters(np.random.default_rng(2))
    kelvin = np.linspace(250.0, 500.0, 40)
    film = Film(len(kelvin), 1, EDGES, 0.0, weights=weights)
    bands = np.zeros((len(kelvin), 11))
    bands[:, 4] = seen(kelvin, parameters, weights) / weights[4]
    film.add_pass(bands.astype(np.float32), np.zeros(len(kelvin), np.float32), 0)
    film.correction = parameters.correction
    expected = corrected(film.radiance(), Sensor(EDGES, weights), parameters.correction)
    np.testing.assert_allclose(film.temperature(), expected, rtol=0, atol=1e-3)
    np.testing.assert_allclose(film.temperature()[0], kelvin, rtol=0, atol=5e-3)  # radiance is rounded to float32


def test_the_noise_follows_the_parameters():
    """From what one correction says of the error to what another says of it; a film of the same passes knows both."""
    sensor, rng = Sensor(EDGES, SENSORS["bolometer"]), np.random.default_rng(3)
    film = Film(20, 20, EDGES, 290.0, weights=sensor.weights)
    for _ in range(30):
        film.add_pass(rng.normal(0.02, 0.01, (400, 11)).astype(np.float32), np.zeros(400, np.float32), 0)
    stated = ObjectParameters(0.9, 285.0).correction
    wanted = ObjectParameters(0.5, 285.0, air_transmission=0.9, optics_transmission=0.8).correction
    film.correction = stated
    before = film.temperature(), film.noise()
    film.correction = wanted
    found = corrected_noise(before, film.temperature(), sensor, (stated, wanted))
    np.testing.assert_allclose(found, film.noise(), rtol=1e-3)  # the errors are small, so that the slope is one


# Air


def test_the_formula_by_hand():
    """20 deg C, 50 %: the vapour's logarithm is 1.5587 + 1.3878 - .111264 + .0054764 = 2.8407124, so 8.56398 g/m3 with
    the root 2.926428. Over 1 m the exponents are -(.006569 - .002276 * 2.926428) = 9.15501e-5 and
    -(.01262 - .00667 * 2.926428) = 6.899275e-3; 1.9 * 1.00009155 - .9 * 1.00692313 = .99394313."""
    assert vapour_density(293.15, 0.5) == pytest.approx(8.56398, rel=1e-5)
    assert camera_air_transmission(1.0, 293.15, 0.5) == pytest.approx(0.99394313, abs=1e-7)
    assert ObjectParameters(air_transmission=None).correction.air_transmission == pytest.approx(0.99394313, abs=1e-7)


def test_the_vapour_is_that_of_the_weather():
    """The polynomial gives g/m3: p M / (R T) by Magnus' formula, from 0 to 40 deg C within 3 %."""
    kelvin = np.linspace(273.15, 313.15, 41)
    density = np.array([saturation_pressure(each) for each in kelvin]) * WATER / (R * kelvin)
    np.testing.assert_allclose(vapour_density(kelvin, 1.0), density, rtol=0.03)


def test_air_lets_less_through_the_farther_and_the_damper():
    distance, humidity = np.geomspace(0.01, 1000.0, 60), np.linspace(0.0, 1.0, 21)
    for celsius in (-20.0, 0.0, 20.0, 30.0):
        through = camera_air_transmission(distance[:, None], celsius + 273.15, humidity)
        assert np.all(np.diff(through, axis=0) < 0.0) and np.all(np.diff(through, axis=1) < 0.0)
    assert camera_air_transmission(0.0, 293.15, 0.5) == 1.0


@pytest.mark.parametrize("humidity, celsius", [(0.3, 20), (0.5, 20), (0.8, 30)])
def test_the_gas_of_a_world_is_near_the_formula(humidity, celsius):
    """Air of the library over 10 and 100 m: the cameras' formula and narrow bands agree within 4 % of the whole."""
    contents = find_gas(f"Air, {celsius} C, {humidity:.0%} humidity".replace("%", " %"))
    air = mix_in(Medium("air", temperature=celsius + 273.15), contents)
    for distance in (10.0, 100.0):
        own = gas_transmission(air, distance, EDGES, SENSORS["bolometer"], 300.0)
        theirs = camera_air_transmission(distance, celsius + 273.15, humidity)
        print(f"{distance:g} m, {celsius} C, {humidity:.0%}: {own:.4f} of the gas, {theirs:.4f} of the formula")
        assert own == pytest.approx(theirs, abs=0.04)


def test_grey_gas_lets_an_exponential_through():
    gas = Medium("grey", absorption=0.05, temperature=280.0)
    assert gas_transmission(gas, 7.0, EDGES, SENSORS["ideal"], 300.0) == pytest.approx(np.exp(-0.35), rel=1e-12)


# Mistakes


@pytest.mark.parametrize(
    "values, message",
    [
        ({"emissivity": 0.0}, "emissivity is 0, expected above 0 to 1"),
        ({"air_transmission": 0.0}, "air_transmission is 0"),
        ({"air_transmission": 1.2}, "air_transmission is 1.2"),
        ({"optics_transmission": float("nan")}, "optics_transmission is nan"),
        ({"optics_temperature": -1.0}, "optics_temperature: temperature -1 K"),
        ({"distance": -2.0}, "distance is -2 m"),
        ({"relative_humidity": 1.5}, "relative_humidity is 150 %"),
        ({"air_transmission": None, "distance": 2000.0, "air_temperature": 313.15, "relative_humidity": 1.0},
         "no meaning at a distance of 2000 m through air of 313.15 K and 100 %"),
    ],
)  # fmt: skip
def test_senseless_parameters_are_named(values, message):
    with pytest.raises(SceneError, match=message):
        ObjectParameters(**values)
