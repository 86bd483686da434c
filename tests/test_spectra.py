# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra from files: each format is read as its library defines it, damage is refused by file, line and value.

The samples are made up; their layout is that of the libraries.
"""

import numpy as np
import pytest

from addon.reading.spectra import SpectrumError, read_spectrum

ECOSTRESS = """\
Name: Test loam
Type: soil
Class: none
Subclass: none
Particle Size: <2 mm
Sample No.: T1
Owner: nobody
Wavelength Range: TIR
Origin: made up
Collection Date: N/A
Description: A sample that does not exist,
described in two lines.
Measurement: Directional (10 Degree) Hemispherical Reflectance
First Column: X
Second Column: Y
X Units: Wavelength (micrometers)
Y Units: Reflectance (percentage)
First X Value: 14.0112
Last X Value: 3.0
Number of X Values: 4
Additional Information: none

14.0112\t4.2
10.0000\t12.5
8.0000\t-0.5
3.0000\t30.0
"""
USGS = " splib07a Record=108: Madeupite T2.1B          NIC4aa AREF\n"
CHANNELS = " splib07a Record=22: Wavelengths NIC4 4ch\n 3.0\n 5.0\n 8.0\n 14.0\n"
VALUES = " 1.0000000e-001\n -1.2300000e+034\n 2.5000000e-001\n 0.05\n"


def write(tmp_path, text, name="sample.txt"):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    return path


def test_ecostress_reflectance_becomes_emissivity(tmp_path):
    spectrum = read_spectrum(write(tmp_path, ECOSTRESS))
    expected = [[3.0, 0.7], [8.0, 1.0], [10.0, 0.875], [14.0112, 0.958]]  # 1 - R, ascending; -0.5 % counts as 0
    np.testing.assert_allclose(spectrum.points, expected, rtol=0, atol=1e-12)
    assert spectrum.name == "Test loam" and spectrum.remark == ""
    for part in ("T1", "nobody", "sample.txt", "Hemispherical", "emissivity = 1 - reflectance"):
        assert part in spectrum.source


def test_bidirectional_reflectance_is_remarked(tmp_path):
    text = ECOSTRESS.replace("Directional (10 Degree) Hemispherical Reflectance", "Bidirectional reflectance")
    assert "approximate" in read_spectrum(write(tmp_path, text)).remark


def test_ecostress_takes_what_its_header_says(tmp_path):
    """Line ends of Windows, Latin letters, `percent`, a slip of the library, and emissivity as a fraction."""
    text = ECOSTRESS.replace("nobody", "M\u00fcller").replace("Reflectance (percentage)", "Reflectence (percent)")
    text = text.replace("\n", "\r\n")
    assert read_spectrum(write(tmp_path, text.encode("latin-1"))).points[0, 1] == pytest.approx(0.7)
    text = ECOSTRESS.split("14.0112\t")[0].replace("Reflectance (percentage)", "Emissivity (fraction)")
    text = text.replace("Values: 4", "Values: 2") + "3 0.7\n8 0.9\n"
    assert np.array_equal(read_spectrum(write(tmp_path, text)).points, [[3.0, 0.7], [8.0, 0.9]])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("(micrometers)", "(nanometers)", r"X Units are 'Wavelength \(nanometers\)'"),
        ("Reflectance (percentage)", "Transmittance (percentage)", r"Y Units are 'Transmittance \(percentage\)'"),
        ("Reflectance (percentage)", "Reflectance", "Y Units are 'Reflectance', expected"),
        ("Number of X Values: 4\n", "", "the header has no 'Number Of X Values'"),
        ("X Units: Wavelength (micrometers)\n", "", "the header has no 'X Units'"),
        ("8.0000\t-0.5\n", "", "announces 4 values, the file has 3"),
        ("8.0000\t-0.5", "8.0000\tNaN", r"sample\.txt, line 25: reflectance nan is outside 0\.\.100 \(percent\)"),
        ("8.0000\t-0.5", "8.0000\t-2.1", r"line 25: reflectance -2\.1 is outside"),
        ("3.0000\t30.0", "3.0000\t130", r"line 26: reflectance 130 is outside"),
        ("8.0000\t-0.5", "nan\t1", r"line 25: wavelength nan is outside"),
        ("8.0000\t-0.5", "8000\t1", r"line 25: wavelength 8000 is outside 0\.1\.\.250 um"),
        ("8.0000\t-0.5", "10.0\t1", r"line 25: wavelength 10 um stands in line 24 already"),
        ("8.0000\t-0.5", "8.0000 one", r"line 25: '8\.0000 one' is not two numbers"),
        ("8.0000\t-0.5", "8.0000", r"line 25: '8\.0000' is not two numbers"),
    ],
)
def test_damaged_ecostress_files_are_refused(tmp_path, old, new, message):
    assert old in ECOSTRESS
    with pytest.raises(SpectrumError, match=message) as caught:
        read_spectrum(write(tmp_path, ECOSTRESS.replace(old, new)))
    assert "sample.txt" in str(caught.value)


@pytest.mark.parametrize("folder", [".", "ChapterM_Minerals"])
def test_usgs_finds_its_wavelengths(tmp_path, folder):
    """Beside the spectrum or one folder up, told by the number of channels; deleted channels are left out."""
    write(tmp_path, CHANNELS, "splib07a_Wavelengths_NIC4.txt")
    write(tmp_path, CHANNELS + " 15.0\n", "splib07a_Wavelengths_ASD.txt")
    (tmp_path / folder).mkdir(exist_ok=True)
    spectrum = read_spectrum(write(tmp_path / folder, USGS + VALUES, "splib07a_Madeupite.txt"))
    np.testing.assert_allclose(spectrum.points, [[3.0, 0.9], [8.0, 0.75], [14.0, 0.95]], rtol=0, atol=1e-12)
    assert spectrum.name == "Madeupite T2.1B"
    assert "Record=108" in spectrum.source and "approximate" in spectrum.remark


def test_usgs_takes_the_wavelengths_it_is_given(tmp_path):
    channels = write(tmp_path, CHANNELS.replace("14.0", "13.0"), "mine.txt")
    spectrum = read_spectrum(write(tmp_path, USGS + VALUES), wavelengths=channels)
    assert spectrum.points[-1, 0] == 13.0


@pytest.mark.parametrize(
    ("text", "channels", "message"),
    [
        (USGS + VALUES, None, "its 4 wavelengths are in a file of their own; .* none fits"),
        (USGS + VALUES + " 0.1\n", CHANNELS, "has 5 channels, '.*w.txt' 4 wavelengths"),
        (USGS + VALUES.replace("0.05", "O.05"), CHANNELS, r"sample\.txt, line 5: 'O\.05' is not a number"),
        (USGS + VALUES.replace("0.05", "nan"), CHANNELS, "line 5: reflectance nan"),
        (USGS.replace("AREF", "TRAN") + VALUES, CHANNELS, "'TRAN' is no absolute reflectance"),
        (USGS + 4 * " -1.23e34\n", CHANNELS, "two points or more, this file has 0"),
        (CHANNELS, CHANNELS, "this file lists the channels' wavelengths"),
        (USGS + VALUES, CHANNELS.replace("14.0", "8.0"), r"line 5: wavelength 8 um stands in line 4 already"),
    ],
)
def test_damaged_usgs_files_are_refused(tmp_path, text, channels, message):
    wavelengths = channels and write(tmp_path, channels, "w.txt")
    with pytest.raises(SpectrumError, match=message):
        read_spectrum(write(tmp_path, text), wavelengths=wavelengths)


def test_two_files_of_wavelengths_that_fit_are_not_guessed_between(tmp_path):
    for name in ("wavelengths_a.txt", "wavelengths_b.txt"):
        write(tmp_path, CHANNELS, name)
    with pytest.raises(SpectrumError, match="'wavelengths_a.txt', 'wavelengths_b.txt' fits"):
        read_spectrum(write(tmp_path, USGS + VALUES))


@pytest.mark.parametrize(
    ("text", "quantity", "unit"),
    [
        ("8,0.9\n14,0.8\n", "emissivity", "fraction"),
        ("14;80\n8;90\n", "emissivity", "percent"),
        ("# mine\nwavelength (um), reflectance\n8, 0.1\n\n14, 0.2\n", "reflectance", "fraction"),
        ("\ufeffum\tR in %\n8\t10\n14\t20\n", "reflectance", "percent"),
    ],
)
def test_tables_are_read_as_they_are_said_to_be(tmp_path, text, quantity, unit):
    spectrum = read_spectrum(write(tmp_path, text, "paint.csv"), quantity, unit)
    np.testing.assert_allclose(spectrum.points, [[8.0, 0.9], [14.0, 0.8]], rtol=0, atol=1e-12)
    assert spectrum.name == "paint"


@pytest.mark.parametrize(
    ("text", "quantity", "unit", "message"),
    [
        ("8,90\n14,80\n", "emissivity", "fraction", r"line 1: emissivity 90 is outside 0\.\.1 \(fraction\)"),
        ("8,0.9\n14,0.8\n", "emissivity", "percent", "no value exceeds 1 percent"),
        ("8,95\n9,0.95\n14,96\n", "emissivity", "percent", r"line 2: 0\.95 follows 95; fractions and percent"),
        ("8,0.9\n9,95\n", "emissivity", "fraction", "line 2: emissivity 95 is outside"),
        ("um,reflectance\n8,0.9\n9,0.8\n", "emissivity", "fraction", "line 1: the titles .* speak of reflectance"),
        ("um,emissivity\n8,0.9\n9,0.8\n", "reflectance", "fraction", "line 1: the titles .* speak of emissivity"),
        ("um,eps %\n1,0.9\n2,0.8\n", "emissivity", "fraction", "speak of percent"),
        ("wavelength (nm),eps\n1,0.9\n2,0.8\n", "emissivity", "fraction", "speak of nanometres"),
        ("8000,0.9\n14000,0.8\n", "emissivity", "fraction", "line 1: wavelength 8000 is outside"),
        ("8,0.9\n", "emissivity", "fraction", "two points or more, this file has 1"),
        ("um,eps\n", "emissivity", "fraction", "this file has 0"),
        ("8,0.9\n8,0.9\n", "emissivity", "fraction", "line 2: wavelength 8 um stands in line 1 already"),
        ("8,0.9,1\n9,0.9,2\n", "emissivity", "fraction", r"line 1: '8,0\.9,1' is not two numbers"),
        ("8,0.9\nend\n", "emissivity", "fraction", "line 2: 'end' is not two numbers"),
        ("8,0.9\n9,1.021\n", "emissivity", "fraction", r"line 2: emissivity 1\.021 is outside"),
        ("8,0.9\n9,inf\n", "emissivity", "fraction", "line 2: emissivity inf is outside"),
        ("# nothing\n", "emissivity", "fraction", "only comments"),
        (" \n\n", "emissivity", "fraction", "the file is empty"),
        (b"PK\x03\x04 12\x00", "emissivity", "fraction", "binary file"),
    ],
)
def test_damaged_tables_are_refused(tmp_path, text, quantity, unit, message):
    with pytest.raises(SpectrumError, match=message) as caught:
        read_spectrum(write(tmp_path, text, "table.csv"), quantity, unit)
    assert "table.csv" in str(caught.value)
