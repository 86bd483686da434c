# SPDX-License-Identifier: GPL-3.0-or-later
"""Make docs/demo/demo.blend: the scene of Boudet et al. 2004, section 5.2, at the size of a table top.

An emissive specular ring stands on a totally diffuse plane; a point light above its rim throws a caustic into it.

    python -m docs.tools.make_demo

Use bpy 4.5, so that every supported Blender can open the file.
"""

from __future__ import annotations

import bpy
import numpy as np

from docs.examples.modelling import add_camera, add_custom_property, add_sky, link, save, surface
from docs.tools.paths import DEMO

RADIUS, THICKNESS, HEIGHT = 0.1, 0.006, 0.05  # m, of the ring: inner radius, wall, height above the plane
SUNK = 0.001  # m of the ring below the plane, so that no faces coincide
SEGMENTS = 512  # faces have flat normals; with fewer, the caustic shows the facets
PLANE_SIZE = 1.2  # m

LIGHT_DISTANCE, LIGHT_AZIMUTH, LIGHT_HEIGHT = 0.1, np.radians(245.0), 0.13  # over the rim, from the centre; m, rad, m
CAMERA_FROM, CAMERA_TO = (0.0, -0.36, 0.46), (0.0, -0.01, 0.01)  # m; it looks down into the ring at an angle


def build() -> None:
    """Fill an empty scene; the add-on has to be registered."""
    add_ring()
    add_plane()
    add_light()
    add_camera(CAMERA_FROM, CAMERA_TO, lens=58.0).data.clip_start = 0.01  # m
    add_sky("Clear sky", 250.0)
    choose_settings(bpy.context.scene)


def add_ring() -> None:
    """A tube of rectangular section around the z axis, warm and shiny."""
    angle = 2.0 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    low, high, inner, outer = -SUNK, HEIGHT, RADIUS, RADIUS + THICKNESS
    section = [(inner, low), (outer, low), (outer, high), (inner, high)]  # radius and height, counter-clockwise
    vertices = [np.stack((r * np.cos(angle), r * np.sin(angle), np.full(SEGMENTS, z)), axis=1) for r, z in section]
    here = np.arange(SEGMENTS)
    there = (here + 1) % SEGMENTS
    faces = []
    for corner in range(4):
        a, b = corner * SEGMENTS, (corner + 1) % 4 * SEGMENTS
        faces.append(np.stack((a + here, a + there, b + there, b + here), axis=1))
    points = [7.5, 0.24, 9.0, 0.20, 11.0, 0.17, 13.5, 0.15]  # um, emissivity, ...
    metal = surface("Oxidised metal", points, specular=1.0, colour=(0.80, 0.55, 0.35))
    add_mesh("Ring", np.concatenate(vertices), np.concatenate(faces), metal, temperature=340.0)


def add_plane() -> None:
    """The table: totally diffuse, at room temperature."""
    half = 0.5 * PLANE_SIZE
    vertices = np.array([(-half, -half, 0.0), (half, -half, 0.0), (half, half, 0.0), (-half, half, 0.0)])
    slate = surface("Slate", 0.7, colour=(0.25, 0.27, 0.30))
    add_mesh("Plane", vertices, np.array([(0, 1, 2, 3)]), slate, temperature=293.0)


def add_mesh(name: str, vertices: np.ndarray, faces: np.ndarray, material, temperature: float) -> None:
    """An object with one material and one temperature (K)."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    mesh.materials.append(material)
    add_custom_property(link(name, mesh), "temperature", temperature)


def add_light() -> None:
    """A small heating element: 400 W at 1000 K, an eighth of which falls into the bands."""
    light = bpy.data.lights.new("Heater", "POINT")
    light.energy = 400.0  # W over all wavelengths
    light.shadow_soft_size = 0.0
    heater = link("Heater", light)
    heater.location = (
        LIGHT_DISTANCE * np.cos(LIGHT_AZIMUTH),
        LIGHT_DISTANCE * np.sin(LIGHT_AZIMUTH),
        LIGHT_HEIGHT,
    )
    add_custom_property(heater, "temperature", 1000.0)


def choose_settings(scene) -> None:
    """The engine, its settings and the picture's size: about a minute on two cores."""
    scene.render.engine = "INFRARED_PHOTONS"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 480, 100
    scene.render.filepath = "//render/demo"
    scene.view_settings.view_transform = "Standard"  # shows the thermal palette as it is
    infrared = scene.infrared
    infrared.passes = 20
    infrared.photons_per_pass = 200_000
    infrared.band_mode = "UNIFORM"
    infrared.wavelength_min, infrared.wavelength_max, infrared.band_count = 7.5, 13.5, 15


if __name__ == "__main__":
    save(build, DEMO)
