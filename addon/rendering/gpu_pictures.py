# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperatures painted by the graphics card, so that another palette, range or isotherm costs no pass over the pixels.

It does what TemperatureScale.colours does: an image of temperatures and a table of the palette are textures, the ends
of the range and the isotherm are numbers of the shader.
"""

from __future__ import annotations

from functools import cache

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ..output.palette import PALETTES, display, linear
from ..output.temperature_scale import TemperatureScale

_VERTEX = """
void main()
{
  share = uv;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0);
}
"""
# The isotherm's w says what it does: 0 nothing, 1 paints. Blender brings what is drawn over an editor onto the
# screen by the power of 1 / 2.2, and not by sRGB's own curve, which differs in the dark: it is given the power of 2.2.
_FRAGMENT = """
void main()
{
  ivec2 size = textureSize(temperature, 0);
  float kelvin = texelFetch(temperature, clamp(ivec2(share * vec2(size)), ivec2(0), size - 1), 0).r;
  int last = textureSize(palette, 0).x - 1;
  float place = (kelvin - ends.x) * (float(last) / (ends.y - ends.x));
  int entry = place > 0.0 ? int(min(place, float(last)) + 0.5) : 0;
  vec4 colour = texelFetch(palette, ivec2(entry, 0), 0);
  if (isotherm.w > 0.5 && kelvin >= ends.z && kelvin <= ends.w) {
    colour.rgb = isotherm.rgb;
  }
  if (encode > 0.5 && srgbTarget) {
    colour.rgb = pow(colour.rgb, vec3(2.2));
  }
  picture = vec4(colour.rgb, 1.0);
}
"""


@cache
def _shader() -> gpu.types.GPUShader:
    info = gpu.types.GPUShaderCreateInfo()
    between = gpu.types.GPUStageInterfaceInfo("infrared_picture")
    between.smooth("VEC2", "share")
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_in(1, "VEC2", "uv")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "picture")
    info.sampler(0, "FLOAT_2D", "temperature")
    info.sampler(1, "FLOAT_2D", "palette")
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.push_constant("VEC4", "ends")  # of the range, then of the isotherm, K
    info.push_constant("VEC4", "isotherm")
    info.push_constant("FLOAT", "encode")
    info.push_constant("BOOL", "srgbTarget")  # Blender sets it, by this name
    info.vertex_source(_VERTEX)
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)


def temperature_texture(temperature: np.ndarray) -> gpu.types.GPUTexture:
    """A texture of temperatures (h, w), K; of a picture larger than the card takes, every second pixel or fewer."""
    most = gpu.capabilities.max_texture_size_get()
    step = -(-max(temperature.shape) // most)
    shown = np.ascontiguousarray(temperature[::step, ::step], np.float32)
    buffer = gpu.types.Buffer("FLOAT", shown.size, shown.reshape(-1))
    return gpu.types.GPUTexture(shown.shape[::-1], format="R32F", data=buffer)


@cache
def _palette_texture(name: str, primaries: bytes | None) -> gpu.types.GPUTexture:
    """The colours of a palette in a texture of one row. primaries: see `draw_temperatures`, as bytes."""
    table = np.ones((len(PALETTES[name]), 4), np.float32)
    table[:, :3] = _colours(PALETTES[name], primaries)
    buffer = gpu.types.Buffer("FLOAT", table.size, table.reshape(-1))
    return gpu.types.GPUTexture((len(table), 1), format="RGBA32F", data=buffer)


def _colours(colours: np.ndarray, primaries: bytes | None) -> np.ndarray:
    """Linear Rec.709 (n, 3) in a working space, or as 8 bits of sRGB are, 0..1."""
    if primaries is None:
        return display(colours) / np.float32(255.0)
    return colours @ np.frombuffer(primaries, np.float32).reshape(3, 3)


def draw_temperatures(texture, scale: TemperatureScale, place, primaries: np.ndarray | None = None) -> None:
    """Draw a temperature texture in the colours of a scale whose ends are known.

    place: left, bottom, width and height of the picture, in units of the current matrix. primaries: (3, 3) of the
    working space, see painting.working_primaries, for a framebuffer of linear colours; None draws sRGB for the screen.
    """
    left, bottom, width, height = place
    right, top = left + width, bottom + height
    shader, isotherm = _shader(), scale.isotherm
    key = None if primaries is None else np.ascontiguousarray(primaries, np.float32).tobytes()
    palette = "WHITE_HOT" if isotherm and isotherm.grey else scale.palette
    between, colour = (0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    if isotherm:
        between = tuple(sorted((isotherm.low, isotherm.high)))
        colour = (*_colours(linear(isotherm.colour).astype(np.float32)[None], key)[0].tolist(), 1.0)
    gpu.state.blend_set("NONE")
    shader.bind()
    shader.uniform_float(
        "ModelViewProjectionMatrix", gpu.matrix.get_projection_matrix() @ gpu.matrix.get_model_view_matrix()
    )
    shader.uniform_float("ends", (scale.low, scale.high, *between))
    shader.uniform_float("isotherm", colour)
    shader.uniform_float("encode", 1.0 if primaries is None else 0.0)
    shader.uniform_sampler("temperature", texture)
    shader.uniform_sampler("palette", _palette_texture(palette, key))
    corners = ((left, bottom), (right, bottom), (right, top), (left, bottom), (right, top), (left, top))
    shares = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    batch_for_shader(shader, "TRIS", {"pos": corners, "uv": shares}).draw(shader)


def forget_textures() -> None:
    """Free what is kept on the graphics card, before the add-on is removed."""
    _palette_texture.cache_clear()
    _shader.cache_clear()
