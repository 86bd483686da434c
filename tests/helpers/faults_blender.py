# SPDX-License-Identifier: GPL-3.0-or-later
"""A render in Blender, and ways to end it early, to see what becomes of it when things go wrong."""

import time
from concurrent.futures import ThreadPoolExecutor

import bpy

from addon import solver
from addon.rendering import final_render
from tests.helpers.blender import camera, cube_mesh, link, material


def build_scene():
    """A grey floor under a hot plate and a lamp, under a sky: every kind of owner of a custom property."""
    camera(width=8, height=6)
    floor_mesh, plate_mesh = cube_mesh("Floor"), cube_mesh("Plate")
    floor_mesh.materials.append(material("Paint", emissivity=0.5))
    plate_mesh.materials.append(material("Metal", emissivity=0.3, specular=0.5, roughness=0.2))
    floor = link("Floor", floor_mesh, temperature=290.0)
    floor.scale, floor.location = (40.0, 40.0, 1.0), (0.0, 0.0, -0.5)
    plate = link("Plate", plate_mesh, temperature=600.0)
    plate.scale, plate.location = (1.0, 1.0, 0.1), (0.5, 0.0, 2.0)
    lamp = link("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    lamp.location, lamp.data.energy = (0.0, 1.0, 3.0), 100.0
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("Sky")
    scene.render.engine = "INFRARED_PHOTONS"
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 2, 1000, 3, 1
    return infrared


def render():
    bpy.ops.render.render()


def stop_after(monkeypatch, passes):
    """Let the next render end as with Esc after so many passes."""
    real = final_render.RenderJob._on_pass

    def on_pass(job, film):
        real(job, film)
        if film.passes >= passes:
            job.cancel()

    def watch(_engine, job, *_):
        while job.is_alive() and not job.cancelled:
            job.join(0.001)

    with monkeypatch.context() as patch:
        patch.setattr(final_render.RenderJob, "_on_pass", on_pass)
        patch.setattr(final_render, "_watch", watch)
        render()


def save_slowly(monkeypatch):
    """As a large film to a slow disk, by a solver that still has something to do before."""
    real = solver.checkpoint.save

    def save(*args):
        time.sleep(1.0)
        with ThreadPoolExecutor(1) as pool:
            pool.submit(real, *args).result()

    monkeypatch.setattr(solver.checkpoint, "save", save)
