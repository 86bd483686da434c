# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the pictures of Blender's window in README, docs/tutorial.md, docs/viewport.md, docs/materials.md, docs/gas.md,
docs/palettes.md and docs/measuring.md. Needs what shoot_panels.py needs, and xdotool:

    blender --python tests/real_blender/launch.py -- docs.tools.shoot_windows NAME ...

NAME: first, checks, tutorial, viewport, gases, shaders, measuring, live; without one, all of them. Begin with Blender's
own start-up file.
"""

import math
import sys

import bpy

from docs.tools.ordinary_scene import build
from docs.tools.paths import DEMO, EXAMPLES, TEMPLATE
from docs.tools.screenshots import cropping, keep, screenshot
from tests.real_blender.hands import area_of, move_real_mouse, press_real_esc, region_of
from tests.real_blender.story import tell

WHOLE = ("-resize", "75%", "+dither", "-colors", "128")
PART = ("+dither", "-colors", "64")
DIALOG = ("-crop", "724x416+155+401", "+repage")  # where the library of gases opens
LIST = ("-crop", "1096x478+12+402", "+repage")  # where the list of proposals opens
WIDTH = 340  # pixels of the Properties editor: enough for the longest name
ZOOM = 2.0  # pixels of the screen on each side of one of a picture's
FOLDED = 300  # pixels by which the sidebar is scrolled down, to the measuring tools
METER = 860, 430  # pixels of the screen, from its upper left corner, where the spot meter reads: the trunk
PLACES = {  # of tools in the picture of the people: forehead, trunk, radiator, lampshade, laptop
    "SPOT": [(0.672, 0.688)],
    "LINE": [(0.6, 0.46), (0.75, 0.46)],
    "BOX": [(0.342, 0.385), (0.468, 0.483)],
    "ELLIPSE": [(0.878, 0.637), (0.965, 0.72)],
    "POLYGON": [(0.372, 0.42), (0.466, 0.42), (0.467, 0.352), (0.377, 0.354)],
}
DRAWN = 1.5  # s in which Blender has drawn everything

stats = []  # what Blender told of the render that runs, line by line


def start_up():
    """Blender's own start-up file."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    yield DRAWN
    bpy.context.scene.render.engine = "INFRARED_PHOTONS"
    yield from widen()


def widen():
    """Make the Properties editor WIDTH wide."""
    properties = area_of("PROPERTIES")
    delta = properties.width - WIDTH
    bpy.ops.screen.area_move(x=properties.x - 1, y=properties.y + properties.height // 2, delta=delta)
    yield 0.5


def tab(context, down=0):
    """Show a tab of the Properties editor, scrolled to its top and then down by so many pixels."""
    area = area_of("PROPERTIES")
    area.spaces.active.context = context
    yield 0.5
    for distance in (5000, -down):
        with bpy.context.temp_override(area=area, region=region_of(area)):
            bpy.ops.view2d.pan(deltay=distance)
        area.tag_redraw()
        yield DRAWN


def first():
    """README's first picture, after its steps, while it renders."""
    yield from start_up()
    scene = bpy.context.scene
    bpy.ops.infrared.true_colours()
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    bpy.ops.mesh.primitive_monkey_add(size=3.0, rotation=(0.0, 0.0, math.radians(45.0)))
    monkey = bpy.context.object
    bpy.ops.object.subdivision_set(level=2)
    bpy.ops.object.shade_smooth()
    bpy.ops.mesh.primitive_plane_add(size=100.0, location=(0.0, 0.0, -1.5))
    plane = bpy.context.object
    monkey["temperature"], plane["temperature"], scene.world["temperature"] = 330.0, 290.0, 250.0
    steel, dull = bpy.data.materials.new("Material.001"), bpy.data.materials.new("Material.002")
    steel["emissivity"], steel["fresnel"] = "Steel, galvanised, heavily oxidised", True
    dull["emissivity"] = 0.6
    for made, specular, roughness, thing in ((steel, 1.0, 0.3, monkey), (dull, 0.5, 0.2, plane)):
        made["specular"], made["roughness"] = specular, roughness
        thing.data.materials.append(made)
    scene.render.resolution_percentage = 25
    bpy.context.preferences.view.render_display_type = "AREA"
    yield from tab("RENDER")
    bpy.app.handlers.render_stats.append(lambda text: stats.append(text))
    bpy.ops.render.render("INVOKE_DEFAULT")
    while not any("Pass 3" in str(line) for line in stats[-3:]):
        yield 0.1
    editor = area_of("IMAGE_EDITOR")
    with bpy.context.temp_override(area=editor, region=region_of(editor)):
        bpy.ops.image.view_all(fit_view=True)
    yield DRAWN
    keep(screenshot(), "first", *WHOLE)
    press_real_esc()
    while bpy.app.is_job_running("RENDER"):
        yield 0.5


def checks():
    """The panel Checks with something of each kind."""
    yield from start_up()
    infrared = bpy.context.scene.infrared
    infrared.wavelength_min = 3.0
    bpy.data.objects["Light"]["temperature"] = -4.0
    bpy.data.objects["Cube"].data.materials[0]["emissivity"] = "Granite"
    yield from tab("RENDER", down=300)
    keep(screenshot(), "checks", *cropping(region_of(area_of("PROPERTIES")), edge=0), *PART)


def tutorial():
    """The template's window with the cube, and two tabs."""
    bpy.ops.wm.open_mainfile(filepath=str(TEMPLATE))
    yield DRAWN
    yield from widen()
    cube = bpy.data.objects["Cube"]
    for thing in bpy.context.scene.objects:
        thing.select_set(thing == cube)
    bpy.context.view_layer.objects.active = cube
    area_of("VIEW_3D").spaces.active.region_3d.view_perspective = "CAMERA"
    yield DRAWN  # the editor has the object's tabs once it was drawn
    yield from tab("OBJECT", down=2000)
    keep(screenshot(), "tutorial-object", *WHOLE)
    for name, context in (("material", "MATERIAL"), ("settings", "RENDER")):
        yield from tab(context)
        keep(screenshot(), f"tutorial-{name}", *cropping(area_of("PROPERTIES"), edge=0), *PART)


def viewport():
    """The demo in a viewport in Rendered mode."""
    yield from start_up()
    bpy.ops.wm.open_mainfile(filepath=str(DEMO), load_ui=False)
    yield DRAWN
    space = area_of("VIEW_3D").spaces.active
    space.region_3d.view_perspective, space.shading.type = "CAMERA", "RENDERED"
    yield 150.0  # for a full pass, where others compute, too
    keep(screenshot(), "viewport", *WHOLE)
    space.shading.type = "SOLID"
    yield DRAWN


def gases():
    """The library of gases over the bands of a camera at 3 to 5 um."""
    yield from start_up()
    infrared, paint = bpy.context.scene.infrared, bpy.data.objects["Cube"].active_material
    infrared.wavelength_min, infrared.wavelength_max, infrared.band_count = 3.0, 5.0, 8
    paint["gas"] = "Exhaust, petrol"
    yield from tab("MATERIAL")
    window, area = bpy.context.window, area_of("PROPERTIES")
    window.cursor_warp(window.width // 2, window.height // 2)
    yield DRAWN
    with bpy.context.temp_override(area=area, region=region_of(area), material=paint):
        bpy.ops.infrared.gas_library("INVOKE_DEFAULT", owner="MATERIAL", kelvin="600")
    yield DRAWN
    window.cursor_warp(2, 2)  # where it is over nothing; the dialog stays until it is pressed
    keep(screenshot(), "gas-library", *DIALOG, *PART)


def shaders():
    """The list of what is proposed for a scene that was made for visible light."""
    yield from start_up()
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    build()
    bpy.context.scene.unit_settings.temperature_unit = "CELSIUS"
    yield from tab("RENDER")
    window, area = bpy.context.window, area_of("PROPERTIES")
    window.cursor_warp(window.width // 2, window.height // 2)
    yield DRAWN
    with bpy.context.temp_override(area=area, region=region_of(area)):
        bpy.ops.infrared.thermal_from_shaders("INVOKE_DEFAULT")
    yield DRAWN
    window.cursor_warp(2, 2)
    keep(screenshot(), "shaders-list", *LIST, *PART)


def settle(area):
    """Wait until the panels of an area have their new heights, which they take step by step."""
    for _ in range(3):
        area.tag_redraw()
        yield DRAWN


def only_picture():
    """The people of the examples, rendered quickly, in an Image Editor that fills the window; the cursor is away."""
    yield from start_up()
    bpy.ops.wm.open_mainfile(filepath=str(EXAMPLES / "people.blend"), load_ui=False)
    yield DRAWN
    scene = bpy.context.scene
    scene.infrared.passes, scene.infrared.photons_per_pass, scene.infrared.time_limit = 4, 50_000, 0.0
    scene.render.resolution_percentage = 75
    bpy.ops.render.render()
    for kind in ("OUTLINER", "PROPERTIES", "DOPESHEET_EDITOR"):
        with bpy.context.temp_override(area=area_of(kind)):
            bpy.ops.screen.area_close()
        yield 0.5
    bpy.context.preferences.system.use_region_overlap = False  # nothing shines through the sidebar
    area = area_of("VIEW_3D")
    area.type = "IMAGE_EDITOR"
    space = area.spaces.active
    space.image, space.show_region_ui, space.show_region_toolbar = bpy.data.images["Render Result"], True, True
    yield DRAWN
    region_of(area, "UI").active_panel_category = "Infrared"
    with bpy.context.temp_override(area=area, region=region_of(area)):
        bpy.ops.image.view_all()
        bpy.ops.image.view_zoom_ratio(ratio=ZOOM)
    yield DRAWN
    return area


def place_tools(infrared):
    """One of each kind in the picture of the people, as a script does."""
    for kind, places in PLACES.items():
        points = [{"name": "", "position": place} for place in places]
        bpy.ops.infrared.tool_add(kind=kind, points=points)
    infrared.difference_of, infrared.difference_to = "Box", "Ellipse"


def measuring():
    """Each measuring tool as the one that is chosen; and the isotherm beside a spot meter."""
    area = yield from only_picture()
    infrared = bpy.context.scene.infrared
    infrared.show_extremes = True
    place_tools(infrared)
    box = infrared.measuring_tools[2]
    box.use_own_emissivity, box.emissivity, box.reflected_temperature = True, 0.9, 293.15
    for index, kind in enumerate(PLACES):
        infrared.tool_index = index
        with bpy.context.temp_override(area=area, region=region_of(area)):
            bpy.ops.infrared.tool_choose(kind=kind)
        yield from settle(area)
        for distance in (5000, -FOLDED):
            with bpy.context.temp_override(area=area, region=region_of(area, "UI")):
                bpy.ops.view2d.pan(deltay=distance)
        yield from settle(area)
        keep(screenshot(), f"measure-{kind.lower()}", *WHOLE)
    bpy.ops.infrared.tool_remove(all=True)
    with bpy.context.temp_override(area=area, region=region_of(area, "UI")):
        bpy.ops.view2d.pan(deltay=5000)
    infrared.show_extremes, infrared.use_isotherm = False, True
    infrared.isotherm_low, infrared.isotherm_high = 303.15, 308.15
    with bpy.context.temp_override(area=area, region=region_of(area)):
        bpy.ops.infrared.spot_meter("INVOKE_DEFAULT")
    move_real_mouse(*METER)
    yield from settle(area)
    keep(screenshot(), "heat-display", *WHOLE)
    with bpy.context.temp_override(area=area, region=region_of(area)):
        bpy.ops.infrared.spot_meter("INVOKE_DEFAULT")  # ends it


def live():
    """Tools in two viewports, a large and a small one, which look through the camera."""
    yield from start_up()
    bpy.ops.wm.open_mainfile(filepath=str(EXAMPLES / "people.blend"), load_ui=False)
    yield DRAWN
    infrared = bpy.context.scene.infrared
    infrared.range_mode, infrared.range_low, infrared.range_high = "FIXED", 288.15, 308.15
    place_tools(infrared)
    with bpy.context.temp_override(area=area_of("PROPERTIES")):
        bpy.ops.screen.area_close()
    yield 0.5
    with bpy.context.temp_override(area=area_of("OUTLINER")):
        bpy.ops.screen.area_close()
    yield 0.5
    with bpy.context.temp_override(area=area_of("VIEW_3D")):
        bpy.ops.screen.area_split(direction="VERTICAL", factor=0.7)
    yield DRAWN
    for area in [each for each in bpy.context.screen.areas if each.type == "VIEW_3D"]:
        space = area.spaces.active
        space.region_3d.view_perspective, space.shading.type = "CAMERA", "RENDERED"
        space.overlay.show_extras = False
    yield 270.0  # for some passes, where others compute, too
    keep(screenshot(), "measure-viewport", *WHOLE)


STORIES = {story.__name__: story for story in (first, checks, tutorial, viewport, gases, shaders, measuring, live)}


def work():
    """A generator that yields how many seconds to wait."""
    for name in sys.argv[1:] or STORIES:
        yield from STORIES[name]()


if __name__ == "__main__":
    bpy.context.preferences.view.show_splash = False
    bpy.context.window.cursor_warp(2, 2)  # where it is over nothing that tells what it is
    tell(work())
