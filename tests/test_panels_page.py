# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/panels.md has every panel with every field that it draws, no other names, and a picture of each tab.

The page names a panel at the start of a line, **Panel** or **Parent > Panel**, and a field in the first column of the
table that follows, or in *emphasis*. Units in parentheses are left out.
"""

import re
from pathlib import Path
from types import FunctionType, MethodType, SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")

import blf  # noqa: E402

from addon.measure_settings import add_tool  # noqa: E402
from addon.preferences import InfraredPreferences  # noqa: E402
from addon.rendering.render_passes import render_passes  # noqa: E402
from addon.ui import checks  # noqa: E402
from tests.helpers.blender import cube_mesh, link, material  # noqa: E402

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGE = (DOCS / "panels.md").read_text(encoding="utf-8")
EMPHASIS = re.compile(r"(?<!\*)\*([^*\n]+)\*(?!\*)")
# What the page names of Blender's own interface, beside panels
BLENDERS = {
    "Render Engine", "Edit", "Preferences", "Add-ons", "Override", "Material", "World", "Samples", "Scene", "Units",
    "Unit Scale", "Equirectangular", "Rendered", "Render",
}  # fmt: skip
# The tab of the sidebar, the engine, and what *Checks* says
OURS = {"Infrared", "Infrared Photons", "Nothing to report"}
RENAMED = {"Z": "Depth"}  # what Blender 4.5 calls otherwise


def plain(name):
    """A name without its unit."""
    return name.partition(" (")[0]


# What the page says ---------------------------------------------------------------------------------------------------


def parts_of_page():
    """{name of the panel: the page's text from there to the next panel or section}; panels of one name together."""
    parts = {}
    for section in re.split(r"^## .*$", PAGE, flags=re.MULTILINE):
        pieces = re.split(r"^\*\*(\w[^*\n]*)\*\*", section, flags=re.MULTILINE)
        for name, text in zip(pieces[1::2], pieces[2::2], strict=True):
            parts[name] = parts.get(name, "") + text
    return parts


def cells(text):
    """The names in the first column of the tables in a text, but for their headings and lines."""
    rows = [
        cell for cell in re.findall(r"^\| *([^|\n]*?) *\|", text, re.MULTILINE) if cell.strip("-") not in ("", "field")
    ]
    return {name for row in rows for name in re.sub(r" \([^)]*\)", "", row).split(", ")}


def emphasised(text):
    return {plain(name) for path in EMPHASIS.findall(text) for name in path.split(" > ")}


# What the panels show -------------------------------------------------------------------------------------------------


class Labels:
    """Stands in for a layout, all its rows, columns and boxes: notes the names of the fields that are drawn.

    beside: names that all of them drew beside a value. A check box has its name to its right.
    """

    beside = set()

    def __init__(self):
        self.names = set()

    def _note(self, text):
        if text and not text[0].isdigit():  # buttons of an icon alone, and buttons that show a value
            self.names.add(RENAMED.get(plain(text), plain(text)))
        return self

    def prop(self, owner, name, text=None, **_):
        known = owner.bl_rna.properties.get(name)  # None of a custom property
        shown = known.name if text is None else text
        if known is None or known.type != "BOOLEAN":
            self.beside.add(shown)
        return self._note(shown)

    def prop_search(self, owner, name, *_, text=None, **__):
        return self.prop(owner, name, text)

    def operator(self, idname, text=None, **_):
        room, name = idname.split(".")
        return self._note(getattr(getattr(bpy.ops, room), name).get_rna_type().name if text is None else text)

    def operator_menu_enum(self, idname, _property, text=None, **_):
        return self.operator(idname, text)

    def menu(self, idname, text=None, **_):
        return self._note(getattr(bpy.types, idname).bl_label if text is None else text)

    def __getattr__(self, _name):
        return lambda *_, **__: self


def draw(panel, context):
    """The names that a panel draws in a context. Blender alone can make panels: something with its methods is drawn."""
    labels = Labels()

    class StandIn:
        layout = labels

        def __getattr__(self, name):
            value = getattr(panel, name)
            return MethodType(value, self) if isinstance(value, FunctionType) else value

    getattr(panel.draw, "_draw_funcs", [panel.draw])[0](StandIn(), context)  # without what others append to it
    return labels.names


def states():
    """Contexts that differ in what decides which fields are drawn; together they have all fields."""
    scene = bpy.context.scene
    infrared = scene.infrared
    scene.render.engine = "INFRARED_PHOTONS"
    infrared.range_mode, infrared.use_isotherm, infrared.group_exr_path = "FIXED", True, "//groups"
    scene.view_settings.exposure = 1.0  # changes colours
    add_tool(infrared, "BOX", [(0.1, 0.1), (0.5, 0.5)]).use_own_emissivity = True
    camera = bpy.data.cameras.new("Camera")
    camera.type = "PANO"
    world = bpy.data.worlds.new("World")
    gas = {"absorption": 0.1, "scattering": 0.1, "anisotropy": 0.1, "gas": "Breath"}
    of_world = {"temperature": 280.0, "temperature_group": "sky", "depth": 100.0, "pressure": 9e4}
    for key, value in (of_world | gas).items():
        world[key] = value
    of_surface = {"specular": 0.5, "roughness": 0.5, "fresnel": True, "transmittance": 0.1, "mix": 0.5}
    surface = link("Cube", cube_mesh(), temperature=300.0, temperature_group="cube", pressure=1e5)
    surface.data.materials.append(material("Filling", **gas))
    window = bpy.context.window_manager.windows[0]
    space = SimpleNamespace(image=SimpleNamespace(type="RENDER_RESULT"), shading=SimpleNamespace(type="RENDERED"))
    shown = SimpleNamespace(
        engine=scene.render.engine, scene=scene, view_layer=bpy.context.view_layer, screen=window.screen, region=None,
        window_manager=bpy.context.window_manager, space_data=space, camera=camera, world=world, object=surface,
        material=None, light=None, area=None,
    )  # fmt: skip
    many_points = [float(number) for um in range(8, 48) for number in (um, 0.5)]
    for emissivity in (0.5, many_points, "Tin"):
        shown.material = material(emissivity=emissivity, **of_surface, **gas)
        yield shown
    shown.material["gas"] = {"H2O": 0.1, "soot": 1e-7}
    for infrared.band_mode in ("UNIFORM", "ADAPTIVE", "CUSTOM"):
        yield shown
    for infrared.air_transmission_source in ("FORMULA", "WORLD"):
        yield shown
    for kind, shape in (("POINT", ""), ("SUN", ""), ("SPOT", ""), ("AREA", "SQUARE"), ("AREA", "RECTANGLE")):
        shown.light = bpy.data.lights.new(kind, kind)
        if shape:
            shown.light.shape = shape
        shown.object = link(kind, shown.light, temperature=3000.0)
        yield shown


@pytest.fixture
def drawn(monkeypatch):
    """{name of the panel, after its parent's: the names of its fields}; panels of one name together."""
    monkeypatch.setattr(checks, "draw_checks", lambda *_: None)  # sentences, not fields
    panels = [getattr(bpy.types, name) for name in dir(bpy.types) if name.startswith("INFRARED_PT_")]
    panels = [panel for panel in panels if not hasattr(panel, "preset_subdir")]  # a menu of presets
    fields = {}
    for context in states():
        for panel in filter(lambda each: each.poll(context), panels):
            parent = getattr(bpy.types, getattr(panel, "bl_parent_id", ""), None)
            name = f"{parent.bl_label} > {panel.bl_label}" if parent else panel.bl_label
            fields.setdefault(name, set()).update(draw(panel, context))
    assert len(fields) > 15 and sum(map(len, fields.values())) > 80  # the stand-ins do draw
    return fields


# Both together --------------------------------------------------------------------------------------------------------


def test_the_page_has_the_panels_that_there_are(drawn):
    inside = {"Passes"}  # holds others and no field
    assert set(parts_of_page()) == set(drawn) - inside


def test_each_panel_on_the_page_has_the_fields_that_it_draws(drawn):
    parts = parts_of_page()
    for name, fields in drawn.items():
        text = parts.get(name, "")
        missing, invented = fields - cells(text) - emphasised(text), cells(text) - fields
        assert not missing and not invented, name


def test_every_name_on_the_page_is_there(drawn):
    scene = bpy.context.scene
    infrared = scene.infrared.bl_rna.properties
    items = {item.name for each in infrared if each.type == "ENUM" for item in each.enum_items}
    panels = {part for name in drawn for part in name.split(" > ")}
    scene.infrared.use_detector = True
    passes = {each.name for each in render_passes(scene, bpy.context.view_layer)}
    own = {plain(each.name) for each in infrared} | draw(InfraredPreferences, bpy.context) | OURS
    known = set().union(own, items, panels, passes, *drawn.values())
    unknown, out_of_date = emphasised(PAGE) - known - BLENDERS - set(RENAMED), BLENDERS - emphasised(PAGE)
    assert not unknown and not out_of_date


def test_every_setting_is_on_the_page():
    settings = [
        each for each in bpy.context.scene.infrared.bl_rna.properties if each.type not in ("POINTER", "COLLECTION")
    ]
    names = {plain(each.name) for each in settings} - {"Name"}
    assert len(names) > 20
    panels = {name.rpartition(" > ")[2] for name in parts_of_page()}
    missing = names - cells(PAGE) - emphasised(PAGE) - panels
    assert not missing


def test_every_picture_is_there():
    pictures = re.findall(r"\((images/panel-[\w-]+\.png)\)", PAGE)
    assert len(pictures) == len(set(pictures)) == 12
    assert all((DOCS / picture).is_file() for picture in pictures)


def test_no_name_beside_a_value_is_cut(drawn):
    """In the Properties editor as it is in a new window of 1920 pixels, 340 pixels wide, of which names have 116."""
    blf.size(0, 11.0)
    wide = {name: blf.dimensions(0, name)[0] for name in Labels.beside}
    assert len(wide) > 40
    assert {name for name, pixels in wide.items() if pixels > 116.0} == set()
