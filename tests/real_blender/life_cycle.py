# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender: install, render, switch engines, disable, enable, upgrade and remove the extension.

Arguments: the extension's zip and one of a higher version. Prints facts, a line of JSON for each.
"""

import os
import sys
import threading
from pathlib import Path

import addon_utils
import bpy

from tests.real_blender.facts import fact

ARCHIVE, NEWER = sys.argv[1:]
MODULE = "bl_ext.user_default.infrared_photons"
ENGINE = "INFRARED_PHOTONS"
FOLDER = Path(bpy.utils.user_resource("EXTENSIONS"))
USER = Path(bpy.utils.resource_path("USER"))
PROPERTIES = ("passes", "seed", "band_count")


def traces() -> dict[str, list[str]]:
    """All that an add-on may leave in Blender and in its folder, by kind."""
    types = [getattr(bpy.types, name) for name in dir(bpy.types)]
    structs = [cls for cls in types if isinstance(getattr(cls, "bl_rna", None), bpy.types.Struct)]
    layouts = [cls for cls in types if hasattr(getattr(cls, "draw", None), "_draw_funcs")]
    handlers = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    keymaps = bpy.context.window_manager.keyconfigs.addon.keymaps
    return {
        "types": dir(bpy.types),
        "operators": [f"{group}.{name}" for group in dir(bpy.ops) for name in dir(getattr(bpy.ops, group))],
        "properties": [f"{cls.__name__}.{each.identifier}" for cls in structs for each in cls.bl_rna.properties],
        "panels of the engine": [cls.__name__ for cls in types if ENGINE in getattr(cls, "COMPAT_ENGINES", ())],
        # a menu's own is kept beside the first that an add-on appends, and stays there: it was drawn before, too
        "draw functions": [
            f"{cls.__name__} {f.__module__}"
            for cls in layouts
            for f in cls.draw._draw_funcs
            if f.__module__ != cls.__module__
        ],
        "handlers": [f"{name} {f}" for name, found in handlers.items() if isinstance(found, list) for f in found],
        "keys": [f"{keymap.name} {item.idname}" for keymap in keymaps for item in keymap.keymap_items],
        "threads": [thread.name for thread in threading.enumerate()],
        "environment": list(os.environ),
        "files": [str(path) for path in USER.rglob("*infrared_photons*")],
        "libraries": [path.name for path in FOLDER.glob(".local/**/site-packages/*")],
    }


def left_behind(before: dict[str, list[str]]) -> dict[str, list[str]]:
    """What is there now and was not before, by kind."""
    found = {kind: sorted(set(items) - set(before[kind])) for kind, items in traces().items()}
    return {kind: items for kind, items in found.items() if items}


def install(archive: str) -> None:
    """What dragging the zip into the window runs, too."""
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)


def version() -> list[int]:
    """Of the extension that is installed."""
    modules = addon_utils.modules()
    return list(next(addon_utils.module_bl_info(m)["version"] for m in modules if m.__name__ == MODULE))


def render() -> list[float]:
    """The picture's values."""
    scene = bpy.context.scene
    scene.render.engine = ENGINE
    bpy.ops.render.render()
    layer = sys.modules[f"{MODULE}.rendering.final_render"].finished_layers["ViewLayer"]
    return layer["radiance"].ravel().tolist()


def content() -> dict:
    """What an artist set."""
    infrared = bpy.context.scene.infrared
    return {
        "temperatures": {obj.name: obj.get("temperature") for obj in bpy.data.objects},
        "emissivities": {m.name: m["emissivity"] for m in bpy.data.materials if "emissivity" in m},
        "settings": [getattr(infrared, name) for name in PROPERTIES],
        "sky": bpy.context.scene.world["temperature"],
    }


def my_materials() -> list[str]:
    """Names of the artist's own materials."""
    return list(sys.modules[f"{MODULE}.solver.physics.library"].user_materials())


def make_scene() -> None:
    scene, cube = bpy.context.scene, bpy.data.objects["Cube"]
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 16, 12, 100
    cube["temperature"], cube.active_material["emissivity"] = 330.0, "Granite"
    scene.world["temperature"] = 250.0
    infrared = scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.seed, infrared.band_count = 2, 1000, 7, 3


before = traces()
install(ARCHIVE)
fact("version", version())
fact("seen when installed", left_behind(before).keys() >= {"types", "operators", "properties", "files", "libraries"})
make_scene()
image, set_by_artist = render(), content()
fact("range", [min(image), max(image)])

for engine in ("CYCLES", "BLENDER_EEVEE"):
    bpy.context.scene.render.engine = engine
    if engine == "CYCLES":
        bpy.context.scene.cycles.samples, bpy.context.scene.cycles.use_denoising = 1, False
        bpy.ops.render.render()
    fact(f"same after {engine}", content() == set_by_artist and render() == image)

# as an earlier version kept them, in a folder that Blender deletes with the extension
earlier = Path(bpy.utils.extension_path_user(MODULE, path="library", create=True)) / "my_materials.csv"
earlier.write_text("material,wavelength_um,emissivity,source\nOak,8.0,0.9,me\n")
fact("my materials of an earlier version at once", my_materials())
addon_utils.disable(MODULE, default_set=True)
addon_utils.enable(MODULE, default_set=True)
fact("my materials of an earlier version", my_materials())
bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
bpy.ops.infrared.library_save(name="Beech", source="me")
fact("my materials", my_materials())

addon_utils.disable(MODULE, default_set=True)
fact("left when disabled", left_behind(before))
addon_utils.enable(MODULE, default_set=True)
fact("same after enabling", content() == set_by_artist and render() == image)

install(NEWER)
fact("newer version", version())
fact("my materials after the upgrade", my_materials())
fact("same after the upgrade", content() == set_by_artist and render() == image)

repository = [repo.module for repo in bpy.context.preferences.extensions.repos].index("user_default")
bpy.ops.extensions.package_uninstall(repo_index=repository, pkg_id="infrared_photons")
left = left_behind(before)
fact("files when removed", [Path(path).relative_to(USER).as_posix() for path in left.pop("files", [])])
fact("left when removed", left)
fact("earlier file when removed", earlier.exists())
fact("temperature of an object", bpy.data.objects["Cube"]["temperature"])
install(ARCHIVE)
fact("my materials when installed again", my_materials())
fact("end", True)
