# SPDX-License-Identifier: GPL-3.0-or-later
"""A report of measured pictures: one HTML file with everything in it, which any browser shows and prints."""

from __future__ import annotations

import base64
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import numpy as np

from ..output.marks import Mark, label_place, lines
from ..output.temperature_scale import TemperatureScale, TemperatureUnit
from ..solver.system.files import replacing
from . import graphs
from .regions import AREAS
from .table import SHORT_TITLES, ToolReading, by_tool, columns, row, short_row

LEAST_WIDTH = 480  # px that a small picture is shown in
MOST_ENLARGED = 8
SHORT_BAR = 200  # px, height of the bar beside small pictures
LETTER = 0.65  # width of a letter or figure, in heights of the text
STYLE = """
:root { color-scheme: light dark; }
body { font: 15px/1.45 system-ui, "Segoe UI", Roboto, "Helvetica Neue", sans-serif; margin: 2rem auto; max-width: 62rem;
  padding: 0 1rem; color: #1c1c22; background: #fff; }
h1 { font-size: 1.6rem; margin: 0 0 .2rem; } h2 { font-size: 1.2rem; margin: 2rem 0 .6rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 .3rem; } p.lead { margin: 0 0 1rem; color: #5c5c66; }
.picture { display: flex; flex-wrap: wrap; gap: 12px; align-items: flex-start; }
.picture svg.thermal { max-width: calc(100% - 110px); height: auto; background: #18181c; }
.picture image { image-rendering: pixelated; }
.mark { fill: none; stroke: #fff; stroke-width: 1.4; vector-effect: non-scaling-stroke; }
.edge { fill: none; stroke: #000; stroke-width: 3.6; vector-effect: non-scaling-stroke; }
table.tools td:not(:nth-child(2)) { white-space: nowrap; }
svg text { font: 12px system-ui, sans-serif; fill: currentColor; } svg text.label { fill: #fff; font-weight: 600; }
.under { fill: #18181c; opacity: .75; }
table { border-collapse: collapse; margin: .4rem 0 1rem; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .25rem .8rem .25rem 0; border-bottom: 1px solid #d9d9de; vertical-align: top; }
th { font-weight: 600; } td { overflow-wrap: break-word; max-width: 18rem; } .all { font-size: 13px; }
.wide { overflow-x: auto; } svg.graph { width: 100%; max-width: 640px; height: auto; }
.strip { display: flex; flex-wrap: wrap; gap: 8px; flex: 1; } figure { margin: 0; break-inside: avoid; }
figcaption { font-size: 12px; color: #5c5c66; } figure img { image-rendering: pixelated; background: #18181c; }
.grid { stroke: #8883; } .frame, .tick { stroke: currentColor; fill: none; }
.curve { fill: none; stroke: #c2410c; stroke-width: 1.5; } .bar { fill: #c2410c; } .isotherm { fill: #22c55e55; }
.legend span { margin-right: 1.2rem; } .legend i { display: inline-block; width: .8rem; height: .8rem;
  margin-right: .35rem; vertical-align: -1px; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1.2rem; margin: .4rem 0 1rem; }
dt { color: #5c5c66; } dd { margin: 0; overflow-wrap: anywhere; }
@media (prefers-color-scheme: dark) { body { color: #e6e6ea; background: #18181c; }
  th, td { border-color: #3a3a42; } dt, p.lead { color: #a6a6b0; } }
@media print { body { margin: 0; max-width: none; } table { font-size: 12px; } .all { font-size: 11px; }
  h2, h3 { break-after: avoid; } tr, dl, svg { break-inside: avoid; } }
"""


@dataclass(frozen=True)
class ReportedPicture:
    """A picture of a report. title: such as the name of its view layer. png: the picture alone. size: width and height
    in pixels. scale: of its colours, whose ends are known. tools: what was read in it. marks: of these tools, in
    pixels. differences: (what, value) in words. facts: more to be told, by heading and name.
    """

    title: str
    png: bytes
    size: tuple[int, int]
    scale: TemperatureScale
    tools: Sequence[ToolReading] = ()
    marks: Sequence[Mark] = ()
    differences: Sequence[tuple[str, str]] = ()
    facts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class ReportedStrip:
    """Small pictures of an animation. title: such as the name of their view layer. pngs: by the number of the frame.
    size: width and height of each in pixels. scale: of the colours of all, whose ends are known.
    """

    title: str
    pngs: Mapping[int, bytes]
    size: tuple[int, int]
    scale: TemperatureScale


@dataclass(frozen=True)
class Report:
    """title, lead: what stands on top. unit: of all temperatures. facts: about all pictures, by heading and name.
    frames: what tools read over an animation, if there is one. strips: small pictures of it.
    """

    title: str
    lead: str
    unit: TemperatureUnit
    pictures: Sequence[ReportedPicture]
    facts: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    frames: Sequence[ToolReading] = ()
    strips: Sequence[ReportedStrip] = ()


def write_report(path: str | os.PathLike, report: Report) -> None:
    """Write a report as an HTML file, UTF-8, that needs no other file and loads none.

    An existing file is replaced once the new one is complete. Raises OSError naming the path if it cannot be written.
    """
    with replacing(Path(path), "the report") as unfinished:
        unfinished.write_text(page(report), encoding="utf-8")


def page(report: Report) -> str:
    """The HTML of a report. All names are escaped."""
    parts = [
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(report.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>",
        f'<h1>{escape(report.title)}</h1>\n<p class="lead">{escape(report.lead)}</p>',
    ]
    for picture in report.pictures:
        parts.append(_picture(picture, report.unit))
    parts += [_strip(strip, report.unit) for strip in report.strips]
    if report.frames:
        parts.append(_frames(report.frames, report.unit))
    parts.append(_facts(report.facts, "h2"))
    return "\n".join([*parts, "</body>\n</html>\n"])


def _picture(picture: ReportedPicture, unit: TemperatureUnit) -> str:
    """A picture with its bar and tools, the table of these, their graphs, and what else is told."""
    parts = [f'<section>\n<h2>{escape(picture.title)}</h2>\n<div class="picture">', _thermal(picture, unit), "</div>"]
    if picture.tools:
        parts += ["<h3>Measuring tools</h3>", _table(SHORT_TITLES, [short_row(tool, unit) for tool in picture.tools])]
    if picture.differences:
        parts += ["<h3>Differences</h3>", _table(("Difference", "Means"), picture.differences)]
    isotherm = picture.scale.isotherm
    ends = (isotherm.low, isotherm.high) if isotherm else None
    for tool in picture.tools:
        parts += _graph(tool, unit, ends)
    if picture.tools:
        titles, *figures = zip(columns(unit), *(row(tool, unit) for tool in picture.tools), strict=True)
        parts += ["<h3>All figures</h3>", _table(titles, figures, "all")]
    return "\n".join([*parts, _facts(picture.facts, "h3"), "</section>"])


def _thermal(picture: ReportedPicture, unit: TemperatureUnit) -> str:
    """The picture as SVG with the outlines of the tools over it, and the bar."""
    width, height = picture.size
    larger = min(MOST_ENLARGED, max(1, -(-LEAST_WIDTH // width)))
    text = 13 / larger  # of a label, in pixels of the picture
    parts = [
        f'<svg class="thermal" width="{larger * width}" height="{larger * height}" viewBox="0 0 {width} {height}">',
        f'<image width="{width}" height="{height}" href="{_data(picture.png)}"/>',
    ]
    for mark in picture.marks:
        drawn = lines(mark, text)
        path = " ".join("M" + "L".join(f"{x:.2f} {height - y:.2f}" for x, y in line.tolist()) for line in drawn)
        long = LETTER * text * len(mark.label)
        x, y = label_place(mark, text, long, picture.size)
        parts += [
            f'<path class="edge" d="{path}"/><path class="mark" d="{path}"/>',
            f'<rect class="under" x="{x - 0.25 * text:.2f}" y="{height - y - 0.95 * text:.2f}" '
            f'width="{long + 0.5 * text:.2f}" height="{1.2 * text:.2f}"/>',
            f'<text class="label" style="font-size:{text:.3f}px" x="{x:.2f}" y="{height - y:.2f}" '
            f'textLength="{long:.2f}" lengthAdjust="spacingAndGlyphs">{escape(mark.label)}</text>',
        ]
    return "\n".join([*parts, "</svg>", graphs.bar(picture.scale, unit, max(160, min(larger * height, 480)))])


def _graph(tool: ToolReading, unit: TemperatureUnit, isotherm: tuple[float, float] | None) -> list[str]:
    """The profile of a line or the histogram of an area, with its heading."""
    if tool.values is None or len(tool.values) < 2:
        return []
    label = f"{tool.number} {tool.name}"
    if tool.kind.upper() in AREAS:
        drawn = graphs.histogram_of(tool.values, unit, label, isotherm)
    else:
        drawn = graphs.profile(tool.values, unit, label)
    return [f"<h3>{escape(label)}</h3>", drawn] if drawn else []


def _strip(strip: ReportedStrip, unit: TemperatureUnit) -> str:
    """Small pictures in a grid, each with the number of its frame under it, and the bar of all."""
    width, height = strip.size
    pictures = "\n".join(
        f'<figure><img width="{width}" height="{height}" alt="Frame {frame}" src="{_data(png)}"/>'
        f"<figcaption>{frame}</figcaption></figure>"
        for frame, png in strip.pngs.items()
    )
    bar = graphs.bar(strip.scale, unit, SHORT_BAR)
    parts = [f'<section>\n<h2>{escape(strip.title)}</h2>\n<div class="picture">', bar, '<div class="strip">', pictures]
    return "\n".join([*parts, "</div>", "</div>", "</section>"])


def _data(png: bytes) -> str:
    """The address of an image that holds the image itself."""
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def _frames(frames: Sequence[ToolReading], unit: TemperatureUnit) -> str:
    """The tools over an animation: a plot, and the table."""
    series = {}
    several = len({tool.layer for tool in frames}) > 1
    for (layer, name), tools in by_tool(frames).items():
        read = [tool for tool in tools if tool.measurement is not None]
        kelvin = [(tool.measurement.minimum, tool.measurement.mean, tool.measurement.maximum) for tool in read]
        if read:
            series[f"{layer}: {name}" if several else name] = [tool.frame for tool in read], np.array(kelvin)
    plot = graphs.over_frames(series, unit, "Mean temperature of each tool over frames, with its least and largest")
    table = _table(("Frame", *SHORT_TITLES), [(str(tool.frame), *short_row(tool, unit)) for tool in frames])
    return "\n".join(["<section>\n<h2>Over frames</h2>", plot, table, "</section>"])


def _table(titles: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "tools") -> str:
    head = "".join(f"<th>{escape(title)}</th>" for title in titles)
    lines = ["<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>" for cells in rows]
    table = [f'<table class="{kind}">', f"<thead><tr>{head}</tr></thead>", "<tbody>", *lines, "</tbody></table>"]
    return "\n".join(['<div class="wide">', *table, "</div>"])


def _facts(facts: Mapping[str, Mapping[str, str]], heading: str) -> str:
    parts = []
    for title, rows in facts.items():
        terms = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in rows.items())
        parts.append(f"<{heading}>{escape(title)}</{heading}>\n<dl>{terms}</dl>")
    return "\n".join(parts)
