# SPDX-License-Identifier: GPL-3.0-or-later
"""What camera effects do, for docs/detector.md: tables of kinds of cameras, and images/detector.png of the demo:

    python run.py demo --resolution 320x240 --passes 60
    python -m docs.tools.measure_detector [render/demo-bands.exr]

Needs the environment of run.py.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import OpenEXR
from PIL import Image

from addon.output.exr import channel_name
from addon.output.palette import display, thermal
from addon.solver import Camera
from addon.solver.image.detector import STATED, Detector, diffraction_mtf, expose
from addon.solver.physics import sensors
from addon.solver.physics.spectrum import band_names, band_radiance, sensor_radiance, uniform_edges
from docs.tools.pages import table
from docs.tools.paths import DEMO_BANDS, IMAGES
from docs.tools.pictures import tiled, titled

CAMERAS = (  # sensor, um, f-number, pitch in um
    ("MICROBOLOMETER", (7.5, 14.0), 1.0, 12.0),
    ("MICROBOLOMETER", (7.5, 14.0), 1.0, 17.0),
    ("MICROBOLOMETER", (7.5, 14.0), 1.4, 12.0),
    ("INSB", (3.0, 5.0), 2.5, 15.0),
    ("INSB", (3.0, 5.0), 4.0, 15.0),
    ("HGCDTE", (8.0, 11.0), 2.0, 15.0),
)
BITS = (8, 14)
SIZES = ((640, 480), (1920, 1080))
SHOWN = (  # of the picture: title and camera
    ("As rendered", Detector()),
    ("f/2, pixels of 12 um", Detector(f_number=2.0)),
    ("f/2, NETD 0.5 K, offsets 0.5 K", Detector(f_number=2.0, netd=0.5, offset_spread=0.5)),
    ("the same, 5 bits", Detector(f_number=2.0, netd=0.5, offset_spread=0.5, bits=5, range=(283.15, 353.15))),
)
CROP = np.s_[70:190, 70:230]  # rows and columns of 320 x 240 pixels
COLDEST, HOTTEST = 285.0, 330.0  # K, of the palette
ZOOM, TITLE, FONT = 3, 26, 15  # pixels


def table_of_cameras() -> None:
    """Contrast that diffraction leaves at the finest wave that pixels show, and steps of digital numbers."""
    rows = []
    low, high = Detector().range
    for name, (first, last), f_number, pitch in CAMERAS:
        response, edges = sensors.BUILT_IN[name](), uniform_edges(first, last, 16)
        weights = sensors.band_weights(response, edges)
        seen = weights * band_radiance(edges, STATED)
        contrast = diffraction_mtf(0.5 / pitch, 0.5 * (edges[:-1] + edges[1:]), f_number) @ seen / seen.sum()
        ends = sensor_radiance(edges, weights, np.array([low, high]))
        per_kelvin = sensor_radiance(edges, weights, STATED, derivative=True) / STATED
        steps = (np.diff(ends).item() / (2**bits - 1) / per_kelvin for bits in BITS)
        kind = f"{response.name}, f/{f_number:g}, {pitch:g} µm"
        rows.append((kind, f"{first:g} to {last:g} µm", f"{contrast:.0%}", *(f"{step:.2g} K" for step in steps)))
    steps = (f"step of {bits} bits" for bits in BITS)
    print(table(("camera", "band", "contrast left by diffraction", *steps), *rows))


def table_of_times() -> None:
    """Seconds that the effects take, all of them, of 16 bands."""
    edges, weights = uniform_edges(7.5, 14.0, 16), np.ones(16)
    all_effects = Detector(f_number=1.0, netd=0.05, gain_spread=0.001, offset_spread=0.02, bits=14)
    for width, height in SIZES:
        bands, camera = np.ones((16, height, width), np.float32), Camera(width=width, height=height)
        times = []
        for detector in (all_effects, Detector(netd=0.05, bits=14)):
            begin = time.process_time()
            expose(bands, edges, weights, detector, camera)
            times.append(time.process_time() - begin)
        print(f"{width} x {height}, 16 bands: {times[0]:.2f} s, without optics {times[1]:.2f} s")


def picture(path: Path) -> Image.Image:
    """A part of the demo through each of the cameras in SHOWN."""
    with OpenEXR.File(str(path)) as file:
        edges = np.array(file.header()["bandEdges"].split(), float)
        bands = [file.channels()[channel_name(name)].pixels[::-1] for name in band_names(edges)]
    height, width = bands[0].shape
    parts = []
    for title, detector in SHOWN:
        shown = expose(bands, edges, np.ones(len(bands)), detector, Camera(width=width, height=height))
        if shown.clipped:
            print(f"{title}: {shown.clipped} pixels clipped")
        colours = Image.fromarray(display(thermal(shown.temperature[::-1][CROP], COLDEST, HOTTEST)))
        colours = colours.resize((ZOOM * colours.width, ZOOM * colours.height), Image.Resampling.NEAREST)
        parts.append(titled(colours, title, TITLE, FONT))
    return tiled(parts, columns=2)


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DEMO_BANDS
    table_of_cameras()
    table_of_times()
    picture(path).save(IMAGES / "detector.png", optimize=True)


if __name__ == "__main__":
    main()
