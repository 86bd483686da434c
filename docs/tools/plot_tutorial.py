# SPDX-License-Identifier: GPL-3.0-or-later
"""Do what step 10 of the tutorial says in a new file, and render its picture. Needs Blender as a Python module.

    python -m docs.tools.plot_tutorial

makes images/tutorial-surfaces.png.
"""

from __future__ import annotations

import bpy
import numpy as np

from addon.properties import add_custom_property
from docs.tools.blender import registered
from docs.tools.paths import IMAGES, TEMPLATE


def follow_steps() -> None:
    """What step 10 does, in the open file, which is a new one."""
    bpy.ops.infrared.clear_sky(air=293.15, humidity=50.0, replace=True)
    become_water(bpy.data.objects["Floor"])
    add_grid_plane()
    wear_paint(bpy.data.materials["Paint"])
    add_film()
    infrared = bpy.context.scene.infrared
    infrared.range_mode, infrared.range_low, infrared.range_high = "FIXED", 273.15, 323.15


def become_water(floor) -> None:
    """A calm pond: Fresnel's law with the n and k of water."""
    material = floor.active_material
    material["emissivity"] = "Water"
    for key, value in (("specular", 1.0), ("roughness", 0.0), ("fresnel", True)):
        add_custom_property(material, key, value)


def add_plane(name: str, location: tuple[float, float, float]):
    """A standing plane of 2 m that looks to the camera, with a material of its own. location: m."""
    bpy.ops.mesh.primitive_plane_add(location=location, rotation=(np.pi / 2, 0.0, np.pi / 4))
    plane = bpy.context.object
    plane.name = name
    plane.data.materials.append(bpy.data.materials.new(name))
    return plane


def add_grid_plane() -> None:
    """A plane whose temperatures are an image, of 20 °C to 60 °C."""
    plane = add_plane("Plane", (-4.4, 0.0, 1.0))
    add_custom_property(plane.active_material, "emissivity", 0.95)
    image = bpy.data.images.new("Grid", 512, 512, is_data=True)
    image.generated_type = "UV_GRID"
    bpy.ops.infrared.temperature_image(image=image.name, use_range=True, low=293.15, high=333.15)


def wear_paint(paint) -> None:
    """Half of the cube's paint is worn off: bare metal is mixed in."""
    with bpy.context.temp_override(material=paint):
        bpy.ops.infrared.material_mix(material="Polished metal", source="NUMBER", share=0.5)


def add_film() -> None:
    """A plastic film before the cube."""
    film = add_plane("Film", (1.2, -1.5, 1.2))
    add_custom_property(film, "temperature", 293.15)
    add_custom_property(film.active_material, "emissivity", 0.12)
    add_custom_property(film.active_material, "transmittance", 0.78)


def main() -> None:
    with registered():
        bpy.ops.wm.open_mainfile(filepath=str(TEMPLATE), load_ui=False)
        follow_steps()
        scene = bpy.context.scene
        scene.infrared.passes, scene.infrared.target_noise, scene.infrared.time_limit = 16, 0.0, 0.0
        bpy.ops.render.render()
        bpy.ops.infrared.export_picture(filepath=str(IMAGES / "tutorial-surfaces.png"))


if __name__ == "__main__":
    main()
