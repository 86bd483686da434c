# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw images/simulation.png: a heat sink that warms up, from a simulation's VTU files to the picture.

    python -m docs.tools.plot_simulation

needs Blender as a Python module, meshio and Pillow.
"""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import bpy
import meshio
import numpy as np
from PIL import Image

from addon.convert import main as convert
from docs.tools.blender import registered
from docs.tools.paths import IMAGES
from docs.tools.pictures import labelled, tiled

CELL, SHAPE = 2e-3, (30, 20, 15)  # m, cells along x, y, z of the block that the heat sink is cut from
FIN, FINS_FROM = 2, 3  # cells: width of a fin and of a gap, height of the plate below
TIMES = 0.0, 20.0, 60.0, 240.0  # s
AMBIENT, POWER, FILM = 293.15, 40.0, 12.0  # K; W of the chip; W m-2 K-1 to the air, radiation included
CONDUCTIVITY, CAPACITY = 160.0, 2.4e6  # W m-1 K-1 and J m-3 K-1, aluminium


def solid() -> np.ndarray:
    """(x, y, z) bool: which cells are of metal."""
    metal = np.ones(SHAPE, bool)
    across = np.arange(SHAPE[0]) // FIN % 2 == 1
    metal[across, :, FINS_FROM:] = False
    return metal


def temperatures(metal: np.ndarray) -> list[np.ndarray]:
    """(x, y, z) K of the cells at each of TIMES, by explicit finite volumes."""
    step = 0.8 * CELL**2 * CAPACITY / (6.0 * CONDUCTIVITY + 6.0 * FILM * CELL)  # s, below the limit of stability
    kelvin, heat = np.full(SHAPE, AMBIENT), np.zeros(SHAPE)
    chip = np.s_[10:20, 6:14, 0]
    heat[chip] = POWER / heat[chip].size
    free = np.where(metal, 6.0, 0.0)
    pairs = []
    for axis in range(3):
        low, high = (tuple(part if i == axis else slice(None) for i in range(3)) for part in (np.s_[:-1], np.s_[1:]))
        both = metal[low] & metal[high]
        free[low] -= both
        free[high] -= both
        pairs.append((low, high, both))
    found, now = [kelvin.copy()], 0.0
    for time in TIMES[1:]:
        for _ in range(math.ceil((time - now) / step)):
            gain = heat - FILM * CELL**2 * free * (kelvin - AMBIENT)
            for low, high, both in pairs:
                flow = CONDUCTIVITY * CELL * (kelvin[high] - kelvin[low]) * both
                gain[low] += flow
                gain[high] -= flow
            kelvin = kelvin + step / (CAPACITY * CELL**3) * np.where(metal, gain, 0.0)
        now = time
        found.append(kelvin)
    return found


def write(folder: Path) -> None:
    """The VTU files of a simulation, with the temperature at points: the mean of the cells around."""
    metal = solid()
    shape = np.array(SHAPE) + 1
    corner = np.argwhere(metal)
    around = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    cells = np.ravel_multi_index(np.moveaxis(corner[:, None] + around, 2, 0), shape)
    points = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3) * CELL
    count = np.bincount(cells.ravel(), minlength=len(points))
    for number, kelvin in enumerate(temperatures(metal), 1):
        total = np.bincount(cells.ravel(), np.repeat(kelvin[metal], 8), minlength=len(points))
        field = np.where(count > 0, total / np.maximum(count, 1), np.nan)  # no point of a cell is without one
        meshio.Mesh(points, [("hexahedron", cells)], point_data={"T": field}).write(folder / f"step_{number}.vtu")


def build(folder: Path) -> bpy.types.Scene:
    """A scene with the series, one step a frame, on a table under a cold ceiling."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "INFRARED_PHOTONS"
    files = [{"name": path.name} for path in sorted(folder.glob("*.ply"))]
    bpy.ops.infrared.temperature_series(directory=f"{folder}/", files=files)
    sink = bpy.context.object
    sink.scale = (20.0,) * 3  # so that lengths are around a metre
    sink.data.materials.append(material("Black Paint", emissivity=0.9))
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.6, 0.4, -0.01))
    table = bpy.context.object
    table["temperature"] = AMBIENT
    table.data.materials.append(material("Brushed Metal", emissivity=0.3, specular=0.8, roughness=0.15))
    scene.world = bpy.data.worlds.new("Room")
    scene.world["temperature"] = AMBIENT - 5.0
    eye = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(eye)
    scene.camera, eye.data.lens = eye, 46.0
    eye.location, eye.rotation_euler = (2.4, -2.0, 1.6), (math.radians(63.0), 0.0, math.radians(38.0))
    scene.render.resolution_x, scene.render.resolution_y = 640, 480
    scene.infrared.passes, scene.infrared.photons_per_pass, scene.infrared.band_count = 4, 50_000, 2
    return scene


def material(name: str, **properties) -> bpy.types.Material:
    result = bpy.data.materials.new(name)
    for key, value in properties.items():
        result[key] = value
    return result


def render(scene, frame: int) -> np.ndarray:
    """(height, width) apparent temperatures, degrees Celsius, row 0 at the top."""
    from addon.rendering.last_render import finished_layers

    scene.frame_set(frame)
    bpy.ops.render.render()
    return finished_layers["ViewLayer"]["temperature"][::-1] - 273.15


def main() -> None:
    with registered(), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(folder)
        convert([str(folder / "step_*.vtu"), "--output", str(folder / "sink_#.ply")])
        scene = build(folder)
        pictures: list[Image.Image] = [
            labelled(render(scene, frame), f"{TIMES[frame - 1]:g} s, °C") for frame in range(2, len(TIMES) + 1)
        ]
    tiled(pictures, len(pictures)).save(IMAGES / "simulation.png", optimize=True)


if __name__ == "__main__":
    main()
