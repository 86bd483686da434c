# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair costs: a head with hair of 0.08 mm against the same head without, in a room.

    python -m tests.benchmarks.hair [--hairs N] [--width PIXELS] [--passes N] [--photons N]

Prints Markdown: times of reading Blender's scene, of the preparation, of a pass (the median) and of what of it is
Embree's, processor time of all threads in s; the triangles; the camera rays of a pixel and pass; and the ratio of whole
renders. Hair is all edges, so a pass sends more camera rays through it. The last row is of the same hair with no more
of them than the bald head has; below stands what more of them bring: 1 / (noise^2 x time), with the mean square of the
noise of all pixels.
"""

import argparse
import time
from typing import NamedTuple
from unittest.mock import patch

import bpy
import numpy as np

from addon.reading import motion
from addon.solver import Settings, render
from addon.solver import passes as pass_loop
from addon.solver.planning import antialiasing
from docs.tools.blender import registered
from tests.helpers.blender import camera, link, material, read_as_rendered
from tests.helpers.counting import counted_rays, total
from tests.helpers.process import resident

POINTS = 8  # of a hair
RADIUS, HEAD = 4e-5, 0.09  # m, of a hair and of the head
MEASURED = 100  # passes of a render, to which the ratio in the last column belongs


class Cost(NamedTuple):
    """Processor times of all threads in s; rays: mean of camera rays of a pixel in a pass; noise: its mean square over
    the pixels after the passes that were measured, K2; embree: what of a pass Embree takes; peak: largest resident
    memory of the process, MB."""

    triangles: int
    rays: float
    read: float
    prepare: float
    one_pass: float
    embree: float
    noise: float
    peak: float

    def render(self, passes: int) -> float:
        """Of a render of so many passes."""
        return self.read + self.prepare + passes * self.one_pass

    @property
    def efficiency(self) -> float:
        """1 / (noise^2 x time) of passes alone."""
        return 1.0 / (self.noise * self.one_pass)


def curls(count):
    """Points (n, POINTS, 3) of hairs on the upper half of a head: they rise, and fall in a wave."""
    index = np.arange(count) + 0.5
    z = index / count  # even on the upper half of a sphere
    turn = np.pi * (1.0 + 5.0**0.5) * index
    out = np.column_stack((np.sqrt(1.0 - z**2) * np.cos(turn), np.sqrt(1.0 - z**2) * np.sin(turn), z))
    along = np.linspace(0.0, 1.0, POINTS)[:, None]
    fall = np.array([0.0, 0.0, -0.12]) * along**2
    wave = 0.004 * np.sin(9.0 * along + 20.0 * turn[:, None, None]) * np.cross(out, (0.0, 0.0, 1.0))[:, None]
    return HEAD * out[:, None] + 0.05 * along * out[:, None] + fall + along * wave


def build(hairs, width):
    """A head of 307 K in a room of 293 K, seen from 0.7 m; its hair of 300 K."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    view = camera((0.0, -0.7, 0.1), width, width * 3 // 4)
    view.rotation_euler = 1.45, 0.0, 0.0
    bpy.ops.mesh.primitive_uv_sphere_add(segments=128, ring_count=64, radius=HEAD)
    head = bpy.context.object
    head["temperature"] = 307.0
    head.data.materials.append(material("Skin", emissivity=0.98))
    bpy.ops.mesh.primitive_cube_add(size=4.0)
    bpy.context.object["temperature"] = 293.0
    bpy.context.object.data.materials.append(material("Walls", emissivity=0.9))
    if hairs:
        curves = bpy.data.hair_curves.new("Hair")
        curves.add_curves([POINTS] * hairs)
        points = curls(hairs).astype(np.float32)
        curves.attributes["position"].data.foreach_set("vector", points.ravel())
        radius = np.full(hairs * POINTS, RADIUS, np.float32)
        curves.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", radius)
        curves.materials.append(material("Hair", emissivity=0.95))
        link("Hair", curves, temperature=300.0)


def measure(hairs, options):
    build(hairs, options.width)
    reading, real = [], motion.read_scene

    def timed(*arguments):
        begin = time.process_time()
        found = real(*arguments)
        reading.append(time.process_time() - begin)
        return found

    with patch.object(motion, "read_scene", timed):
        ((scene, _),) = read_as_rendered().values()
    marks, traced, planned = [time.process_time()], [], []
    as_ever = pass_loop.prepare

    def prepare(*inputs):
        planned.append(as_ever(*inputs))
        marks.append(time.process_time())
        return planned[0]

    def note(_):
        marks.append(time.process_time())
        traced.append(total(calls).seconds)

    with patch.object(pass_loop, "prepare", prepare), counted_rays() as calls:
        film = render(scene, Settings(passes=options.passes, photons_per_pass=options.photons), note)
    embree = np.median(np.diff(traced))  # without the first, whose preparation traces rays, too
    spent, rays, noise = np.diff(marks), float(planned[0].samples.mean()), float(np.mean(film.noise() ** 2))
    triangles, peak = len(scene.triangles), resident("VmHWM") / 1e6
    return Cost(triangles, rays, reading[0], spent[0], np.median(spent[1:]), embree, noise, peak)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hairs", type=int, default=100_000)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--passes", type=int, default=5, help="that are measured, two at least")
    parser.add_argument("--photons", type=int, default=100_000)
    options = parser.parse_args()
    with registered():
        measure(10, argparse.Namespace(width=32, passes=2, photons=1000))  # loads the kernels
        bald, hairy = measure(0, options), measure(options.hairs, options)
        with patch.object(antialiasing, "_MEAN", bald.rays):
            as_few = measure(options.hairs, options)
    times = "read", "prepare", "pass", "Embree", "100 passes"
    columns = "hairs", "triangles", "camera rays", *(f"{what}, s" for what in times)
    print(f"| {' | '.join(columns)} | peak, MB |\n{'|--:' * (len(columns) + 1)}|")
    for hairs, cost in ((0, bald), (options.hairs, hairy), (options.hairs, as_few)):
        times = " | ".join(f"{seconds:.2f}" for seconds in (cost.read, cost.prepare, cost.one_pass, cost.embree))
        sizes = f"{hairs:,} | {cost.triangles:,} | {cost.rays:.1f}"
        print(f"| {sizes} | {times} | {cost.render(MEASURED):.0f} | {cost.peak:.0f} |")
    for name, cost in (("Hairy", hairy), ("As few camera rays", as_few)):
        ratio = cost.render(MEASURED) / bald.render(MEASURED)
        print(f"\n{name} over bald: {cost.one_pass / bald.one_pass:.2f} a pass, {ratio:.2f} for {MEASURED} passes.")
    print(f"\nMore camera rays: {hairy.efficiency / as_few.efficiency:.2f} times the efficiency.")


if __name__ == "__main__":
    main()
