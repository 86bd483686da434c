# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the pictures of docs/panels.md, and README's of some of them. Needs Linux, ImageMagick and a Blender with a
window and the extension:

    blender docs/demo/demo.blend --python tests/real_blender/launch.py -- docs.tools.shoot_panels

Of the Properties editor only this engine's panels stay, in their order and all open but those that have a picture of
their own, for as long as this Blender runs.
"""

import subprocess

import addon_utils
import bpy

from docs.tools.paths import IMAGES
from docs.tools.screenshots import cropping, keep, screenshot
from tests.real_blender.hands import area_of, region_of
from tests.real_blender.story import tell

OURS = "INFRARED_PT_"
KEPT = {"DATA_PT_lens"}  # one of ours is inside
HOLDING = {"OBJECT_PT_visibility"}  # likewise, and closed unless it is opened like ours
# Too long for one picture with the others, where they are closed: in pictures of their own, with what holds them.
APART = {
    "motion": ("INFRARED_PT_motion_blur", "INFRARED_PT_film"),
    "heat-display": ("INFRARED_PT_heat_display",),
    "detector": ("INFRARED_PT_sensor", "INFRARED_PT_detector"),
    "object-parameters": ("INFRARED_PT_object_parameters",),
}
# Closed in the sidebar, which would be longer than the window: the same panel is in the picture of the Render tab
CLOSED = {"INFRARED_PT_image_object_parameters"}
TOGETHER = (("render",), ("object", "world", "light"), ("material", "output"))  # columns of README's picture
MARGIN = 6  # pixels around the panels in a picture
WIDTH = 380  # pixels of the editors that are shot: enough for the longest name


def hide(panels):
    """Unregister panels, those inside others first."""
    for cls in sorted(panels, key=lambda cls: not hasattr(cls, "bl_parent_id")):
        bpy.utils.unregister_class(cls)


def show(panels, closed=()):
    """Register panels, those that hold others first. In an editor that is new to them all are open but `closed`."""
    for cls in sorted(panels, key=lambda cls: hasattr(cls, "bl_parent_id")):
        options = set(getattr(cls, "bl_options", ())) - {"DEFAULT_CLOSED"}
        cls.bl_options = options | ({"DEFAULT_CLOSED"} if cls in closed else set())
        bpy.utils.register_class(cls)


def leave_only_our_panels():
    """In the Properties editor and in the Image Editor's sidebar; returns them, in their order, and those apart."""
    addon_utils.disable("cycles")  # it would miss its panels when Blender quits
    registered = [getattr(bpy.types, name) for name in dir(bpy.types)]
    panels = [cls for cls in registered if isinstance(cls, type) and issubclass(cls, bpy.types.Panel)]
    panels = [cls for cls in panels if getattr(cls, "bl_space_type", "") in ("PROPERTIES", "IMAGE_EDITOR")]
    panels = [cls for cls in panels if getattr(cls, "bl_region_type", "") in ("WINDOW", "UI")]
    hide(cls for cls in panels if cls.__name__ not in KEPT)
    defined = bpy.types.Panel.__subclasses__()  # in the order in which the add-on registers them
    ours = [cls for cls in panels if cls.__name__.startswith(OURS) or cls.__name__ in HOLDING]
    ours.sort(key=defined.index)
    apart = [cls for cls in ours if any(cls.__name__ in names for names in APART.values())]
    show(ours, closed=[*apart, *(cls for cls in ours if cls.__name__ in CLOSED)])
    return ours, apart


def shoot(name, area, kind="WINDOW"):
    """Yield until Blender has drawn a region, and keep the part of it that is not empty."""
    area.tag_redraw()
    yield 1.0
    region = region_of(area, kind)
    frame = ("-bordercolor", "#303030", "-border", str(MARGIN))
    few = ("+dither", "-colors", "64")
    keep(screenshot(), f"panel-{name}", *cropping(region), "-fuzz", "2%", "-trim", "+repage", *frame, *few)


def split_off(area):
    """Cut a new Properties editor from the right of an area; a generator that returns it and what is left."""
    before = set(bpy.context.screen.areas) - {area}
    with bpy.context.temp_override(area=area):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=1.0 - WIDTH / area.width)
    yield 0.5  # until they know where they are
    rest, right = sorted(set(bpy.context.screen.areas) - before, key=lambda area: area.x)
    right.type = "PROPERTIES"
    yield 0.5
    return right, rest


def put_together():
    """Make README's picture of those that were made."""
    files = [[IMAGES / f"panel-{name}.png" for name in column] for column in TOGETHER]
    columns = [part for column in files for part in ("(", *column, "-append", ")")]
    subprocess.run(["convert", "-background", "#303030", *columns, "+append", IMAGES / "panels.png"], check=True)


def work():
    """A generator that yields how many seconds to wait."""
    scene = bpy.context.scene
    infrared, picture = scene.infrared, scene.render
    as_saved = infrared.passes, infrared.photons_per_pass
    picture.resolution_percentage, infrared.passes, infrared.photons_per_pass = 50, 4, 20_000
    infrared.use_isotherm = True
    bpy.context.preferences.system.use_region_overlap = False  # nothing shines through the sidebar
    bpy.context.window.cursor_warp(2, 2)  # where it is over nothing that tells what it is
    bpy.ops.render.render()
    infrared.passes, infrared.photons_per_pass = as_saved
    for kind in ("OUTLINER", "PROPERTIES", "DOPESHEET_EDITOR"):
        with bpy.context.temp_override(area=area_of(kind)):
            bpy.ops.screen.area_close()
        yield 0.5
    ours, apart = leave_only_our_panels()
    properties, viewport = yield from split_off(area_of("VIEW_3D"))
    ring, heater, camera = (bpy.data.objects[name] for name in ("Ring", "Heater", "Camera"))
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
        camera.data.type = "PANO" if name == "panorama" else "PERSP"  # Checks has something to say about it
        yield 0.5
        properties.spaces.active.context = tab
        yield from shoot(name, properties)
    others = [cls for cls in ours if getattr(cls, "bl_context", "") == "render"]
    hide(others)
    properties, viewport = yield from split_off(viewport)  # in the other one the panels stay closed
    infrared.use_detector = True
    infrared.air_transmission_source, infrared.object_distance = "FORMULA", 10.0
    properties.spaces.active.context = "RENDER"
    for name, panels in APART.items():
        parents = {getattr(cls, "bl_parent_id", "") for cls in ours if cls.__name__ in panels}
        shown = [cls for cls in ours if cls.__name__ in parents.union(panels)]
        show(shown)
        yield from shoot(name, properties)
        hide(shown)
    infrared.use_isotherm = False
    for kind, places in (("SPOT", [(0.5, 0.5)]), ("BOX", [(0.2, 0.3), (0.4, 0.6)])):
        points = [{"name": "", "position": place} for place in places]
        bpy.ops.infrared.tool_add(kind=kind, points=points)
    viewport.type = "IMAGE_EDITOR"
    editor = viewport.spaces.active
    editor.image, editor.show_region_ui = bpy.data.images["Render Result"], True
    yield 1.0
    yield from shoot("sidebar", viewport, "UI")
    put_together()
    show(others)  # the add-on looks for them when Blender quits


if __name__ == "__main__":
    bpy.context.preferences.view.show_splash = False
    tell(work())
