# SPDX-License-Identifier: GPL-3.0-or-later
"""The example scenes and the application template: what their scripts build, without a complaint, and renderable.

Of all files that are shipped, the demo's too: their numbers have units in the panels."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.pairs.changes import bind  # noqa: E402
from addon.pairs.ranges import read_rules  # noqa: E402
from addon.properties import CUSTOM_PROPERTIES  # noqa: E402
from addon.rendering.checks import scene_checks  # noqa: E402
from docs.examples import car, engine, facade, modelling, people, plume, steam, street, traffic  # noqa: E402
from docs.tools import make_template, plot_tutorial  # noqa: E402
from docs.tools.paths import DOCS, TEMPLATE  # noqa: E402
from tests.helpers.blender import describe, read, render_to_exr  # noqa: E402

CONTRAST = {"street": 3}  # K between dark and bright pixels, where fog leaves less than the 5 K of the others
SCENES = {  # the script and its file
    "facade": (facade, DOCS / "examples" / "facade.blend"),
    "engine": (engine, DOCS / "examples" / "engine.blend"),
    "car": (car, DOCS / "examples" / "car.blend"),
    "people": (people, DOCS / "examples" / "people.blend"),
    "plume": (plume, DOCS / "examples" / "plume.blend"),
    "steam": (steam, DOCS / "examples" / "steam.blend"),
    "street": (street, DOCS / "examples" / "street.blend"),
    "traffic": (traffic, DOCS / "examples" / "traffic.blend"),
    "template": (make_template, TEMPLATE),
}
every_scene = pytest.mark.parametrize("name", SCENES)
# Renders that one Python is enough for, and those, with kernels of their own to compile, that are left to --long
MARKS = dict.fromkeys(("street", "car", "traffic"), pytest.mark.once) | dict.fromkeys(
    ("plume", "steam"), pytest.mark.long
)


def open_scene(name):
    bpy.ops.wm.open_mainfile(filepath=str(SCENES[name][1]), load_ui=False)
    return bpy.context.scene


@every_scene
def test_file_is_what_its_script_makes(name):
    stored = describe(open_scene(name))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    SCENES[name][0].build()
    bpy.context.view_layer.update()
    assert describe(bpy.context.scene) == stored


@every_scene
def test_checks_and_reader_have_nothing_to_say(name):
    scene = open_scene(name)
    assert scene.render.engine == "INFRARED_PHOTONS" and scene.view_settings.view_transform == "Standard"
    assert scene_checks(scene, bpy.context.view_layer) == []
    solver_scene, warnings = read()
    assert warnings == []
    assert len(solver_scene.triangles) < 200_000


def test_what_a_data_set_draws_fits_its_scene():
    """All that traffic.json names is there; people and cars are told apart by their category."""
    scene = open_scene("traffic")
    changes = bind(read_rules(DOCS / "examples" / "traffic.json"), scene, scene.view_layers[0])
    shown = [change.thing for change in changes if change.key == "visible"]
    assert len(shown) == len(traffic.PEOPLE) + len(traffic.CARS)
    kinds = {obj["category"] for obj in scene.objects if "category" in obj}
    assert kinds == {"person", "car"}


def test_step_10_of_the_tutorial_works_in_a_new_file():
    scene = open_scene("template")
    plot_tutorial.follow_steps()
    assert scene_checks(scene, bpy.context.view_layer) == []
    contents, warnings = read()
    assert warnings == []
    assert contents.sky is not None
    (image,) = contents.textures.temperatures
    assert 293.15 <= image.values.min() < image.values.max() <= 333.16  # K, what 0 and 1 mean; in float32
    film, pond = (next(m for m in contents.materials if m.name == name) for name in ("Film", "Floor"))
    assert film.transmittance == 0.78 and pond.fresnel


def evaluated_normals(thing):
    """Of a mesh after modifiers: normals at corners (c, 3), those of their faces (c, 3), and areas of these (c,)."""
    mesh = thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    corners = np.array([corner.vector for corner in mesh.corner_normals])
    sizes = [face.loop_total for face in mesh.polygons]
    faces = np.repeat([face.normal for face in mesh.polygons], sizes, axis=0)
    return corners, faces, np.repeat([face.area for face in mesh.polygons], sizes)


def test_round_shapes_are_shaded_round_with_their_edges():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    paint = modelling.surface("Paint", 0.9)
    can = modelling.add("Can", modelling.turned([(0.5, 0.0), (0.5, 1.0)], 24), paint, 300.0)
    corners, faces, _ = evaluated_normals(can)
    ends = np.abs(faces[:, 2]) > 0.5
    assert np.allclose(corners[ends], faces[ends], atol=1e-3)  # float32, and vertices are rounded to 1 / 2**14 m
    tilt = np.sum(corners[~ends] * faces[~ends], axis=1)  # corners lie half a facet beside the middle of one
    assert np.allclose(tilt, np.cos(np.pi / 24), atol=1e-3)


def test_boxes_stay_flat_and_their_bevels_are_round():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    paint, shape = modelling.surface("Paint", 0.9), modelling.box((0, 0, 0), (1, 1, 1))
    assert modelling.add("Box", shape, paint, 300.0).data.normals_domain == "FACE"
    corners, faces, area = evaluated_normals(modelling.add("Cushion", shape, paint, 300.0, bevel=0.05))
    sides = area > 0.5  # m2; 0.81 of the sides, at most 0.9 * 0.05 of a bevel's strip
    assert np.allclose(corners[sides], faces[sides], atol=1e-3)
    assert np.abs(corners[~sides] - faces[~sides]).max() > 0.1


@pytest.mark.parametrize("path", sorted(DOCS.rglob("*.blend")), ids=lambda path: path.stem)
def test_panels_show_the_units_of_all_numbers(path):
    """Without a subtype a field shows a bare number of kelvin, also where temperatures are shown in degrees Celsius."""
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    blocks = [*bpy.data.objects, *bpy.data.materials, *bpy.data.worlds]
    numbers = [(block, key) for block in blocks for key, value in block.items() if isinstance(value, int | float)]
    numbers = [(block, key) for block, key in numbers if key in CUSTOM_PROPERTIES]
    assert {"temperature", "specular", "roughness"} <= {key for _, key in numbers}
    bare = [
        (block.name, key)
        for block, key in numbers
        if block.id_properties_ui(key).as_dict()["subtype"] != CUSTOM_PROPERTIES[key].get("subtype", "NONE")
    ]
    assert bare == []
    paints = [paint for paint in bpy.data.materials if "emissivity" in paint]
    fixed = [paint.name for paint in paints if paint.is_property_overridable_library('["emissivity"]')]
    assert fixed == []  # Blender keeps their type: scripts could no longer set a library name or a curve


@pytest.mark.once
@pytest.mark.parametrize("name", [pytest.param(name, marks=MARKS.get(name, [])) for name in SCENES])
def test_temperatures_lie_between_the_coldest_and_the_hottest_thing(name, tmp_path):
    """A body emits at most what a blackbody of the hottest one does; what it lacks it reflects, at least the coldest.

    Noise is estimated from eight passes, so that Student's t has 7 degrees of freedom: a pixel on one of the borders
    is beyond it by 3 standard errors once in 100. Most pixels are far inside, and exact where nothing is reflected.
    """
    scene = open_scene(name)
    contents = read()[0]
    temperatures = [*contents.temperature.flat, *(medium.temperature for medium in contents.media)]  # K
    if contents.textures is not None:
        temperatures += [kelvin for image in contents.textures.temperatures for kelvin in image.values.flat]
    sky = [contents.world_temperature] if contents.sky is None else contents.sky.kelvin.flat
    coldest, hottest = min(*temperatures, *sky), max(temperatures)
    infrared, picture = scene.infrared, scene.render
    picture.resolution_x, picture.resolution_y = 40, 30
    infrared.passes, infrared.photons_per_pass, infrared.target_noise = 8, 20_000, 0.0
    images = render_to_exr(tmp_path)["ViewLayer"]
    kelvin, noise = images["Temperature"], images["Noise"]
    assert np.isfinite(kelvin).all() and np.isfinite(noise).all()
    slack = 3 * noise + 1e-3  # K: float32 has 3e-5 K at 500 K, and the temperature comes from a table
    assert np.mean((kelvin > coldest - slack) & (kelvin < hottest + slack)) > 0.99
    low, high = np.percentile(kelvin, [2, 98])
    assert infrared.range_mode == "AUTOMATIC" or infrared.range_low < high and low < infrared.range_high
    assert high - low > CONTRAST.get(name, 5)  # K: there is something to see
