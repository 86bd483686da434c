# SPDX-License-Identifier: GPL-3.0-or-later
"""What is told of a finished render in tables and reports: what its measuring tools read, and how it was made."""

from __future__ import annotations

import datetime
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import bpy
import numpy as np

from ..heat_settings import read_scale, scene_unit
from ..measure_settings import KIND_NAMES
from ..measuring.report import Report, ReportedPicture, ReportedStrip
from ..measuring.table import SHORT_TITLES, ToolReading, difference_text, short_row
from ..output.heat_picture import Beside, write_picture
from ..output.marks import Mark
from ..output.temperature_scale import TemperatureUnit
from ..version import version
from .last_render import FinishedFrame
from .readings import MeasuredPicture, finished_picture, images_now, read_tool, tool_correction, tool_values

UNSAVED = "not saved yet"


def tool_readings(infrared, layer: str, picture: MeasuredPicture, frame: int, values: bool = True) -> list[ToolReading]:
    """What the measuring tools of scene.infrared read in a picture of a view layer.

    frame: its number. values: whether the temperatures in the tools' pixels are kept, too.
    """
    return [
        ToolReading(
            number=number,
            name=tool.name,
            kind=KIND_NAMES[tool.kind],
            frame=frame,
            layer=layer,
            measurement=read_tool(tool, picture, infrared),
            correction=tool_correction(tool, infrared, picture),
            values=tool_values(tool, picture, infrared) if values else None,
            points=tuple(tool.places()),
        )
        for number, tool in enumerate(infrared.measuring_tools, 1)
    ]


def marks(infrared, picture: MeasuredPicture) -> list[Mark]:
    """The outlines of the measuring tools in the pixels of a picture's images, labelled with their numbers."""
    size, origin = np.array(picture.window.size), np.array(picture.window.origin)
    return [
        Mark(tool.kind, tuple(map(tuple, (np.array(tool.places()) * size - origin).tolist())), str(number))
        for number, tool in enumerate(infrared.measuring_tools, 1)
        if len(tool.points)
    ]


def beside_picture(infrared, layer: str, images: dict, frame: FinishedFrame, shown: tuple[bool, bool, bool]) -> Beside:
    """What an exported picture of a view layer shows beside its temperatures. shown: bar, tools and table."""
    bar, tools, table = shown
    picture, unit, rows = finished_picture(images, frame), scene_unit(infrared.id_data), []
    if table and len(infrared.measuring_tools):
        read = tool_readings(infrared, layer, picture, frame_number(images), values=False)
        rows = [SHORT_TITLES, *(short_row(tool, unit) for tool in read)]
    return Beside(bar, marks(infrared, picture) if tools else (), rows)


def frame_number(images: dict) -> int:
    """Number of the frame that the images of a view layer are of."""
    return int(images["metadata"].get("frame", 0))


def differences(infrared, tools: Iterable[ToolReading], unit: TemperatureUnit) -> list[tuple[str, str]]:
    """The difference that scene.infrared asks for, as what and how much; none if a tool of it is not there."""
    by_name = {tool.name: tool for tool in tools}
    first, second = by_name.get(infrared.difference_of), by_name.get(infrared.difference_to)
    if first is None or second is None:
        return []
    return [(f"{first.number} {first.name} - {second.number} {second.name}", difference_text(first, second, unit))]


def build_report(
    scene, layers: dict[str, dict], frames: dict[str, FinishedFrame], over_frames=(), strips: Mapping | None = None
) -> Report:
    """The report of a finished render, with its measuring tools as they are now. layers, frames: see last_render.
    over_frames, strips: what tools read over an animation, and its small pictures, see frame_tools."""
    unit = scene_unit(scene)
    pictures = [_reported(scene, layer, layers[layer], frames[layer], unit) for layer in layers if layer in frames]
    name = Path(bpy.data.filepath).name or "Infrared picture"
    written = datetime.datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z")
    facts = {
        "Made with": {
            "Scene file": bpy.data.filepath or UNSAVED,
            "Scene": scene.name,
            "Engine": f"Infrared Photons {version()}",
            "Blender": bpy.app.version_string,
            "Written": written,
        }
    }
    lead = f"Temperatures in {unit.symbol}. Scene '{scene.name}'."
    small = [_strip(scene, layer, images, unit) for layer, images in (strips or {}).items()]
    return Report(name, lead, unit, pictures, facts, over_frames, small)


def _strip(scene, layer: str, images: Mapping[int, np.ndarray], unit: TemperatureUnit) -> ReportedStrip:
    """Small pictures of a view layer, all in the colours of one range: one that is fitted is so to all of them."""
    scale = read_scale(scene.infrared).fitted(np.stack(list(images.values())))
    height, width = next(iter(images.values())).shape
    pngs = {frame: _png(image, scale, unit) for frame, image in images.items()}
    return ReportedStrip(f"{layer}, frames {min(images)} to {max(images)}", pngs, (width, height), scale)


def _reported(scene, layer: str, images: dict, frame: FinishedFrame, unit: TemperatureUnit) -> ReportedPicture:
    infrared, picture = scene.infrared, finished_picture(images, frame)
    now = images_now(images, frame, infrared)
    scale = read_scale(infrared).fitted(now["temperature"])
    number = frame_number(images)
    tools = tool_readings(infrared, layer, picture, number)
    height, width = now["temperature"].shape
    return ReportedPicture(
        title=f"{layer}, frame {number}",
        png=_png(now["temperature"], scale, unit),
        size=(width, height),
        scale=scale,
        tools=tools,
        marks=marks(infrared, picture),
        differences=differences(infrared, tools, unit),
        facts=_picture_facts(scene, now, scale, unit),
    )


def _png(temperature: np.ndarray, scale, unit: TemperatureUnit) -> bytes:
    """The picture alone as the content of a PNG file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "picture.png"
        write_picture(path, temperature, scale, unit, Beside(colour_bar=False))
        return path.read_bytes()


def _picture_facts(scene, images: dict, scale, unit: TemperatureUnit) -> dict[str, dict[str, str]]:
    """What is told of a picture by heading and name."""
    infrared, facts = scene.infrared, images["metadata"]

    edges, noise = images["band_edges"], images["noise"]
    height, width = noise.shape
    known = noise[np.isfinite(noise)]
    error = "unknown"
    if known.size and int(facts["passes"]) > 1:
        middle, most = (unit.scale * float(each) for each in np.percentile(known, (50, 95)))
        error = f"{middle:.3g} {unit.symbol} in the middle, below {most:.3g} {unit.symbol} in 95 % of the pixels"
    air = {"FORMULA": ["object_distance", "relative_humidity"], "WORLD": ["object_distance"]}
    ends = scale.isotherm
    isotherm = {"Isotherm": f"{unit.text(ends.low)} to {unit.text(ends.high)}"} if ends else {}
    properties = infrared.bl_rna.properties
    ways = {
        properties[name].name: f"{getattr(infrared, name):.6g}{' %' if name == 'relative_humidity' else ''}"
        for name in air.get(infrared.air_transmission_source, [])
    }
    return {
        "Object parameters": {
            "Emissivity": f"{float(facts['assumedEmissivity']):.4g}",
            "Reflected temperature": unit.text(facts["reflectedTemperature"]),
            **ways,
            "Air transmission": f"{float(facts['airTransmission']):.4g}",
            "Air temperature": unit.text(facts["airTemperature"]),
            "Optics transmission": f"{float(facts['opticsTransmission']):.4g}",
            "Optics temperature": unit.text(facts["opticsTemperature"]),
        },
        "Picture": {
            "Size": f"{width} x {height} pixels",
            "Camera": scene.camera.name if scene.camera else "none",
            "Noise": error,
            "Palette": properties["palette"].enum_items[scale.palette].name,
            "Range": f"{unit.text(scale.low)} to {unit.text(scale.high)}",
            **isotherm,
            "Sensor": str(facts["sensor"]),
            "Bands": f"{len(edges) - 1}, {edges[0]:.6g} to {edges[-1]:.6g} µm: "
            + ", ".join(f"{edge:.6g}" for edge in edges),
        },
        "As the files state it": {name: str(value) for name, value in facts.items()},
    }
