# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of every format, read back by other people's readers: each value to the last bit, and what they say."""

import re
import warnings

import numpy as np
import OpenEXR
import pytest
import tifffile
from spectral.io import envi

from addon.output.description import how_rendered
from addon.output.exr import spectral_channel_names
from addon.output.formats import FORMATS, write_file
from addon.solver import Settings
from addon.solver.image.film import Film
from addon.solver.physics.spectrum import band_names

BANDS = 256
SHAPE = (5, 7)
EDGES = np.concatenate((np.linspace(3.0, 5.0, 129), np.linspace(5.0, 14.0, 129)[1:]))  # um, of two widths


@pytest.fixture
def images():
    """A frame of 256 bands whose values have every bit pattern but those that are no number."""
    rng = np.random.default_rng(11)
    bits = rng.integers(0, 2**32, (BANDS + 2, *SHAPE), dtype=np.uint32)
    values = np.where(np.isnan(bits.view(np.float32)), np.float32(np.inf), bits.view(np.float32))
    film = Film(SHAPE[1], SHAPE[0], EDGES, reference_temperature=293.15)
    film.passes, film.photons = 7, 7 * 12_345
    settings = Settings(passes=7, photons_per_pass=12_345, neighbours=41, seed=2**40 + 1, pass_offset=3, shrink=False)
    return {
        "bands": list(values[:BANDS]),
        "band_edges": EDGES,
        "radiance": values[BANDS],
        "temperature": rng.uniform(200.0, 600.0, SHAPE).astype(np.float32),
        "noise": values[BANDS + 1],
        "metadata": how_rendered(film, settings),
    }


def write(folder, file_format, images):
    path = folder / f"frame{FORMATS[file_format].ending}"
    write_file(file_format, path, images)
    return path


def assert_same_bits(read, written):
    assert read.dtype == written.dtype
    np.testing.assert_array_equal(np.ascontiguousarray(read).view(np.uint32), written.view(np.uint32))


# What the files say ---------------------------------------------------------------------------------------------------


def exr_facts(path):
    return OpenEXR.File(str(path), header_only=True).header()


def envi_facts(path):
    camel = {re.sub(" ([a-z])", lambda letter: letter[1].upper(), key): key for key in envi.read_envi_header(path)}
    return {name: envi.read_envi_header(path)[key] for name, key in camel.items()}


def tiff_facts(path):
    with tifffile.TiffFile(path) as file:
        return dict(line.split(": ", 1) for line in file.pages[0].description.splitlines())


READ_FACTS = {
    "BAND_EXR": exr_facts,
    "SPECTRAL_EXR": exr_facts,
    "ENVI": envi_facts,
    "TIFF": tiff_facts,
    "CAMERA_TIFF": tiff_facts,
}


@pytest.mark.parametrize("file_format", FORMATS)
def test_every_file_tells_units_bands_responses_and_settings(tmp_path, images, file_format):
    facts = READ_FACTS[file_format](write(tmp_path, file_format, images))
    np.testing.assert_array_equal([float(edge) for edge in facts["bandEdges"].split()], EDGES)
    assert facts["wavelengthRange"] == "3.0 14.0"
    unit = {"SPECTRAL_EXR": "W m-2 sr-1 nm-1", "TIFF": "Temperature: K", "CAMERA_TIFF": "Temperature: 0.01 K a count"}
    assert unit.get(file_format, "bands: W m-2 sr-1 um-1") in facts["units"]
    assert facts["response"].startswith("1 from the lower to the upper edge of each band")
    assert "blackbody" in facts["temperatureCalibration"] and "Planck" in facts["temperatureCalibration"]
    assert facts["software"].startswith("Infrared Photons ")
    expected = {
        "passes": 7, "firstPass": 3, "photons": 86_415, "photonsPerPass": 12_345, "neighbours": 41, "seed": 2**40 + 1,
        "shrinkingRadius": False, "roulette": "POWER", "referenceSubtraction": True, "referenceTemperature": 293.15,
        "timeLimit": 0.0, "targetNoise": 0.0,
    }  # fmt: skip
    assert {name: facts[name] for name in expected} == {name: str(value) for name, value in expected.items()}


# Spectral OpenEXR -----------------------------------------------------------------------------------------------------

# The published layout's grammar, as its authors' reader has it: value, exponent, prefix, unit.
CHANNEL = re.compile(r"^S0\.(\d*,?\d*([Ee][+-]?\d+)?)(Y|Z|E|P|T|G|M|k|h|da|d|c|m|u|n|p)?(m|Hz)$")
RESPONSE = re.compile(r"(\d*\.?\d*(?:[Ee][+-]?\d+)?)nm:(\d*\.?\d*(?:[Ee][+-]?\d+)?);")


def read_spectral_exr(path):
    """A reader of the published layout: wavelengths (b,) nm ascending, images (b, h, w), responses [(nm, value), ...].

    After the paper and its authors' reader (EXRSpectralImage), through OpenEXR's own library.
    """
    with OpenEXR.File(str(path), separate_channels=True) as file:
        header, channels = (
            dict(file.header()),
            {name: channel.pixels.copy() for name, channel in file.channels().items()},
        )
    assert header["spectralLayoutVersion"] == "1.0" and header["emissiveUnits"] == "W.m^-2.sr^-1"
    assert isinstance(header["EV"], float) and header["EV"] == 0.0
    found = []
    for name, pixels in channels.items():
        match = CHANNEL.match(name)
        if match:
            assert match[3] + match[4] == "nm"
            response = [(float(nm), float(value)) for nm, value in RESPONSE.findall(header[name])]
            found.append((float(match[1].replace(",", ".")), pixels, response))
    wavelengths, pixels, responses = zip(*sorted(found, key=lambda each: each[0]), strict=True)
    return np.array(wavelengths), np.stack(pixels), responses, channels


def test_spectral_exr_is_in_the_published_layout(tmp_path, images):
    wavelengths, pixels, responses, channels = read_spectral_exr(write(tmp_path, "SPECTRAL_EXR", images))
    middles = 500.0 * (EDGES[:-1] + EDGES[1:])
    np.testing.assert_allclose(wavelengths, middles, rtol=0, atol=0.5e-6)  # nm: six decimals are written
    for image, band in zip(pixels, images["bands"], strict=True):
        assert_same_bits(image[::-1], band / np.float32(1000))  # per nm
    box = [[(low, 1.0), (high, 1.0)] for low, high in zip(1000.0 * EDGES[:-1], 1000.0 * EDGES[1:], strict=True)]
    np.testing.assert_allclose(responses, box, rtol=0, atol=0.5e-9)  # nm: nine decimals are written
    for name in ("Radiance", "Temperature", "Noise"):
        assert_same_bits(channels[f"{name}.V"][::-1], images[name.lower()])
    assert {"R", "G", "B"} <= set(channels)  # the preview


def test_spectral_channels_of_narrow_bands_stay_apart():
    names = spectral_channel_names(10.0 * (1 + 1e-12 * np.arange(4)))
    assert len(set(names)) == 3 and all(CHANNEL.match(name) for name in names)


def test_spectral_exr_through_colour_science(tmp_path, images):
    """A reader by others: the package colour-science."""
    pytest.importorskip("OpenImageIO")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of what else the package could use
        colour = pytest.importorskip("colour")
        components, specification = colour.read_spectral_image_Fichet2021(
            str(write(tmp_path, "SPECTRAL_EXR", images)), additional_data=True
        )
    assert specification.is_emissive and not specification.is_polarised and not specification.is_bispectral
    wavelengths, pixels = components["S0"]
    order = np.argsort(wavelengths)  # it leaves them in the alphabet's
    np.testing.assert_allclose(wavelengths[order], 500.0 * (EDGES[:-1] + EDGES[1:]), rtol=0, atol=0.5e-6)  # nm
    for i, band in zip(order, images["bands"], strict=True):
        np.testing.assert_array_equal(pixels[::-1, :, i].astype(np.float32), band / np.float32(1000))


# ENVI -----------------------------------------------------------------------------------------------------------------


def test_envi_cube_through_spectral_python(tmp_path, images):
    path = write(tmp_path, "ENVI", images)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["frame.hdr", "frame.raw"]
    cube = envi.open(str(path))
    assert cube.shape == (*SHAPE, BANDS)
    assert cube.bands.band_unit == "Micrometers" and cube.metadata["data units"] == "W m-2 sr-1 um-1"
    np.testing.assert_array_equal(cube.bands.centers, 0.5 * (EDGES[:-1] + EDGES[1:]))
    np.testing.assert_array_equal(cube.bands.bandwidths, np.diff(EDGES))
    assert cube.metadata["band names"] == band_names(EDGES)  # those of the passes
    pixels = np.asarray(cube.open_memmap(interleave="bsq"))
    for image, band in zip(pixels, images["bands"], strict=True):
        assert_same_bits(image[::-1], band)


# TIFF -----------------------------------------------------------------------------------------------------------------


GDAL_METADATA = 42112


def read_tiff(path):
    """(pixels, {tag: value}) by tifffile, which warns of what is amiss in a file."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with tifffile.TiffFile(path) as file:
            assert len(file.pages) == 1
            return file.asarray(), {tag.code: tag.value for tag in file.pages[0].tags}


def test_temperature_tiff_through_tifffile(tmp_path, images):
    pixels, tags = read_tiff(write(tmp_path, "TIFF", images))
    assert_same_bits(pixels[::-1], images["temperature"])
    assert 'role="unittype">K<' in tags[GDAL_METADATA] and 'role="scale">1.0<' in tags[GDAL_METADATA]


def test_camera_tiff_has_hundredths_of_a_kelvin(tmp_path, images):
    pixels, tags = read_tiff(write(tmp_path, "CAMERA_TIFF", images))
    assert pixels.dtype == np.uint16
    celsius = 0.01 * pixels[::-1] - 273.15  # as makers of cameras tell it
    # Half a count, and float64's rounding of numbers below 1000
    np.testing.assert_allclose(celsius, images["temperature"] - 273.15, rtol=0, atol=0.005 + 1e-4)
    assert 'role="unittype">K<' in tags[GDAL_METADATA] and 'role="scale">0.01<' in tags[GDAL_METADATA]
    write_file("CAMERA_TIFF", tmp_path / "again.tif", images | {"temperature": (0.01 * pixels[::-1])})
    np.testing.assert_array_equal(read_tiff(tmp_path / "again.tif")[0], pixels)


def test_camera_tiff_ends_at_its_largest_count_and_says_so(tmp_path, images, caplog):
    images["temperature"][2, 3] = 700.0
    pixels, _ = read_tiff(write(tmp_path, "CAMERA_TIFF", images))
    assert pixels[::-1][2, 3] == 65535 and np.count_nonzero(pixels == 65535) == 1
    assert "1 pixels are hotter than 655.35 K" in caplog.text


@pytest.mark.parametrize("file_format", ["TIFF", "CAMERA_TIFF"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (4, 6)])
def test_pillow_reads_the_tiff_files_too(tmp_path, images, file_format, shape):
    from PIL import Image

    images["temperature"] = np.linspace(250.0, 400.0, shape[0] * shape[1], dtype=np.float32).reshape(shape)
    path = write(tmp_path, file_format, images)
    with Image.open(path) as picture:
        np.testing.assert_array_equal(np.asarray(picture), read_tiff(path)[0])


# Formats --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("unknown", ["PNG", "camera_tiff", ""])
def test_an_unknown_format_is_an_error_that_names_it(tmp_path, images, unknown):
    with pytest.raises(ValueError, match=f"no file format '{unknown}'"):
        write_file(unknown, tmp_path / "frame", images)
    assert not list(tmp_path.iterdir())


# Damage ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("file_format", FORMATS)
def test_what_cannot_be_written_is_an_oserror_that_names_it_and_nothing_is_left(tmp_path, images, file_format):
    missing = tmp_path / "missing"
    with pytest.raises(OSError, match=re.escape(str(missing))):
        write(missing, file_format, images)
    taken = tmp_path / f"frame{FORMATS[file_format].ending}"
    taken.mkdir()
    with pytest.raises(OSError, match=re.escape(str(taken))):
        write(tmp_path, file_format, images)
    left = {file.name for file in tmp_path.iterdir()} - {taken.name}
    assert left <= {"frame.raw"}  # of ENVI, whose header is written last


@pytest.mark.parametrize("file_format", FORMATS)
def test_a_full_disk_leaves_older_files_whole(tmp_path, images, file_format):
    """A limit on the size of files stands in for the full disk."""
    import resource

    write(tmp_path, file_format, images)
    old = {file: file.read_bytes() for file in tmp_path.iterdir()}
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (512, before[1]))
    try:
        with pytest.raises(OSError, match="frame"):
            write(tmp_path, file_format, images | {"temperature": images["temperature"] + np.float32(1.0)})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == old
