# SPDX-License-Identifier: GPL-3.0-or-later
"""The clear sky from the weather: against published measurements, its normalisation, and what must rise with what."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import trapezoid

from addon.solver import SceneError
from addon.solver.physics.clear_sky import (
    DEW_POINTS,
    HOTTEST_AIR,
    WAVELENGTHS,
    ZENITH,
    band_temperatures,
    clear_sky,
    cloud_emissivity,
    sky_emissivity,
    vapour_factor,
)
from addon.solver.physics.constants import SIGMA
from addon.solver.physics.humidity import FREEZING, dew_point, relative_humidity, saturation_pressure
from addon.solver.physics.spectrum import planck

WEATHERS = ((250.0, 245.0), (273.15, 263.15), (283.15, 273.15), (288.15, 283.15), (300.15, 293.15))  # air, dew; K
ROUNDING = 1e-9  # K


def emitted(kelvin, zenith):
    """Radiance over all wavelengths, of a table linear in kelvin and held constant outside, over that of the air at
    the horizon. Zenith angles (n,) degrees; (n,)."""
    fine = np.geomspace(1.5, 2000.0, 8000)
    rows = [np.interp(zenith, ZENITH, column) for column in kelvin.T]
    found = [trapezoid(planck(fine, np.interp(fine, WAVELENGTHS, row)), fine) for row in np.transpose(rows)]
    return np.array(found) / (SIGMA * kelvin[-1, 0] ** 4 / np.pi)


# Humidity -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("celsius, pascals", [(0.01, 611.657), (10.0, 1228.2), (20.0, 2339.3), (30.0, 4247.0)])
def test_saturated_vapour(celsius, pascals):
    """Against the IAPWS (Wagner and Pruss 2002, J. Phys. Chem. Ref. Data 31, 387), within what Alduchov and Eskridge
    state of their formula."""
    assert saturation_pressure(FREEZING + celsius) == pytest.approx(pascals, rel=4e-3)


@pytest.mark.parametrize("air", [250.0, 283.15, 310.0])
@pytest.mark.parametrize("humidity", [0.03, 0.5, 1.0])
def test_humidity_and_dew_point_are_inverse(air, humidity):
    dew = dew_point(air, humidity)
    assert relative_humidity(air, dew) == pytest.approx(humidity, rel=1e-12)
    assert dew == air if humidity == 1.0 else dew < air


@pytest.mark.parametrize("humidity", [0.0, -0.1, 1.01, np.nan])
def test_impossible_humidity_is_refused(humidity):
    with pytest.raises(SceneError, match="Relative humidity"):
        dew_point(290.0, humidity)


# What is published ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("celsius, emissivity", [(-10.0, 0.662), (0.0, 0.711), (10.0, 0.774), (20.0, 0.852)])
def test_total_of_martin_and_berdahl(celsius, emissivity):
    """Their law, worked out by hand to three digits."""
    assert sky_emissivity(FREEZING + celsius) == pytest.approx(emissivity, abs=6e-4)


def test_other_measurements_of_the_total():
    """Angstrom's form with Brunt's coefficients for many stations, 0.52 + 0.065 sqrt(e / hPa) (Brunt 1932, Q. J. R.
    Meteorol. Soc. 58, 389), and Brutsaert's 1.24 (e / T)^(1/7) (1975, Water Resour. Res. 11, 742): both are within 0.06
    of it where they were fit."""
    for air, dew in WEATHERS[1:]:
        hectopascals = saturation_pressure(dew) / 100.0
        assert sky_emissivity(dew) == pytest.approx(0.52 + 0.065 * hectopascals**0.5, abs=0.06)
        assert sky_emissivity(dew) == pytest.approx(1.24 * (hectopascals / air) ** (1.0 / 7.0), abs=0.06)


@pytest.mark.parametrize("air, dew", WEATHERS)
def test_the_window_at_the_zenith(air, dew):
    """S. B. Idso, A set of equations for full spectrum and 8- to 14-um and 10.5- to 12.5-um thermal radiation from
    cloudless skies, Water Resour. Res. 17, 295 (1981): the zenith at 8 to 14 um, measured in Arizona, where there is
    dust. 7 K: that is 12 % of the radiance, where it is most."""
    hectopascals = saturation_pressure(dew) / 100.0
    measured = 0.24 + 2.98e-8 * hectopascals**2 * np.exp(3000.0 / air)
    fine = np.linspace(8.0, 14.0, 2001)

    def signal(kelvin):
        return trapezoid(planck(fine, kelvin), fine)

    candidates = np.arange(150.0, air, 0.05)
    idso = candidates[np.argmin([abs(signal(kelvin) - measured * signal(air)) for kelvin in candidates])]
    found = band_temperatures(clear_sky(air, dew), 8.0, 14.0)[0]
    print(f"{air:g} K, dew point {dew:g} K: zenith at 8 to 14 um {found:.1f} K, Idso {idso:.1f} K")
    assert found == pytest.approx(idso, abs=7.0)


@pytest.mark.parametrize("air, dew", WEATHERS[1:])
def test_change_with_the_angle(air, dew):
    """M. H. Unsworth and J. L. Monteith, Long-wave radiation at the ground I, Q. J. R. Meteorol. Soc. 101, 13 (1975):
    emissivity rises by 0.09 for a factor e of 1 / cos(zenith), on clear days in England and Sudan. Martin and Berdahl's
    form 1 - (1 - emissivity) exp(b (1.7 - 1 / cos(zenith))), with b = 0.308 (Nahon et al. 2019), rises more. We lie
    between, to 0.04, and they are up to 0.12 apart."""
    angles = np.arange(0.0, 76.0, 5.0)
    secant = 1.0 / np.cos(np.radians(angles))
    found = emitted(clear_sky(air, dew)[2], angles)
    steep = 1.0 - (1.0 - sky_emissivity(dew)) * np.exp(0.308 * (1.7 - secant))
    rise, martin = found - found[0], steep - steep[0]
    monteith = 0.09 * np.log(secant)
    low, high = np.minimum(monteith, martin), np.maximum(monteith, martin)
    print(f"{air:g} K, dew point {dew:g} K: to 75 degrees {rise[-1]:.3f}, {monteith[-1]:.3f} and {martin[-1]:.3f}")
    assert np.all(rise >= low - 0.04) and np.all(rise <= high + 0.04)


@pytest.mark.parametrize("base, measured, error", [(1000.0, 1.0, 0.03), (4000.0, 0.79, 0.06), (9000.0, 0.35, 0.05)])
def test_emissivity_of_clouds(base, measured, error):
    """J. R. Allen, Measurements of cloud emissivity in the 8-13 um waveband, J. Appl. Meteorol. 10, 260 (1971): means
    of low clouds, altocumulus and cirrus. Martin and Berdahl's is within their errors."""
    assert cloud_emissivity(base) == pytest.approx(measured, abs=error)


@pytest.mark.parametrize("air, dew", WEATHERS)
def test_vapour_is_hardly_changed(air, dew):
    """The one free number: the atmosphere is about as it should be if it is near 1."""
    factor = vapour_factor(air, dew)
    print(f"{air:g} K, dew point {dew:g} K: {factor:.2f} times the vapour")
    assert 0.9 < factor < 1.5


# What must hold -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("clouds", [(0.0, 1000.0), (0.4, 2000.0), (1.0, 7000.0)])
@pytest.mark.parametrize("air, dew", [*WEATHERS, (DEW_POINTS[0], DEW_POINTS[0]), (HOTTEST_AIR, DEW_POINTS[0]),
                                      (DEW_POINTS[1], DEW_POINTS[1]), (HOTTEST_AIR, DEW_POINTS[1])])  # fmt: skip
def test_all_of_the_table_is_the_total(air, dew, clouds):
    """To 1e-3: what a horizontal plate receives from the table, as the solver reads it."""
    zenith = np.linspace(0.0, 90.0, 361)
    total = trapezoid(emitted(clear_sky(air, dew, *clouds)[2], zenith) * np.sin(np.radians(2.0 * zenith)))
    assert total * np.radians(zenith[1]) == pytest.approx(sky_emissivity(dew, *clouds), abs=1e-3)


def test_shapes_and_what_is_below():
    zenith, wavelengths, kelvin = clear_sky(288.15, 283.15)
    assert kelvin.shape == (len(zenith), len(wavelengths))
    assert zenith[0] == 0.0 and zenith[-1] == 180.0 and np.all(np.diff(zenith) > 0)
    assert wavelengths[0] == pytest.approx(2.0) and wavelengths[-1] == pytest.approx(30.0)
    assert np.all(kelvin[zenith >= 90.0] == 288.15)
    kelvin[:], zenith[:] = 0.0, 0.0  # a caller may change what it got
    assert clear_sky(288.15, 283.15)[2].min() > 150.0 and ZENITH[-1] == 180.0


@pytest.mark.parametrize("air, dew", WEATHERS)
def test_warmer_towards_the_horizon(air, dew):
    kelvin = clear_sky(air, dew)[2]
    assert np.all(np.diff(kelvin, axis=0) >= -ROUNDING) and np.all(kelvin <= air)


def test_warmer_with_humidity():
    found = [clear_sky(305.0, dew)[2] for dew in np.arange(DEW_POINTS[0], 305.0, 5.0)]
    assert np.all(np.diff(found, axis=0) >= -1e-6) and found[-1].mean() > found[0].mean() + 10.0


def test_warmer_with_clouds_the_more_the_lower():
    more = [clear_sky(288.15, 283.15, cover, 1500.0)[2] for cover in (0.0, 0.3, 0.7, 1.0)]
    lower = [clear_sky(288.15, 283.15, 1.0, base)[2] for base in (15000.0, 9000.0, 5000.0, 1500.0, 0.0)]
    for each in (more, lower):
        assert np.all(np.diff(each, axis=0) >= -ROUNDING) and each[-1].mean() > each[0].mean() + 5.0


def test_overcast():
    """Fog is a blackbody of the air's temperature. A lid of low clouds looks as their base does, which is colder by 5
    to 10 K/km: never colder than a dry atmosphere makes it, 9.8 K/km, nor warmer than the air."""
    np.testing.assert_allclose(clear_sky(288.15, 283.15, 1.0, 0.0)[2], 288.15, atol=ROUNDING)
    for base in (500.0, 1000.0, 1500.0):
        found = band_temperatures(clear_sky(288.15, 283.15, 1.0, base), 8.0, 14.0)[0]
        assert 288.15 - 9.8e-3 * base < found < 288.15


def test_where_gases_are_opaque_the_sky_is_as_warm_as_the_air():
    """At 15 um, carbon dioxide, within some metres; at 6.3 um, water vapour, if it is not too dry, to the first km."""
    for air, dew in WEATHERS:
        dioxide, window, vapour = np.interp([15.0, 11.0, 6.3], WAVELENGTHS, clear_sky(air, dew)[2][0])
        assert dioxide > air - 1.0 and window < air - 40.0
        assert vapour > air - 6.5 or dew < 260.0


def test_ozone_glows_in_the_window():
    """A stratosphere at 217 K behind a dry window that is colder."""
    zenith = clear_sky(273.15, 258.15)[2][0]
    assert np.interp(9.6, WAVELENGTHS, zenith) > np.interp([8.8, 10.3], WAVELENGTHS, zenith).max() + 5.0


def test_temperatures_of_a_band():
    """Of a table that is the same at all wavelengths they are that table; else they lie within it."""
    zenith, wavelengths, kelvin = clear_sky(288.15, 283.15)
    even = np.linspace(200.0, 288.0, len(zenith))
    found = band_temperatures((zenith, wavelengths, np.repeat(even[:, None], len(wavelengths), 1)), 8.0, 14.0)
    np.testing.assert_allclose(found, even, rtol=1e-6)  # of the trapezoidal rule
    found = band_temperatures((zenith, wavelengths, kelvin), 8.0, 14.0)
    inside = kelvin[:, (wavelengths > 7.8) & (wavelengths < 14.3)]
    assert np.all(found <= inside.max(axis=1) + 1e-5) and np.all(found >= inside.min(axis=1) - 1e-5)


ROW = re.compile(r"^\| (-?\d+) °C, (\d+) %, (?:clear|(\d+) % at (\d+) m) \| (.*) \|$", re.MULTILINE)


def test_the_table_on_the_page():
    """docs/temperatures.md, in whole degrees."""
    rows = ROW.findall((Path(__file__).parents[1] / "docs" / "temperatures.md").read_text(encoding="utf-8"))
    assert len(rows) == 8
    for celsius, percent, cover, base, stated in rows:
        air = FREEZING + float(celsius)
        weather = dew_point(air, float(percent) / 100.0), float(cover or 0) / 100.0, float(base or 0)
        sky = clear_sky(air, *weather)
        bands = [band_temperatures(sky, *each) for each in ((8.0, 14.0), (3.0, 5.0))]
        found = [np.interp(angle, ZENITH, kelvin) for kelvin in bands for angle in (0.0, 60.0)]
        found = np.array([*found, air * sky_emissivity(*weather) ** 0.25]) - FREEZING
        print(f"{celsius} °C, {percent} %, {cover or 0} % at {base or 0} m:", *np.round(found).astype(int))
        np.testing.assert_allclose(found, [float(each) for each in stated.split("|")], atol=0.51)


@pytest.mark.parametrize("weather, message", [
    ((280.0, 285.0), "dew point 285 K above the air temperature 280 K"),
    ((280.0, 200.0), "dew point 200 K; Martin and Berdahl's law is for 235.15 to 308.15 K"),
    ((350.0, 300.0), "air temperature 350 K; at most 333.15 K"),
    ((280.0, np.nan), "dew point nan K"),
    ((np.nan, 280.0), "dew point 280 K above the air temperature nan K"),
    ((280.0, 270.0, 1.2), "cloud cover 1.2; it is 0 to 1"),
    ((280.0, 270.0, np.nan), "cloud cover nan"),
    ((280.0, 270.0, 0.5, -1.0), "cloud base -1 m; it is 0 to 20000 m"),
    ((280.0, 270.0, 0.5, np.inf), "cloud base inf m"),
])  # fmt: skip
def test_impossible_weather_is_refused(weather, message):
    with pytest.raises(SceneError, match=f"Clear sky: {message}"):
        clear_sky(*weather)
