# SPDX-License-Identifier: GPL-3.0-or-later
"""How temperatures are shown: settings reach Combined and PNG files, and the spot meter reads the pixel it points at.

The scenes are black walls: they reflect nothing, so every pixel is known.
"""

import dataclasses

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from addon.heat_settings import read_scale, scene_unit  # noqa: E402
from addon.output.colour_bar import INK, ColourBar  # noqa: E402
from addon.output.heat_picture import LEAST_HEIGHT, Beside, write_picture  # noqa: E402
from addon.output.palette import PALETTES, display  # noqa: E402
from addon.output.temperature_scale import CELSIUS, FAHRENHEIT, KELVIN, Isotherm, TemperatureScale  # noqa: E402
from addon.rendering import final_render, last_render  # noqa: E402
from addon.rendering.last_render import TABLES, forget_last_render  # noqa: E402
from addon.ui.temperatures import spot_meter  # noqa: E402
from addon.ui.temperatures.heat_display import ENGINE, INFRARED_PT_heat_display  # noqa: E402
from tests.helpers.blender import camera, cube_mesh, editor, link, material, read_png, render_to_exr  # noqa: E402

ROUNDING = 1e-3  # of linear colours: Blender's own matrices, and temperatures next to a step of the palette's table


@pytest.fixture(autouse=True)
def small_render(reset_blender):
    camera()
    infrared = bpy.context.scene.infrared
    infrared.passes, infrared.photons_per_pass, infrared.band_count, infrared.threads = 2, 1000, 2, 1
    yield
    forget_last_render()


def walls(left=280.0, right=340.0):
    """Two black walls that meet in the middle of the picture, one in each half."""
    for name, temperature, x in (("Left", left, -20.0), ("Right", right, 20.0)):
        mesh = cube_mesh(name)
        mesh.materials.append(material(name, emissivity=1.0))
        obj = link(name, mesh, temperature=temperature)
        obj.scale, obj.location = (40.0, 40.0, 40.0), (x, 0.0, -20.0)


def choose(palette="IRON", low=None, high=None, isotherm=None):
    """Set scene.infrared to a scale."""
    infrared = bpy.context.scene.infrared
    infrared.palette = palette
    if low is not None:
        infrared.range_mode, infrared.range_low, infrared.range_high = "FIXED", low, high
    if isotherm:
        infrared.use_isotherm, infrared.isotherm_colour = True, isotherm.colour
        infrared.isotherm_low, infrared.isotherm_high = isotherm.low, isotherm.high
        infrared.isotherm_rest = "GREY" if isotherm.grey else "PALETTE"


# settings


def test_the_palettes_to_choose_are_those_there_are():
    items = bpy.context.scene.infrared.bl_rna.properties["palette"].enum_items
    assert {item.identifier for item in items} == set(PALETTES)


def test_settings_make_a_scale():
    infrared = bpy.context.scene.infrared
    assert read_scale(infrared) == TemperatureScale()
    infrared.range_low = 1.0  # of no effect while the range is automatic
    assert read_scale(infrared) == TemperatureScale()
    isotherm = Isotherm(300.0, 310.0, (1.0, 0.5, 0.0), grey=True)
    choose("VIRIDIS", 290.0, 320.0, isotherm)
    assert read_scale(infrared) == TemperatureScale("VIRIDIS", 290.0, 320.0, isotherm)


@pytest.mark.parametrize("name", ["range_low", "range_high", "isotherm_low", "isotherm_high"])
def test_temperatures_are_shown_in_the_scenes_unit(name):
    prop = bpy.context.scene.infrared.bl_rna.properties[name]
    assert prop.unit == "TEMPERATURE" and prop.subtype == "TEMPERATURE" and prop.hard_min == 0.0


def test_the_scenes_unit():
    units, expected = bpy.context.scene.unit_settings, {"KELVIN": KELVIN, "CELSIUS": CELSIUS, "FAHRENHEIT": FAHRENHEIT}
    for system in ("METRIC", "IMPERIAL"):
        units.system = system
        for name in ("KELVIN", "CELSIUS" if system == "METRIC" else "FAHRENHEIT"):
            units.temperature_unit = name
            assert scene_unit(bpy.context.scene) == expected[name]
    units.system = "NONE"
    assert scene_unit(bpy.context.scene) == KELVIN


def test_the_panel_is_in_the_render_tab():
    assert INFRARED_PT_heat_display.bl_context == "render" and ENGINE in INFRARED_PT_heat_display.COMPAT_ENGINES


# Combined


@pytest.mark.parametrize(
    "scale",
    [
        TemperatureScale("IRON", 270.0, 350.0),
        TemperatureScale("BLACK_HOT", 270.0, 350.0),
        TemperatureScale("INFERNO", 300.0, 310.0),
        TemperatureScale("RAINBOW", 270.0, 350.0, Isotherm(330.0, 345.0, (1.0, 0.5, 0.0))),
        TemperatureScale("RAINBOW", 270.0, 350.0, Isotherm(330.0, 345.0, (0.0, 0.5, 1.0), grey=True)),
    ],
    ids=str,
)
def test_combined_has_the_chosen_colours(tmp_path, scale):
    walls()
    choose(scale.palette, scale.low, scale.high, scale.isotherm)
    combined = render_to_exr(tmp_path)["ViewLayer"]["Combined"]
    for column, temperature in ((0, 280.0), (-1, 340.0)):
        expected = scale.colours(np.array(temperature))
        np.testing.assert_allclose(combined[:, column, :3], np.broadcast_to(expected, (12, 3)), atol=ROUNDING)
    assert np.all(combined[..., 3] == 1.0)


def test_an_automatic_range_spans_the_image(tmp_path):
    walls()
    choose("WHITE_HOT")
    combined = render_to_exr(tmp_path)["ViewLayer"]["Combined"]
    assert np.all(combined[:, 0, :3] == 0.0) and np.allclose(combined[:, -1, :3], 1.0, atol=ROUNDING)


def test_a_background_without_a_temperature_takes_no_part_in_an_automatic_range(tmp_path):
    """Neither in the picture nor in the range of the last render, of which a second view layer shows nothing else."""
    walls()
    for obj in bpy.data.objects:
        if obj.type == "MESH":
            obj.scale, obj.location = (1.0, 2.0, 1.0), (0.5 if obj.name == "Right" else -0.5, 0.0, 0.0)
    choose("WHITE_HOT")
    combined = render_to_exr(tmp_path)["ViewLayer"]["Combined"][..., 0]
    temperature = final_render.finished_layers["ViewLayer"]["temperature"]
    assert (temperature == 0.0).any()
    np.testing.assert_allclose(combined[temperature > 339.0], 1.0, atol=0.01)
    np.testing.assert_array_equal(combined[temperature <= 280.0], 0.0)  # the left wall as well as the background
    layers, frames = final_render.finished_layers, final_render.finished_frames
    layers["Empty"] = layers["ViewLayer"] | {"temperature": np.zeros((3, 5), np.float32)}
    frames["Empty"] = frames["ViewLayer"]
    assert bpy.ops.infrared.range_from_render() == {"FINISHED"}
    infrared = bpy.context.scene.infrared
    assert (infrared.range_low, infrared.range_high) == (pytest.approx(280.0, abs=0.1), pytest.approx(340.0, abs=0.1))


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="Blender 4.5 has one working space")
def test_combined_is_in_the_working_space_of_the_file(tmp_path):
    """Blender's own conversion of the pixels back to Rec.709 gives the palette's colours."""
    from mathutils import Color

    walls()
    bpy.ops.wm.set_working_color_space(working_space="ACEScg")
    choose("RAINBOW", 270.0, 350.0)
    combined = render_to_exr(tmp_path)["ViewLayer"]["Combined"]
    expected = TemperatureScale("RAINBOW", 270.0, 350.0).colours(np.array([280.0, 340.0]))
    for column, colour in ((0, expected[0]), (-1, expected[1])):
        assert not np.allclose(combined[0, column, :3], colour, atol=0.01)
        back = Color(combined[0, column, :3]).from_scene_linear_to_rec709_linear()
        np.testing.assert_allclose(back, colour, atol=ROUNDING)


# PNG files


def test_the_picture_file_holds_the_colours_bit_by_bit(tmp_path):
    image = np.linspace(280, 340, 40 * 30).reshape(40, 30)
    scale = TemperatureScale("VIRIDIS", 290.0, 330.0)
    write_picture(tmp_path / "a.png", image, scale, KELVIN, Beside(colour_bar=False))
    np.testing.assert_array_equal(read_png(tmp_path / "a.png"), display(scale.colours(image)))


@pytest.mark.parametrize("size", [(400, 300), (40, 30), (1, 1)])
def test_the_bar_in_a_file_is_beside_the_picture(tmp_path, size):
    width, height = size
    image = np.linspace(280, 340, width * height).reshape(height, width)
    scale = TemperatureScale("INFERNO", 290.0, 330.0)
    write_picture(tmp_path / "a.png", image, scale, CELSIUS)
    pixels = read_png(tmp_path / "a.png")
    bar = ColourBar(scale, CELSIUS, width, 0, max(height, LEAST_HEIGHT))
    assert pixels.shape == (bar.height, width + bar.panel_width(bar.text), 3)
    np.testing.assert_array_equal(pixels[-height:, :width], display(scale.colours(image)))
    left, bottom, across, up = bar.bar
    np.testing.assert_array_equal(pixels[bottom : bottom + up, left], display(bar.colours()))
    ink = np.rint(np.array(INK) * 255)
    for start, _, y in bar.ticks():
        assert np.array_equal(pixels[min(int(y), bottom + up - 1), round(start)], ink)
    labels = pixels[:, left + across + bar.text // 2 :].max(axis=2) > 150  # light text on a dark ground
    for y, _ in bar.marks():
        assert labels[max(0, int(y) - 4) : int(y) + 5].any()
    assert labels[:, :].sum() > 50 and pixels[bottom + up + 5 :, left : left + 2 * bar.text].max() > 150  # the unit


def test_labels_stay_inside_the_picture():
    """Seven digits, the longest label of a range below 10,000, have room beside the bar."""
    import blf

    for text in (13, 27, 60):
        bar = ColourBar(TemperatureScale(low=280.0, high=290.0), CELSIUS, 0, 0, 20 * text, text)
        blf.size(0, text)
        for x, y, _label in list(bar.labels())[:-1]:
            assert x + blf.dimensions(0, "-273.15")[0] <= bar.panel_width(text)
            assert 0 <= y <= bar.height - text


@pytest.mark.parametrize("image", [np.full((3, 3), np.nan), np.full((3, 3), 300.0)])
def test_any_image_can_be_written(tmp_path, image):
    write_picture(tmp_path / "a.png", image, TemperatureScale(), KELVIN)
    assert (tmp_path / "a.png").exists()


def test_export_writes_the_last_render_with_the_settings_of_now(tmp_path):
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.infrared.export_picture(filepath=str(tmp_path / "a.png"))
    walls()
    render_to_exr(tmp_path)
    choose("RAINBOW", 270.0, 350.0)
    images = len(bpy.data.images)
    assert bpy.ops.infrared.export_picture(filepath=str(tmp_path / "a.png"), colour_bar=False) == {"FINISHED"}
    colours = display(TemperatureScale("RAINBOW", 270.0, 350.0).colours(np.array([280.0, 340.0])))
    np.testing.assert_array_equal(read_png(tmp_path / "a.png")[0, [0, -1]], colours)
    assert bpy.ops.infrared.export_picture(filepath=str(tmp_path / "a.png")) == {"FINISHED"}
    assert read_png(tmp_path / "a.png").shape[1] > 16 and len(bpy.data.images) == images
    with pytest.raises(RuntimeError, match="no such folder"):
        bpy.ops.infrared.export_picture(filepath=str(tmp_path / "missing" / "a.png"))


def test_export_writes_every_view_layer(tmp_path):
    walls()
    bpy.context.scene.view_layers.new("Other")
    render_to_exr(tmp_path)
    bpy.ops.infrared.export_picture(filepath=str(tmp_path / "a.png"))
    assert sorted(path.name for path in tmp_path.glob("a*.png")) == ["a_Other.png", "a_ViewLayer.png"]


def test_the_range_of_the_last_render_can_be_fixed(tmp_path):
    walls()
    render_to_exr(tmp_path)
    assert bpy.ops.infrared.range_from_render() == {"FINISHED"}
    scale = read_scale(bpy.context.scene.infrared)
    assert (scale.low, scale.high) == (pytest.approx(280.0, rel=1e-6), pytest.approx(340.0, rel=1e-6))


# the spot meter


def test_every_pixel_is_found_at_its_middle_and_in_a_border():
    size, origin, shape = (16, 12), (4, 6), (6, 8)
    for row in range(12):
        for column in range(16):
            inside = 0 <= row - 6 < 6 and 0 <= column - 4 < 8
            found = spot_meter.pixel_at((column + 0.5) / 16, (row + 0.5) / 12, size, origin, shape)
            assert found == ((row - 6, column - 4) if inside else None)


def reading_at(u, v, unit):
    """The reading in an Image Editor that shows the only view layer."""
    scene = bpy.context.scene
    return spot_meter.reading_at(spot_meter.shown_layer(editor(), scene).picture, scene.infrared, u, v, unit)


def shown_layer(space, scene):
    """The name of the finished view layer that an editor shows and whether it is its Combined, or None."""
    shown = spot_meter.shown_layer(space, scene)
    if shown is None:
        return None
    (name,) = (name for name, images in final_render.finished_layers.items() if images is shown.images)
    assert shown.frame is final_render.finished_frames[name]
    return name, shown.is_combined


@pytest.mark.parametrize("crop", [None, False, True])
def test_readings_are_those_of_the_render(tmp_path, crop):
    """Left wall, right wall and outside a border, as shares of what Blender shows."""
    walls()
    render = bpy.context.scene.render
    if crop is not None:
        render.use_border, render.use_crop_to_border = True, crop
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 1.0, 0.5, 1.0
    shown = render_to_exr(tmp_path)["ViewLayer"]["Temperature"]
    frame = final_render.finished_frames["ViewLayer"]
    assert frame.size == (shown.shape[1], shown.shape[0])
    for row in range(shown.shape[0]):
        for column in range(shown.shape[1]):
            u, v = (column + 0.5) / shown.shape[1], (row + 0.5) / shown.shape[0]
            text = reading_at(u, v, KELVIN)
            kelvin = shown[row, column]
            if kelvin == 0.0:  # outside the border
                assert text is None
            else:
                assert abs(float(text.split()[0]) - kelvin) <= 0.5 and text.endswith(" K")
    assert reading_at(0.99, 0.99, CELSIUS) == "66.85 ± 0.00 °C"  # 340 K, and no photon


def test_reading_copies_no_image(tmp_path):
    walls()
    render_to_exr(tmp_path)
    real = final_render.finished_layers["ViewLayer"]

    class OnePixel(np.ndarray):
        def __getitem__(self, index):
            assert all(isinstance(part, int) for part in index)
            return super().__getitem__(index)

    final_render.finished_layers["ViewLayer"] = real | {
        name: real[name].view(OnePixel) for name in ("temperature", "noise")
    }
    assert reading_at(0.1, 0.1, KELVIN) == "280.00 ± 0.00 K"


def test_the_editor_chooses_the_view_layer(tmp_path):
    scene = bpy.context.scene
    walls()
    scene.view_layers.new("Unused").use = False
    scene.view_layers.new("Other")
    assert shown_layer(editor(), scene) is None  # before the first render
    render_to_exr(tmp_path)
    assert shown_layer(editor(0), scene) == ("ViewLayer", True)
    assert shown_layer(editor(1), scene) == ("Other", True)
    assert shown_layer(editor(1, 3), scene) == ("Other", False)
    assert shown_layer(editor(2), scene) is None
    assert shown_layer(editor(0, slot=1), scene) is None
    assert shown_layer(editor(0, kind="IMAGE"), scene) is None
    assert shown_layer(editor(0), bpy.data.scenes.new("Another")) is None


@pytest.mark.parametrize("alone", ["ViewLayer", "Middle", "Unused"])
def test_a_view_layer_rendered_alone_takes_its_place_among_the_others(tmp_path, alone):
    """Blender puts them in the scene's order, and keeps those of its size: in a window, but here others are off."""
    scene = bpy.context.scene
    walls()
    for name in ("Unused", "Middle", "Last"):
        scene.view_layers.new(name).use = name != "Unused"
    scene.render.engine = "INFRARED_PHOTONS"
    bpy.ops.render.render()
    before, scene.render.use_single_layer = dict(final_render.finished_layers), True
    for layer in scene.view_layers:
        layer.use = layer.name == alone
    bpy.ops.render.render()
    order = [layer.name for layer in scene.view_layers if layer.name in {*before, alone}]
    assert list(final_render.finished_layers) == list(final_render.finished_frames) == order
    changed = {name for name, images in final_render.finished_layers.items() if images is not before.get(name)}
    assert changed == {alone}
    scene.render.resolution_x += 1
    bpy.ops.render.render()
    assert list(final_render.finished_layers) == list(final_render.finished_frames) == [alone]
    bpy.data.objects["Left"]["temperature"] = -1.0
    with pytest.raises(RuntimeError):
        bpy.ops.render.render()
    assert not final_render.finished_layers and shown_layer(editor(), scene) is None


def compositor(scene, *scenes):
    """The scene's new compositor, which mixes renders of these scenes."""
    if hasattr(scene, "compositing_node_group"):  # Blender 5
        tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        out = tree.nodes.new("NodeGroupOutput").inputs[0]
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        out = tree.nodes.new("CompositorNodeComposite").inputs[0]
    both = tree.nodes.new("CompositorNodeAlphaOver")
    sockets = [socket for socket in both.inputs if socket.type == "RGBA"]
    for socket, each in zip(sockets, scenes, strict=True):
        node = tree.nodes.new("CompositorNodeRLayers")
        node.scene = each
        tree.links.new(node.outputs["Image"], socket)
    tree.links.new(both.outputs[0], out)


def test_a_scene_for_the_compositor_leaves_the_shown_ones_picture(tmp_path):
    """It is the rendered scene that can be read and exported; the other one still writes its files."""
    scene = bpy.context.scene
    walls(300.0, 300.0)
    bpy.ops.scene.new(type="FULL_COPY")
    other = bpy.context.scene
    for obj in other.objects:
        obj["temperature"] = 330.0
    other.render.engine = scene.render.engine = "INFRARED_PHOTONS"
    other.infrared.band_exr_path = str(tmp_path / "other")
    bpy.context.window.scene = scene
    compositor(scene, scene, other)
    bpy.ops.render.render()
    assert [frame.scene for frame in final_render.finished_frames.values()] == [scene.name]
    np.testing.assert_allclose(final_render.finished_layers["ViewLayer"]["temperature"], 300.0, rtol=1e-6)
    assert (tmp_path / "other.exr").exists()


def test_a_render_of_another_engine_forgets_ours(tmp_path):
    """Else bar, spots and exports would be those of a picture that is not seen."""
    scene = bpy.context.scene
    walls()
    render_to_exr(tmp_path)

    class OtherEngine(bpy.types.RenderEngine):
        bl_idname, bl_label = "OTHER_ENGINE", "Other"

        def render(self, depsgraph):
            pass

    bpy.utils.register_class(OtherEngine)
    try:
        scene.render.engine = "OTHER_ENGINE"
        assert shown_layer(editor(), scene) is None
        bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(OtherEngine)
    scene.render.engine = "INFRARED_PHOTONS"
    assert shown_layer(editor(), scene) is None and not any(TABLES)


def test_a_render_may_begin_while_an_editor_is_drawn(tmp_path):
    """Its thread empties the tables; what is being drawn stays whole."""
    walls()
    render_to_exr(tmp_path)
    shown = spot_meter.shown_layer(editor(), bpy.context.scene)
    forget_last_render()
    infrared = bpy.context.scene.infrared
    assert spot_meter.reading_at(shown.picture, infrared, 0.1, 0.1, KELVIN) == "280.00 ± 0.00 K"
    assert spot_meter.shown_layer(editor(), bpy.context.scene) is None


def test_the_compositors_picture_comes_before_the_layers(tmp_path):
    walls()
    render_to_exr(tmp_path)
    frames, scene = final_render.finished_frames, bpy.context.scene
    assert not frames["ViewLayer"].composited
    frames["ViewLayer"] = dataclasses.replace(frames["ViewLayer"], composited=True)
    assert shown_layer(editor(0), scene) == ("ViewLayer", False)
    assert shown_layer(editor(1), scene) == ("ViewLayer", True)


def test_another_file_shows_nothing_of_the_last_render(tmp_path):
    walls()
    render_to_exr(tmp_path)
    assert shown_layer(editor(), bpy.context.scene)
    final_render.finished_groups["ViewLayer"] = tmp_path / "groups.exr"
    last_render.last_failures["Scene"] = "It failed once"
    assert all(TABLES)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert shown_layer(editor(), bpy.context.scene) is None
    assert not any(TABLES)
    assert not bpy.ops.infrared.export_bands.poll() and not bpy.ops.infrared.range_from_render.poll()


def test_the_tables_of_the_last_render_are_all_there():
    found = [table for name, table in vars(last_render).items() if name.startswith(("finished_", "last_"))]
    assert list(map(id, found)) == list(map(id, TABLES))


def test_the_meters_help_leaves_every_workspace(monkeypatch):
    """Each has its own text, and the window may have moved on to another since the meter was started."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    texts = {}
    monkeypatch.setattr(
        bpy.types.WorkSpace, "status_text_set", lambda _self, text: texts.update({bpy.context.workspace.name: text})
    )
    spot_meter.stop(bpy.context)
    assert len(texts) > 5 and set(texts) == set(bpy.data.workspaces.keys()) and set(texts.values()) == {None}


def test_a_cancelled_or_new_render_forgets_the_last_one(tmp_path, monkeypatch):
    walls()
    render_to_exr(tmp_path)

    def fail(*_args, **_options):
        raise ZeroDivisionError

    monkeypatch.setattr(final_render, "render", fail)
    with pytest.raises(RuntimeError):
        render_to_exr(tmp_path)
    assert not final_render.finished_frames
