# SPDX-License-Identifier: GPL-3.0-or-later
"""Run inside Blender with a window and `--enable-event-simulate`: do spot meter and bar tell what the screen shows?

A wall of black tiles, one for each pixel of a render, whose temperatures are known. Prints facts. A folder for
screenshots may be given.
"""

import sys

import bpy
import numpy as np
from bpy_extras.view3d_utils import region_2d_to_location_3d

from tests.helpers.tiles import kelvin
from tests.real_blender import hands
from tests.real_blender.facts import fact
from tests.real_blender.screen import capture
from tests.real_blender.story import tell
from tests.real_blender.tiles import make_scene

SCREENSHOTS = sys.argv[1:]
PATIENCE = 300.0  # s: kernels may have to be compiled
PLACES = 3000  # pixels of the screen that are looked at for each zoom
BORDER = 10  # pixels of the screen at an editor's frame, where tabs open its hidden toolbar and sidebar
TOLD = 60  # at its top, where stands how the render ended
SHADES = 6  # of 255: 4 as 8 bits hold the dark ones by another curve, 2 for a neighbour in the table of the palette


def modules():
    from bl_ext.user_default.infrared_photons.heat_settings import read_scale
    from bl_ext.user_default.infrared_photons.output import palette
    from bl_ext.user_default.infrared_photons.ui.temperatures import heat_display, spot_meter

    return heat_display, spot_meter, palette, read_scale


def shown(region, name):
    """(h, w, 3) int of a region of the window, which is in the screen's upper left corner; row 0 at the bottom."""
    window = bpy.context.window
    options = "-crop", f"{window.width}x{window.height}+0+0", "-depth", "8"
    if SCREENSHOTS:
        capture(f"{SCREENSHOTS[0]}/{name}.png", *options)
    raw = capture("rgb:-", *options)
    pixels = np.frombuffer(raw, np.uint8).reshape(window.height, window.width, 3)[::-1].astype(int)
    return pixels[region.y : region.y + region.height, region.x : region.x + region.width]


def differ(seen, expected) -> bool:
    return bool(np.abs(seen - expected).max() > SHADES)


def in_viewport():
    """The live picture, its bar and the reading under the cursor."""
    heat_display, spot_meter, palette, _ = modules()
    area = hands.area_of("VIEW_3D")
    space, region = area.spaces.active, hands.region_of(area)
    space.show_gizmo, overlay = False, space.overlay
    overlay.show_text = overlay.show_extras = overlay.show_floor = overlay.show_cursor = overlay.show_axis_x = False
    overlay.show_axis_y = False
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"
    while (picture := heat_display.picture_in(region)) is None or picture.noise is picture.temperature:
        yield 0.1  # the noise is known after the second pass
    with bpy.context.temp_override(area=area, region=region):
        bpy.ops.infrared.spot_meter("INVOKE_DEFAULT")
    middle = region.x + region.width // 2, region.y + region.height // 2
    yield from hands.move(*middle)
    yield 0.5
    screen, cursor = shown(region, "viewport"), spot_meter.Cursor
    place = region_2d_to_location_3d(region, space.region_3d, (cursor.x + 0.5, cursor.y + 0.5), (0, 0, 0))
    picture = heat_display.picture_in(region)
    fact("cursor", [cursor.x + region.x, cursor.y + region.y] == list(middle))
    scene = bpy.context.scene
    unit = heat_display.scene_unit(scene)
    fact("reading", spot_meter.live_reading(picture, scene.infrared, cursor.x, cursor.y, unit))
    fact("truth", kelvin[int(place.y), int(place.x)])
    with bpy.context.temp_override(area=area, region=region):
        bar = heat_display.bar_of(bpy.context, area, region)
    left, bottom, across, up = bar.bar
    expected = palette.display(bar.colours()).astype(int)
    apart = {shift: screen[bottom + shift :, left + across // 2][:up] - expected for shift in range(-3, 4)}
    fact("bar", [up, min(apart, key=lambda shift: np.abs(apart[shift]).sum())])
    yield from hands.press("ESC")
    fact("meter ended", cursor.meter is None)


def in_image_editor():
    """Every pixel of the picture at several zooms and offsets: how many are read, and how many of another colour."""
    _, spot_meter, palette, read_scale = modules()
    bpy.ops.render.render()
    area = hands.area_of("VIEW_3D")
    area.type = "IMAGE_EDITOR"
    space, region = area.spaces.active, hands.region_of(area)
    space.image, space.show_region_ui, space.show_gizmo = bpy.data.images["Render Result"], False, False
    bpy.context.scene.infrared.show_colour_bar = False
    frame = spot_meter.finished_frames["ViewLayer"]
    temperature = spot_meter.finished_layers["ViewLayer"]["temperature"]
    colours = palette.display(read_scale(bpy.context.scene.infrared).colours(temperature)).astype(int)

    def pixel_at(x, y):
        return spot_meter.pixel_at(*region.view2d.region_to_view(x, y), frame.size, frame.origin, colours.shape[:2])

    for zoom in (0.7, 1.0, 1.3, 3.7, 13.3):
        for pan in ((0.0, 0.0), (3.3, -7.7)):
            with bpy.context.temp_override(area=area, region=region):
                bpy.ops.image.view_all()
                bpy.ops.image.view_zoom_ratio(ratio=zoom)
                bpy.ops.image.view_pan(offset=pan)
            area.tag_redraw()
            yield 0.5
            screen, read, other = shown(region, f"zoom {zoom} {pan[0]}"), 0, 0
            corners = np.array([region.view2d.view_to_region(share, share, clip=False) for share in (0.0, 1.0)])
            low, high = np.clip(corners, BORDER, (region.width - BORDER - 1, region.height - TOLD - 1))
            for x, y in np.random.default_rng(3).integers(low, high + 1, (PLACES, 2)).tolist():
                pixel = pixel_at(x, y)
                # Blender draws an outline over the last column and row of the screen, or over those before them
                outline = pixel_at(x + 2, y) is None or pixel_at(x, y + 2) is None
                if pixel is not None and not outline:
                    read += 1
                    other += differ(screen[y, x], colours[pixel])
            fact(f"zoom {zoom} pan {pan}", [read, other])


def work():
    """A generator that yields how many seconds to wait."""
    make_scene()
    yield 0.2
    yield from in_viewport()
    yield from in_image_editor()
    fact("end", True)


bpy.context.preferences.view.show_splash = False
tell(work())
