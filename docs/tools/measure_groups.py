# SPDX-License-Identifier: GPL-3.0-or-later
"""What recombining a render for other temperatures takes, and images/groups.png, for docs/groups.md.

    python -m docs.tools.measure_groups

The demo with its ring, its table and the sky as temperature groups, rendered once, recombined while the ring heats up;
and seconds for an image of 640 x 480 pixels, 15 bands and 6 layers.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import bpy
import numpy as np
from PIL import Image

from addon.output.group_exr import read_group_exr, write_group_exr, write_recombined
from addon.output.palette import display
from addon.output.temperature_scale import TemperatureScale
from addon.solver.image.recombine import LayeredImage
from addon.solver.physics.layers import Layer
from addon.ui.temperatures import temperature_groups
from docs.tools.blender import open_demo, registered
from docs.tools.paths import IMAGES
from docs.tools.pictures import BACKGROUND, resized, tiled, titled

KELVIN = (300, 340, 400, 480)  # of the ring; 340 is what the demo has
PASSES, FRESH = 8, 480  # FRESH: K, the last of them, rendered anew for comparison
REPEATS = 5


def demo(folder: Path) -> None:
    """Open the demo, with three groups and a file for them."""
    scene = open_demo()
    scene.world["temperature_group"] = "sky"
    for name in ("Ring", "Plane"):
        bpy.data.objects[name]["temperature_group"] = name
    scene.render.resolution_percentage = 50
    infrared = scene.infrared
    infrared.passes, infrared.time_limit, infrared.target_noise = PASSES, 0.0, 0.0
    infrared.group_exr_path = str(folder / "groups.exr")


def render() -> tuple[float, np.ndarray]:
    """Seconds of a render, and its apparent temperatures (h, w), K."""
    from addon.rendering.final_render import finished_layers

    begin = time.perf_counter()
    bpy.ops.render.render()
    return time.perf_counter() - begin, finished_layers["ViewLayer"]["temperature"]


def compare(folder: Path) -> list[np.ndarray]:
    """Print what recombining takes and how far it is from a render; the temperatures of the series."""
    import OpenEXR

    demo(folder)
    bpy.context.scene.infrared.passes = 1
    render()  # compiles the kernels
    bpy.context.scene.infrared.passes = PASSES
    seconds, _ = render()
    table = folder / "series.csv"
    table.write_text("frame,Ring\n" + "".join(f"{kelvin},{kelvin}\n" for kelvin in KELVIN))
    begin = time.perf_counter()
    temperature_groups.recombine(bpy.context, folder / "groups.exr", str(folder / "new"), "SERIES", str(table))
    each = (time.perf_counter() - begin) / len(KELVIN)
    layers = len(read_group_exr(folder / "groups.exr")[0].layers)
    print(f"demo at 50 %, {layers} layers: render {seconds:.1f} s, recombined {each:.2f} s an image")
    files = (OpenEXR.File(str(folder / f"new{kelvin:04d}.exr"), separate_channels=True) for kelvin in KELVIN)
    series = [file.channels()["Temperature.V"].pixels[::-1].copy() for file in files]
    bpy.data.objects["Ring"]["temperature"] = float(FRESH)
    bpy.context.scene.infrared.group_exr_path = ""
    seconds, fresh = render()
    difference = series[KELVIN.index(FRESH)] - fresh
    print(
        f"ring at {FRESH} K, rendered anew without groups in {seconds:.1f} s: mean difference "
        f"{difference.mean():.4f} K, median of its size {np.median(np.abs(difference)):.3f} K"
    )
    return series


def measure(folder: Path) -> None:
    """Print seconds for an image of 640 x 480 pixels, 15 bands and 6 layers."""
    edges = np.linspace(7.5, 13.5, 16)
    noise = np.random.default_rng(0).normal(1.0, 0.1, (6, 15, 480, 640)).astype(np.float32)
    layers = (Layer(), *(Layer(f"group {i}", "", (np.array([10.0]), np.array([0.9])), 320.0, 320.0) for i in range(5)))
    image, path = LayeredImage(noise, layers, edges, 293.0, np.ones(15)), folder / "large.exr"
    facts = {"referenceTemperature": 293.0, "bandWeights": " ".join(["1.0"] * 15)}
    write_group_exr(path, image, facts | {"assumedEmissivity": 1.0, "reflectedTemperature": 293.0})
    steps = {"read once": lambda: read_group_exr(path), "bands": lambda: image.recombined({"group 1": 350.0})}
    steps["bands, Temperature and file"] = lambda: write_recombined(folder / "one.exr", image, {"group 1": 350.0})
    for what, step in steps.items():
        step()
        times = []
        for _ in range(REPEATS):
            begin = time.perf_counter()
            step()
            times.append(time.perf_counter() - begin)
        print(f"{what}: {np.median(times):.3f} s")
    print(f"files: groups {path.stat().st_size / 1e6:.0f} MB, image {(folder / 'one.exr').stat().st_size / 1e6:.0f} MB")


def draw(series: list[np.ndarray]) -> None:
    """The series side by side, in one scale."""
    scale = TemperatureScale("IRON", 255.0, 330.0)
    colours = [Image.fromarray(display(scale.colours(image[::-1]))) for image in series]
    pictures = [titled(resized(shown), f"ring at {kelvin} K") for kelvin, shown in zip(KELVIN, colours, strict=True)]
    tiled(pictures, len(pictures), gap=6, background=BACKGROUND).save(IMAGES / "groups.png", optimize=True)


def main() -> None:
    with registered(), tempfile.TemporaryDirectory() as folder:
        series = compare(Path(folder))
        measure(Path(folder))
    draw(series)


if __name__ == "__main__":
    main()
