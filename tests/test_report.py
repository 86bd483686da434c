# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables, graphs and reports of what measuring tools read: their figures by hand, and names that are no markup."""

import base64
import csv
import math
import re
import struct
import zlib
from html.parser import HTMLParser

import numpy as np
import pytest

from addon.measuring import graphs
from addon.measuring.regions import Window, region_of
from addon.measuring.report import Report, ReportedPicture, page, write_report
from addon.measuring.statistics import measure
from addon.measuring.table import SHORT_TITLES, ToolReading, columns, difference_text, row, short_row, write_table
from addon.output.marks import Mark, draw_marks, label_place, lines
from addon.output.temperature_scale import CELSIUS, FAHRENHEIT, KELVIN, Isotherm, TemperatureScale
from addon.solver import Correction

EVIL = "<script>alert('wall & \"door\"')</script>"
CORRECTION = Correction(0.95, 291.15, 0.98, 288.15, 0.9, 300.15)


def picture(height=6, width=8):
    """Temperatures, K, that differ in each pixel, row 0 at the bottom, and errors of 0.02 K."""
    temperature = (300.0 + np.arange(height * width).reshape(height, width) * 0.25).astype(np.float32)
    return temperature, np.full((height, width), 0.02, np.float32)


def read(kind, points, number=1, name="tool", frame=7, isotherm=None, correction=CORRECTION):
    """A tool and what it reads in the picture."""
    temperature, noise = picture()
    region = region_of(kind, points, Window((8, 6), (0, 0), temperature.shape))
    found, values = measure(temperature, noise, region, isotherm), region.values(temperature)
    return ToolReading(number, name, kind.title(), frame, "ViewLayer", found, correction, values, tuple(points))


BOX = [(0.25, 0.0), (0.75, 0.5)]  # columns 2 to 5 of rows 0 to 2


def png(width=8, height=6):
    """A grey PNG of this size."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    rows = b"".join(b"\0" + bytes(width) for _ in range(height))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


class Page(HTMLParser):
    """Elements, texts, tables and sources of a page, and whether all that is opened is closed."""

    VOID = {"meta", "br", "img"}

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.rows, self.sources, self.texts = [], [], [], [], []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.sources += [value for name, value in attributes if name in ("href", "src", "xlink:href")]
        assert not any(name.startswith("on") for name, _ in attributes)
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data
        elif not self.open or self.open[-1] != "style":
            self.texts.append(data)


def report_of(tools, frames=(), isotherm=None, **more):
    scale = TemperatureScale("IRON", 300.0, 312.0, isotherm)
    shapes = [
        Mark(tool.kind.upper(), tuple((8 * u, 6 * v) for u, v in tool.points), str(tool.number)) for tool in tools
    ]
    shown = ReportedPicture("ViewLayer, frame 7", png(), (8, 6), scale, tools, shapes, **more)
    return Report(
        "scene.blend", "Temperatures in °C.", CELSIUS, [shown], {"Made with": {"Scene file": "/a/b.blend"}}, frames
    )


# Tables


def test_a_table_holds_the_figures_by_hand(tmp_path):
    """The box has the pixels 2, 3, 4, 5 of rows 0, 1, 2: numbers 8 r + c, so 300.5 K to 305.25 K, mean 8 + 3.5 = 11.5
    quarters; deviation of r 8 / 4 K and c / 4 K: sqrt(2/3 * 4 + 5/4 / 16) K. The error of the mean is .02 / sqrt(12).
    """
    write_table(
        tmp_path / "tools.csv", [read("BOX", BOX, 3, "Wall, left", isotherm=Isotherm(300.0, 300.8, (0, 1, 0)))], KELVIN
    )
    text = (tmp_path / "tools.csv").read_text(encoding="utf-8-sig")
    titles, values = csv.reader(text.splitlines())
    found = dict(zip(titles, values, strict=True))
    assert (found["Frame"], found["View Layer"], found["Number"], found["Kind"]) == ("7", "ViewLayer", "3", "Box")
    assert found["Name"] == "Wall, left"
    expected = {
        "Minimum (K)": 300.5, "Maximum (K)": 305.25, "Mean (K)": 302.875, "Error of Minimum (K)": 0.02,
        "Error of Maximum (K)": 0.02, "Error of Mean (K)": 0.02 / math.sqrt(12.0),
        "Standard Deviation (K)": math.sqrt(8.0 / 3.0 + 1.25 / 16.0), "Pixels": 12, "Share of Picture (%)": 25.0,
        "Column of Minimum": 2, "Row of Minimum": 0, "Column of Maximum": 5, "Row of Maximum": 2,
        "Share in Isotherm (%)": 100.0 / 6.0, "Emissivity": 0.95, "Reflected Temperature (K)": 291.15,
        "Air Transmission": 0.98, "Air Temperature (K)": 288.15, "Optics Transmission": 0.9,
        "Optics Temperature (K)": 300.15,
    }  # fmt: skip
    for title, value in expected.items():
        assert float(found[title]) == pytest.approx(value, abs=1e-3 if "K)" in title else 1e-4), title
    assert found["Points (u v)"] == "0.25 0; 0.75 0.5"


def test_every_unit_has_its_figures():
    tool = read("SPOT", [(0.5, 0.5)])  # column 4, row 3: 307 K
    for unit, value in ((CELSIUS, 33.85), (FAHRENHEIT, 92.93)):
        found = dict(zip(columns(unit), row(tool, unit), strict=True))
        assert float(found[f"Mean ({unit.symbol})"]) == pytest.approx(value, abs=1e-3)
        assert float(found[f"Error of Mean ({unit.symbol})"]) == pytest.approx(0.02 * unit.scale, abs=1e-4)


def test_what_is_not_known_is_empty():
    temperature, _ = picture()
    region = region_of("BOX", BOX, Window((8, 6), (0, 0), temperature.shape))
    single = ToolReading(1, "a", "Box", 1, "L", measure(temperature, temperature, region), CORRECTION)
    found = dict(zip(columns(KELVIN), row(single, KELVIN), strict=True))
    assert found["Minimum (K)"] == "300.5000" and found["Error of Minimum (K)"] == found["Error of Mean (K)"] == ""
    outside = dict(zip(columns(KELVIN), row(read("SPOT", [(5.0, 5.0)]), KELVIN), strict=True))
    assert outside["Mean (K)"] == outside["Pixels"] == "" and outside["Emissivity"] == "0.95"
    nothing = np.where(temperature > 303.0, np.nan, temperature)
    lost = ToolReading(1, "a", "Box", 1, "L", measure(nothing, temperature * 0 + 0.1, region), CORRECTION)
    found = dict(zip(columns(KELVIN), row(lost, KELVIN), strict=True))
    assert found["Mean (K)"] == "" and found["Pixels"] == "12"
    assert "no value" in short_row(lost, KELVIN) and "not rendered" in short_row(read("SPOT", [(5.0, 5.0)]), KELVIN)


def test_a_short_row_has_as_many_cells_as_titles():
    for tool in (read("SPOT", [(0.1, 0.1)]), read("BOX", BOX), read("SPOT", [(2.0, 0.0)])):
        assert len(short_row(tool, CELSIUS)) == len(SHORT_TITLES)
    assert short_row(read("BOX", BOX), KELVIN)[2:] == [
        "300.50 ± 0.02 K", "305.25 ± 0.02 K", "302.875 ± 0.006 K", "1.66 K", "25 %"
    ]  # fmt: skip


def test_a_difference_has_the_error_of_both():
    first, second = read("BOX", BOX), read("SPOT", [(0.5, 0.5)])
    error = math.hypot(0.02 / math.sqrt(12.0), 0.02)
    assert difference_text(first, second, FAHRENHEIT) == f"{1.8 * (302.875 - 307.0):.2f} ± {1.8 * error:.2f} °F"
    assert difference_text(first, read("SPOT", [(5.0, 5.0)]), KELVIN) == "not rendered"


def test_a_table_that_cannot_be_written_is_named_and_an_old_one_stays(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        write_table(tmp_path / "nowhere" / "tools.csv", [], KELVIN)
    (tmp_path / "tools.csv").write_text("old")
    with pytest.raises(AttributeError):
        write_table(tmp_path / "tools.csv", [None], KELVIN)
    assert (tmp_path / "tools.csv").read_text() == "old" and list(tmp_path.iterdir()) == [tmp_path / "tools.csv"]


# Reports


def test_a_report_is_one_file_with_everything_in_it(tmp_path):
    tools = [
        read("BOX", BOX, 1, "Wall"),
        read("LINE", [(0.0, 0.0), (1.0, 1.0)], 2, "Seam"),
        read("SPOT", [(0.5, 0.5)], 3, "Bolt"),
    ]
    write_report(tmp_path / "report.html", report_of(tools, differences=[("1 Wall - 3 Bolt", "-4.125 K")]))
    found = Page((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert not found.open and not {"script", "link", "iframe"} & set(found.tags)
    [source] = found.sources
    kind, data = source.split(",", 1)
    content = base64.b64decode(data, validate=True)
    assert kind == "data:image/png;base64" and content == png()
    assert struct.unpack(">II", content[16:24]) == (8, 6)
    assert found.tags.count("svg") == 4  # picture, bar, histogram, profile
    assert list(SHORT_TITLES) in found.rows
    assert short_row(tools[0], CELSIUS) in found.rows
    figures = [list(cells) for cells in zip(columns(CELSIUS), *(row(tool, CELSIUS) for tool in tools), strict=True)]
    assert all(cells in found.rows for cells in figures)
    assert ["1 Wall - 3 Bolt", "-4.125 K"] in found.rows
    assert "/a/b.blend" in found.texts


def test_names_are_no_markup(tmp_path):
    tools = [read("BOX", BOX, 1, EVIL)]
    report = report_of(tools, frames=[read("BOX", BOX, 1, EVIL, frame) for frame in (1, 2)], facts={EVIL: {EVIL: EVIL}})
    text = page(report)
    found = Page(text)
    assert EVIL not in text and "script" not in found.tags and not found.open
    assert any(EVIL in cells for cells in found.rows) and EVIL in "".join(found.texts)


def test_a_report_over_frames_has_a_plot_and_a_row_for_each(tmp_path):
    frames = [read("BOX", BOX, 1, "Wall", frame) for frame in range(1, 6)]
    found = Page(page(report_of([], frames)))
    assert sum(cells[:1] == [str(frame)] for cells in found.rows for frame in range(1, 6)) == 5
    assert found.tags.count("svg") == 3 and found.tags.count("circle") == 5


def test_a_report_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        write_report(tmp_path / "nowhere" / "a.html", report_of([]))


# Graphs


def curve(svg):
    """(n, 2) places of the curve of a graph, pixels."""
    data = re.search(r'class="curve"[^>]* d="([^"]*)"', svg).group(1)
    return np.array([pair.split() for pair in re.findall(r"[ML]([\d. -]+)", data)], float)


def test_a_profile_goes_through_its_values():
    values = np.array([300.0, 310.0, 305.0, 295.0])
    places = curve(graphs.profile(values, CELSIUS, "seam"))
    assert len(places) == 4
    np.testing.assert_allclose(np.diff(places[:, 0]), places[1, 0] - places[0, 0], atol=0.11)
    slope = np.diff(places[:, 1]) / np.diff(values)
    np.testing.assert_allclose(slope, slope[0], rtol=0.02)  # coordinates have one decimal
    assert slope[0] < 0.0  # warm is up


def test_a_long_profile_keeps_its_peak():
    values = np.full(50_000, 300.0)
    values[12_345] = 400.0
    places = curve(graphs.profile(values, KELVIN, "seam"))
    assert len(places) <= graphs.MOST_POINTS and places[:, 1].min() < places[:, 1].max() - 100.0


def test_a_profile_has_gaps_where_there_is_no_value():
    svg = graphs.profile(np.array([300.0, 301.0, np.nan, 302.0, 303.0]), KELVIN, "seam")
    assert re.search(r'class="curve"[^>]* d="([^"]*)"', svg).group(1).count("M") == 2
    assert graphs.profile(np.full(3, np.nan), KELVIN, "seam") == ""


def test_a_histogram_has_a_bar_for_each_temperature_and_shows_the_isotherm():
    values = np.repeat([300.0, 310.0, 320.0], (1, 2, 4))
    svg = graphs.histogram_of(values, KELVIN, "wall", (305.0, 315.0))
    heights = [float(text) for text in re.findall(r'class="bar"[^>]* height="([\d.]+)"', svg)]
    np.testing.assert_allclose(np.array(heights) / heights[0], [1.0, 2.0, 4.0], rtol=1e-3)
    assert 'class="isotherm"' in svg
    assert "isotherm" not in graphs.histogram_of(values, KELVIN, "wall", (400.0, 500.0))


@pytest.mark.parametrize("values", [np.full(5, 293.15), np.array([1e-3, 2e-3]), np.array([5000.0, 5000.001])])
def test_any_temperatures_can_be_drawn(values):
    for svg in (graphs.profile(values, CELSIUS, "a"), graphs.histogram_of(values, CELSIUS, "a")):
        assert "nan" not in svg and "inf" not in svg.replace("infrared", "")


# Marks


def test_an_outline_is_where_the_tool_is():
    corners = ((2.0, 3.0), (10.0, 7.0))
    assert lines(Mark("BOX", corners, ""), 13)[0].tolist() == [[2, 3], [10, 3], [10, 7], [2, 7], [2, 3]]
    [circle] = lines(Mark("ELLIPSE", corners, ""), 13)
    np.testing.assert_allclose(np.sum(((circle - (6.0, 5.0)) / (4.0, 2.0)) ** 2, axis=1), 1.0)
    assert len(lines(Mark("SPOT", corners[:1], ""), 13)) == 4
    assert lines(Mark("POLYGON", (*corners, (0.0, 9.0)), ""), 13)[0].tolist()[-1] == [2, 3]


def test_a_line_is_drawn_along_its_pixels_and_nowhere_else():
    image = np.full((20, 30, 3), 0.5, np.float32)
    draw_marks(image, [Mark("LINE", ((5.5, 10.5), (24.5, 10.5)), "")], 13)
    np.testing.assert_allclose(image[10, 5:25], 1.0)  # light in the middle
    assert np.all(image[[9, 11], 6:24] < 0.35)  # and dark at the sides
    far = np.abs(np.arange(20) - 10) > 3
    np.testing.assert_array_equal(image[far], 0.5)


def test_marks_outside_the_picture_are_cut_off():
    image = np.full((4, 4, 3), 0.5, np.float32)
    draw_marks(image, [Mark("BOX", ((-50.0, -50.0), (-10.0, -10.0)), ""), Mark("SPOT", ((99.0, 2.0),), "")], 13)
    np.testing.assert_array_equal(image, 0.5)


@pytest.mark.parametrize("place", [(0.0, 0.0), (100.0, 80.0), (50.0, 79.0)])
def test_labels_stay_inside_the_picture(place):
    for mark in (Mark("SPOT", (place,), "1"), Mark("LINE", (place, (50.0, 40.0)), "1")):
        x, y = label_place(mark, 13, 20.0, (100.0, 80.0))
        assert 0.0 <= x <= 80.0 and 0.0 <= y <= 67.0
