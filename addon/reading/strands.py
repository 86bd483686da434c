# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's hair curves, particle hair and point clouds become triangles, see tubes and spheres.

How fine they are depends on the size of a pixel of the scene's camera where they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np

from .arrays import read_values
from .meshes import MeshData, attribute_problem
from .spheres import Points, face_count, levels_of, solids
from .surface_temperature import NAME, attribute_temperatures
from .tubes import (
    ALLOWED_KELVIN,
    Strands,
    catmull_rom_handles,
    closed,
    joined_strands,
    prisms,
    rounded,
    shortened,
    sides_of,
    thinned,
    tolerances,
    triangle_count,
)
from .warnings import Warnings

CURVES_RADIUS, POINT_RADIUS = 0.005, 0.01  # where the attribute is missing, units; as in Cycles
ROUNDING = 0.25  # share of what hairs may be off in which they are rounded; in the rest they are thinned
MOST_PIECES = 500_000  # into which the hair of an object is cut for the sake of speed alone
WIDEST, FEW = 0.25, 1000  # see `simplified`
_ROUNDED = 1e-5  # more than sums of shares are rounded, less than a share
_EVEN = 0.1  # of the way to the next hair: how far a hair may lie beside the middle between its neighbours
_ALIKE = 0.01  # of its radius: how far it may be from the mean of its neighbours'
NO_LAYER = "hair and points have no UV map and no attributes but radius and temperature"  # for users
NOT_FINITE = "a position or radius that is not finite"
NO_RADIUS = "no radius above 0"
_DTYPES = {"FLOAT": np.float32, "INT": np.int32, "INT8": np.int8, "BOOLEAN": np.bool_}  # of attributes
_CATMULL_ROM, _POLY, _BEZIER, _NURBS = range(4)  # values of the attribute `curve_type`

PixelSize = Callable[[np.ndarray], np.ndarray]  # size (n,) m of a pixel at (n, 3) points in world space


def read_strands(obj, warnings: Warnings) -> Strands | Points:
    """What an evaluated object of one of the STRAND_TYPES consists of."""
    return (read_curves if obj.type == "CURVES" else read_points)(obj.data, obj.name, warnings)


def read_particle_hair(obj, render: bool, warnings: Warnings) -> Strands:
    """All particle hair of an evaluated object, in its space. render: as in renders, or as in the viewport."""
    found = joined_strands([_read_system(obj, system, render) for system in path_systems(obj, render)])
    return _usable_strands(found, obj.name, warnings)


def detail(
    source: Strands | Points, matrix: np.ndarray, pixel_size: PixelSize | None
) -> tuple[object, np.ndarray | None]:
    """What is the same for instances that can share their triangles, as pixels are of about the same size there; and
    the size of a pixel at each hair or point, (c,), in the space of the object, None without a camera.

    matrix: (4, 4) object to world. pixel_size: None if no camera tells it.
    """
    scale = np.cbrt(abs(np.linalg.det(matrix[:3, :3])))
    at = source.points[source.first[:-1]] if isinstance(source, Strands) else source.position
    if pixel_size is None or not 0.0 < scale < np.inf or len(at) == 0:
        return None, None
    pixel = pixel_size(at @ matrix[:3, :3].T + matrix[:3, 3]) / scale
    level = int(np.floor(2.0 * np.log2(pixel.min())))
    size = 2.0 ** (0.5 * level)
    if pixel.max() < 3.0 * size:
        return level, np.full(len(pixel), size)
    return matrix.tobytes(), pixel


def triangles_of(source: Strands | Points, pixel: np.ndarray | None, owner: str) -> MeshData:
    """The triangles of hairs or points. pixel: see `detail`. Raises SceneError, naming the owner, if there
    is not enough memory to render them."""
    source, pixel = simplified(source, pixel)
    if isinstance(source, Points):
        levels = levels_of(source.radius, pixel)
        _check_memory(face_count(levels), f"{len(levels):,} points", owner)
        return solids(source, levels)
    sides, tolerance = sides_of(source.thickest, pixel), tolerances(source, pixel)
    strands = thinned(rounded(source, ROUNDING * tolerance), (1.0 - ROUNDING) * tolerance)
    if len(sides) > FEW:
        strands = shortened(strands, MOST_PIECES)
    _check_memory(triangle_count(strands, sides), f"{len(sides):,} hairs", owner)
    return prisms(strands, sides)


def simplified(source: Strands | Points, pixel: np.ndarray | None) -> tuple[Strands | Points, np.ndarray | None]:
    """Fewer hairs or points, and the size of a pixel at each, where a pixel holds many.

    Where they are narrower than WIDEST of a pixel, and there are more than FEW, a share of them is kept that is chosen
    as if at random, and they are made wider by as much, so that what all of them hide and emit stays the same on the
    average (Cook, Halstead, Planck and Ryu 2007). That supposes that they overlap at random. Hairs laid evenly would
    overlap more then, so of these the middle one of a whole number of neighbours is kept.
    """
    radius = source.thickest if isinstance(source, Strands) else source.radius
    count = len(radius)
    if pixel is None or count <= FEW:
        return source, pixel
    share = 2.0 * radius / (WIDEST * pixel)
    share = (share if isinstance(source, Strands) else share**2).clip(FEW / count, 1.0)
    even = _laid_evenly(source) if isinstance(source, Strands) else np.zeros(count, bool)
    share[even] = 1.0 / np.floor(1.0 / share[even] + _ROUNDED)
    times = _picks(share, even)
    wider = times / share
    if isinstance(source, Points):
        return replace(source, radius=source.radius * np.sqrt(wider)).part(times > 0), pixel[times > 0]
    source = replace(source, radius=source.radius * wider[source.owner])
    return source.kept_points((times > 0)[source.owner]), pixel[times > 0]


def _laid_evenly(strands: Strands) -> np.ndarray:
    """(c,) bool, which hairs are like the mean of their neighbours in the list, as in a row: they lie halfway between
    them, are of the same material, and about as warm and as thick as their mean. Where that is so, nothing alternates,
    and the middle one of several stands for all of them."""
    begin, end = strands.first[:-1], strands.first[1:] - 1
    at = np.stack((begin, (begin + end) // 2, end), axis=1)
    way, beside = _step_and_bend(strands.points[at].reshape(len(at), -1))
    even = np.linalg.norm(beside, axis=1) <= _EVEN * np.linalg.norm(way, axis=1)
    even &= (np.abs(_step_and_bend(strands.radius[at])[1]) <= _ALIKE * strands.radius[at][1:-1]).all(axis=1)
    if strands.temperature is not None:
        even &= (np.abs(_step_and_bend(strands.temperature[at])[1]) <= ALLOWED_KELVIN).all(axis=1)
    change = strands.slot[1:] != strands.slot[:-1]
    even &= ~(change[1:] | change[:-1])
    return np.pad(even, 1, mode="edge")  # the first and the last one have but one neighbour


def _step_and_bend(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of rows (n, m), but for the first and the last one: half of the way (n - 2, m) from the row before to the row
    behind, and the way from their mean."""
    before, behind = values[:-2], values[2:]
    return 0.5 * (behind - before), values[1:-1] - 0.5 * (before + behind)


def _picks(share: np.ndarray, even: np.ndarray) -> np.ndarray:
    """(n,) how often each thing is picked, share times on the average: one from each run of neighbours whose shares sum
    to 1, so that the picks spread evenly in any order. Those with a share of 1 are picked once.

    even: (n,) bool. The middle one is picked of a run of things that all are even, else any at random: in any other
    order every third, say, may be another kind of thing than the rest.
    """
    times, fewer = np.ones(len(share), np.int64), np.flatnonzero(share < 1.0)
    until = np.cumsum(share[fewer])
    runs = int(np.ceil(until[-1])) if len(fewer) else 0
    # the numbers of a RandomState are the same in all versions of NumPy
    place = np.random.RandomState(0).random_sample(runs)
    uneven = ~even[fewer]
    mixed = np.concatenate((until - share[fewer], until))[np.tile(uneven, 2)].astype(np.int64)  # ends in these runs
    place[np.setdiff1d(np.arange(runs), mixed)] = 0.5 + _ROUNDED  # of two in the middle always the second
    picked = np.searchsorted(until, np.arange(runs) + place, side="right")
    times[fewer] = np.bincount(picked, minlength=len(fewer) + 1)[: len(fewer)]
    return times


def _check_memory(count: int, of: str, owner: str) -> None:
    from ..solver.memory import check_memory, memory_of_triangles  # here, as it needs Numba

    check_memory({"geometry": memory_of_triangles(count)}, f"Object '{owner}' has {of}, {count:,} triangles: it alone")


# Curves and point clouds ----------------------------------------------------------------------------------------------


def read_curves(curves, owner: str, warnings: Warnings) -> Strands:
    """The hairs of a Curves data-block that can be rendered; warnings name the others."""
    if len(curves.points) == 0:
        return joined_strands([])
    first = read_values(curves.curve_offset_data, "value", np.int32).astype(np.int64)
    count, lengths = len(curves.curves), np.diff(first)
    strands = Strands(
        points=read_values(curves.attributes["position"].data, "vector", np.float32, 3).astype(np.float64),
        radius=_values(curves, "radius", len(curves.points), CURVES_RADIUS),
        first=first,
        slot=_values(curves, "material_index", count, 0).astype(np.int32),
        temperature=_temperatures(curves, owner, warnings, lengths),
    )
    kind = _values(curves, "curve_type", count, _CATMULL_ROM).astype(np.int64)
    if (kind == _NURBS).any():
        warnings.add(owner, "its NURBS curves are rendered as curves through their control points")
    given = [curves.attributes.get(name) for name in ("handle_left", "handle_right")]
    if None not in given:
        handles = [read_values(each.data, "vector", np.float32, 3) for each in given]
        strands = replace(strands, handles=np.stack(handles, axis=1).astype(np.float64))
    cyclic = _values(curves, "cyclic", count, 0).astype(bool) & (lengths > 1)
    strands = closed(strands, cyclic)
    handles, owners = catmull_rom_handles(strands, cyclic), strands.owner
    _straighten(handles, strands, (kind == _POLY)[owners])
    bezier = (kind == _BEZIER)[owners]
    if strands.handles is not None:
        handles[bezier] = strands.handles[bezier]
    return _usable_strands(replace(strands, handles=handles), owner, warnings)


def read_points(cloud, owner: str, warnings: Warnings) -> Points:
    """The points of a PointCloud data-block that can be rendered; warnings name the others."""
    count = len(cloud.points)
    if count == 0:
        return Points(np.empty((0, 3)), np.empty(0), np.empty(0, np.int32))
    points = Points(
        position=read_values(cloud.attributes["position"].data, "vector", np.float32, 3).astype(np.float64),
        radius=_values(cloud, "radius", count, POINT_RADIUS),
        slot=_values(cloud, "material_index", count, 0).astype(np.int32),
        temperature=_temperatures(cloud, owner, warnings, None),
    )
    finite = np.isfinite(points.position).all(axis=1) & np.isfinite(points.radius)
    _tell_of(finite, f"points have {NOT_FINITE}", owner, warnings)
    thick = points.radius > 0.0
    _tell_of(thick | ~finite, f"points have {NO_RADIUS}", owner, warnings)
    return points.part(finite & thick)


def _values(block, name: str, count: int, missing: float) -> np.ndarray:
    """(count,) float64 of an attribute; all `missing` if there is none of this name and number."""
    attribute = block.attributes.get(name)
    if attribute is None or attribute.data_type not in _DTYPES or len(attribute.data) != count:
        return np.full(count, float(missing))
    return read_values(attribute.data, "value", _DTYPES[attribute.data_type]).astype(np.float64)


def _temperatures(block, owner: str, warnings: Warnings, lengths: np.ndarray | None) -> np.ndarray | None:
    """(n,) float32 K of the attribute `temperature` at the points, None without one. lengths: points of each curve."""
    values = attribute_temperatures(block, owner)
    if values is None:
        if problem := attribute_problem(block):
            warnings.add(owner, problem)
        return None
    return values if block.attributes[NAME].domain == "POINT" else np.repeat(values, lengths)


def _straighten(handles: np.ndarray, strands: Strands, straight: np.ndarray) -> None:
    """Let hairs run straight between those points for which straight, (n,) bool, is true. handles: changed."""
    third = np.diff(strands.points, axis=0, append=strands.points[-1:]) / 3.0
    handles[straight, 1] = (strands.points + third)[straight]
    handles[straight, 0] = (strands.points - np.roll(third, 1, axis=0))[straight]


def _usable_strands(strands: Strands, owner: str, warnings: Warnings) -> Strands:
    """The hairs that can be rendered; warnings name the others. The owner: an object's name."""
    hair, count = strands.owner, len(strands.slot)
    with np.errstate(invalid="ignore"):
        values = strands.points.sum(axis=1) + strands.radius
        values = values if strands.handles is None else values + strands.handles.sum(axis=(1, 2))
    finite = np.bincount(hair[~np.isfinite(values)], minlength=count) == 0
    thick = np.bincount(hair[strands.radius > 0.0], minlength=count) > 0
    apart = np.ones(len(hair), bool)
    apart[1:] = (strands.points[1:] != strands.points[:-1]).any(axis=1)
    apart[np.minimum(strands.first[:-1], max(len(hair) - 1, 0))] = True
    long_ = np.bincount(hair[apart], minlength=count) >= 2
    _tell_of(finite, f"hairs have {NOT_FINITE}", owner, warnings)
    _tell_of(long_ | ~finite, "hairs have fewer than two points that lie apart", owner, warnings)
    _tell_of(thick | ~finite | ~long_, f"hairs have {NO_RADIUS}", owner, warnings)
    kept = strands.kept_points((finite & thick & long_)[hair] & apart)
    return replace(kept, radius=np.maximum(kept.radius, 0.0))


def _tell_of(usable: np.ndarray, what: str, owner: str, warnings: Warnings) -> None:
    """Warn of those of n things that are not usable, (n,) bool."""
    wrong = np.flatnonzero(~usable)
    if len(wrong):
        warnings.add(owner, f"{len(wrong):,} of {len(usable):,} {what} (the first is {wrong[0]}) and are left out")


# Particle hair --------------------------------------------------------------------------------------------------------


def path_systems(obj, render: bool) -> Iterator:
    """The particle systems of an evaluated object that are shown as hair, in renders or in the viewport."""
    for modifier in obj.modifiers:
        if modifier.type == "PARTICLE_SYSTEM" and (modifier.show_render if render else modifier.show_viewport):
            settings = modifier.particle_system.settings
            if settings.type == "HAIR" and settings.render_type == "PATH":
                yield modifier.particle_system


def _read_system(obj, system, render: bool) -> Strands:
    """The hairs of a particle system: its children, or the particles themselves where it has none."""
    settings, particles, children = system.settings, len(system.particles), len(system.child_particles)
    if not render:
        children = int(children * settings.display_percentage / 100.0)
    has_children = settings.child_type != "NONE" and children > 0
    begin, count = (particles, children) if has_children else (0, particles)
    steps = 2 ** (settings.render_step if render else settings.display_step) + 1
    steps += settings.kink_extra_steps if settings.kink == "SPIRAL" else 0
    co = system.co_hair  # Blender tells but one point at a time: about 1.5 us each
    calls = (co(obj, particle_no=hair, step=step) for hair in range(begin, begin + count) for step in range(steps))
    world = np.fromiter(chain.from_iterable(calls), np.float64, 3 * count * steps).reshape(-1, 3)
    matrix = np.array(obj.matrix_world, dtype=np.float64)
    points = (world - matrix[:3, 3]) @ np.linalg.pinv(matrix[:3, :3]).T
    strands = Strands(
        points,
        np.ones(len(points)),
        np.arange(0, len(points) + 1, steps),
        np.full(count, settings.material - 1, np.int32),
    )
    return _tapered(strands.kept_points(_reached(world, steps)), settings)


def _reached(world: np.ndarray, steps: int) -> np.ndarray:
    """(n,) bool, which points hairs have: of shorter ones Blender tells zeros beyond their end."""
    known = world.any(axis=1).reshape(-1, steps)
    return (np.cumsum(known[:, ::-1], axis=1)[:, ::-1] > 0).ravel()


def _tapered(strands: Strands, settings) -> Strands:
    """Particle hair with the radii that its settings give it, from root to tip, as in Cycles; and its curves."""
    length = np.zeros(len(strands.points))
    length[1:] = np.linalg.norm(np.diff(strands.points, axis=0), axis=1)
    length[strands.first[:-1]] = 0.0
    way = np.cumsum(length)
    way -= way[strands.first[:-1]][strands.owner]
    whole = way[strands.first[1:] - 1][strands.owner]
    share = 1.0 - way / np.where(whole > 0.0, whole, 1.0)
    shape = settings.shape
    share **= 1.0 + shape if shape < 0.0 else 1.0 / max(1.0 - shape, 1e-6)
    root, tip = (0.5 * settings.radius_scale * each for each in (settings.root_radius, settings.tip_radius))
    radius = share * (root - tip) + tip
    if settings.use_close_tip:
        radius[strands.first[1:] - 1] = 0.0
    return replace(strands, radius=radius, handles=catmull_rom_handles(strands))
