# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the pictures of docs/panels.md, and README's of some of them. Needs Linux, ImageMagick and a Blender with a
window and the extension:

    blender docs/demo/demo.blend --python docs/shoot_panels.py

Of the Properties editor only this engine's panels stay, all open, for as long as this Blender runs.
"""

import subprocess
import sys
from pathlib import Path

import addon_utils
import bpy

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "real_blender"))
from hands import area_of  # noqa: E402
from story import tell  # noqa: E402

IMAGES = ROOT / "docs" / "images"
OURS = "INFRARED_PT_"
ORDER = {f"INFRARED_PT_{name}": place for place, name in enumerate(("photons", "spectrum", "defaults", "checks"))}
KEPT = {"DATA_PT_lens"}  # one of ours is inside
# Too long for one picture with the others: in pictures of their own, with what they are inside of.
APART = {
    "heat-display": ("INFRARED_PT_heat_display",),
    "detector": ("INFRARED_PT_sensor", "INFRARED_PT_detector"),
}
TOGETHER = (("render",), ("object", "world", "light"), ("material", "output"))  # columns of README's picture
MARGIN, EDGE = 6, 4  # pixels: around the panels in a picture; of an editor's own frame


def hide(panels):
    """Unregister panels, those inside others first."""
    for cls in sorted(panels, key=lambda cls: not hasattr(cls, "bl_parent_id")):
        bpy.utils.unregister_class(cls)


def show_open(panels):
    """Register panels, not closed at first, those that hold others first."""
    for cls in sorted(panels, key=lambda cls: hasattr(cls, "bl_parent_id")):
        cls.bl_options = set(getattr(cls, "bl_options", ())) - {"DEFAULT_CLOSED"}
        bpy.utils.register_class(cls)


def leave_only_our_panels():
    """In the Properties editor and in the Image Editor's sidebar, all open; returns them."""
    addon_utils.disable("cycles")  # it would miss its panels when Blender quits
    registered = [getattr(bpy.types, name) for name in dir(bpy.types)]
    panels = [cls for cls in registered if isinstance(cls, type) and issubclass(cls, bpy.types.Panel)]
    panels = [cls for cls in panels if getattr(cls, "bl_space_type", "") in ("PROPERTIES", "IMAGE_EDITOR")]
    panels = [cls for cls in panels if getattr(cls, "bl_region_type", "") in ("WINDOW", "UI")]
    hide(cls for cls in panels if cls.__name__ not in KEPT)
    ours = sorted((cls for cls in panels if cls.__name__.startswith(OURS)), key=lambda cls: ORDER.get(cls.__name__, 9))
    show_open(ours)
    return ours


def shoot(name, area, kind="WINDOW"):
    """Yield until Blender has drawn a region, and keep the part of it that is not empty."""
    area.tag_redraw()
    yield 1.0
    region = next(region for region in area.regions if region.type == kind)
    top = bpy.context.window.height - region.y - region.height
    part = f"{region.width - 2 * EDGE}x{region.height - 2 * EDGE}+{region.x + EDGE}+{top + EDGE}"
    screen = subprocess.run(["import", "-window", "root", "png:-"], check=True, capture_output=True).stdout
    steps = (
        "-crop",
        part,
        "+repage",
        "-fuzz",
        "2%",
        "-trim",
        "+repage",
        "-bordercolor",
        "#303030",
        "-border",
        str(MARGIN),
    )
    subprocess.run(
        ["convert", "png:-", *steps, "+dither", "-colors", "64", IMAGES / f"panel-{name}.png"], check=True, input=screen
    )


def put_together():
    """Make README's picture of those that were made."""
    files = [[IMAGES / f"panel-{name}.png" for name in column] for column in TOGETHER]
    columns = [part for column in files for part in ("(", *column, "-append", ")")]
    subprocess.run(["convert", "-background", "#303030", *columns, "+append", IMAGES / "panels.png"], check=True)


def work():
    """A generator that yields how many seconds to wait."""
    scene = bpy.context.scene
    scene.render.resolution_percentage, scene.infrared.passes, scene.infrared.photons_per_pass = 50, 4, 20_000
    with bpy.context.temp_override(area=area_of("OUTLINER")):
        bpy.ops.screen.area_close()
    yield 0.5
    scene.infrared.use_isotherm = True
    bpy.ops.render.render()
    properties, viewport = area_of("PROPERTIES"), area_of("VIEW_3D")
    ours = leave_only_our_panels()
    ring, heater, camera = (bpy.data.objects[name] for name in ("Ring", "Heater", "Camera"))
    camera.data.type = "PANO"
    apart = [cls for cls in ours if any(cls.__name__ in names for names in APART.values())]
    hide(apart)
    for name, tab, shown in (
        ("render", "RENDER", ring),
        ("output", "OUTPUT", ring),
        ("object", "OBJECT", ring),
        ("material", "MATERIAL", ring),
        ("world", "WORLD", ring),
        ("light", "DATA", heater),
        ("panorama", "DATA", camera),
    ):
        bpy.context.view_layer.objects.active = shown
        yield 0.5
        properties.spaces.active.context = tab
        yield from shoot(name, properties)
    others = [cls for cls in ours if getattr(cls, "bl_context", "") == "render" and cls not in apart]
    hide(others)
    scene.infrared.use_detector = True
    properties.spaces.active.context = "RENDER"
    for name, panels in APART.items():
        parents = {getattr(cls, "bl_parent_id", "") for cls in ours if cls.__name__ in panels}
        shown = [cls for cls in ours if cls.__name__ in parents.union(panels)]
        show_open(shown)
        yield from shoot(name, properties)
        hide(shown)
    for position in ((0.5, 0.5), (0.3, 0.6)):
        scene.infrared.spots.add().position = position
    viewport.type = "IMAGE_EDITOR"
    editor = viewport.spaces.active
    editor.image, editor.show_region_ui = bpy.data.images["Render Result"], True
    yield 1.0
    yield from shoot("sidebar", viewport, "UI")
    put_together()
    show_open(others + apart)  # the add-on looks for them when Blender quits


bpy.context.preferences.view.show_splash = False
tell(work())
