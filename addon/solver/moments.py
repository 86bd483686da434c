# SPDX-License-Identifier: GPL-3.0-or-later
"""Moments: one picture of a scene that moves while the picture is taken.

A detector adds up what it sees over a stretch of time. Passes are spread over it: each pass sees the scene at one of m
times, and the mean of the passes is the mean over time. A shutter that is open from a to b weighs all times between
alike. A bolometer with the time constant tau follows its radiance L as tau dS/dt = L - S does, so at the time t

    S(t) = integral over s > 0 of  L(t - s) exp(-s / tau) / tau:

times of the past count by an exponential, and of both together by the convolution of the two. The distribution is cut
into m parts of equal weight, and the time in the middle of each is a moment. So passes that are spread evenly over the
moments need no weights.
"""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass, replace

import numpy as np

from .physics.layers import scene_layers, to_json
from .sampling.low_discrepancy import scrambled
from .sampling.rng import ALL_PASSES, MOMENTS, pass_key
from .scene import Change, Moment, Scene, SceneError
from .system.kernels import KERNEL, njit

_DIMENSION = 4  # of the Sobol' sequence; camera rays take the others, so that times and places in a pixel do not agree
_HALVINGS = 60  # until float64 tells two times apart no more
# Cosines of the time that passes are compared with, see waves. After 20 to 64 passes the true error in the scenes of
# test_noise_is_not_below_the_error (tests/test_moments.py) is 0.4 to 0.9 of the stated one with 4, and 0.2 to 0.5
# without; with 2 it is further from 1 in most, with 6 up to 1.1.
_WAVES = 4


def moment_times(opened: float, closed: float, lag: float, count: int) -> np.ndarray:
    """(count,) float64 ascending times of the moments, in the unit of the arguments.

    opened, closed: when the shutter opens and closes, closed >= opened. lag: time constant of the detector, 0 or more.
    """
    share = (np.arange(count) + 0.5) / count
    if lag == 0.0:
        return opened + share * (closed - opened)
    # before 1 / 2m of the distribution there is no moment, and no more than exp(-s / lag) of it is older than s
    low, high = np.full(count, opened - lag * math.log(4.0 * count)), np.full(count, closed)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = weight_before(middle, opened, closed, lag) < share
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def weight_before(time: np.ndarray, opened: float, closed: float, lag: float) -> np.ndarray:
    """The share, 0 to 1, that all before `time` (n,), at most closed, has in a picture. Arguments as of moment_times,
    lag > 0.

    What the detector sees at a time s adds to all that it shows from s on. So this is the mean of
    min(1, exp((time - s) / lag)) over the times s at which the shutter is open.
    """
    if closed == opened:
        return np.exp((time - closed) / lag)
    first = np.maximum(time, opened)
    later = lag * (np.exp((time - first) / lag) - np.exp((time - closed) / lag))
    return (first - opened + later) / (closed - opened)


def step_of(index: int, seed: int, count: int) -> int:
    """Which of `count` moments pass `index` sees. Of passes from 0 on, as well as of any others one after the other,
    about as many see each; of 2^k moments 2^k passes see each once."""
    key = pass_key(seed, ALL_PASSES, MOMENTS)
    return int(_share_of_pass(np.int64(index & 0xFFFFFFFF), key) * count)


def wave_count(moments: int) -> int:
    """How many numbers `waves` gives for a pass."""
    return max(0, min(_WAVES, moments - 1))


def waves(step: int, moments: int) -> np.ndarray:
    """(w,) cosines of the time of a moment, of half a period over all of them, of one, and so on. Over all moments
    the mean of each is 0. What pixels show of a motion mostly follows the slowest of them."""
    return np.cos(math.pi * np.arange(1, wave_count(moments) + 1) * (step + 0.5) / moments)


@njit(**KERNEL)
def _share_of_pass(index, key):
    return scrambled(index, key, _DIMENSION)


# Storing --------------------------------------------------------------------------------------------------------------


def moment_of(scene: Scene, base: Scene) -> Moment:
    """What is otherwise in a scene than in the scene that planning sees, base: nothing else is kept.

    Raises SceneError if the two cannot be of one picture: if they differ in the picture's size, or if the temperature
    of a group changes, as the image can show it at one temperature only.
    """
    size, wanted = ((each.camera.width, each.camera.height, each.camera.pixels) for each in (scene, base))
    if size != wanted or not np.array_equal(scene.band_edges, base.band_edges):
        raise SceneError("The size of the picture or its bands change while it is taken")
    if (scene.groups or base.groups) and to_json(scene_layers(scene)[0]) != to_json(scene_layers(base)[0]):
        raise SceneError(
            f"Temperature groups ({', '.join(base.groups)}): a temperature, or what belongs to a group, changes while "
            "the picture is taken; a group keeps its temperature, so switch off motion blur or the file of the groups"
        )
    names = [field.name for field in fields(scene) if field.name != "moments"]
    pairs = ((name, getattr(scene, name), getattr(base, name)) for name in names)
    return tuple(_change(name, value, before) for name, value, before in pairs if not _same(value, before))


def at_moment(base: Scene, moment: Moment) -> Scene:
    """The scene at a moment."""
    return replace(base, moments=(), **{each.part: _changed(getattr(base, each.part), each) for each in moment})


def bytes_of(moment: Moment) -> float:
    """Bytes that the arrays of a moment take."""
    arrays = (array for change in moment for array in (change.rows, change.values) if isinstance(array, np.ndarray))
    return float(sum(array.nbytes for array in arrays))


def _change(part: str, value, before) -> Change:
    arrays = isinstance(value, np.ndarray) and isinstance(before, np.ndarray)
    if arrays and (value.shape, value.dtype) == (before.shape, before.dtype):
        rows = np.flatnonzero((value != before).reshape(len(value), -1).any(axis=1))
        if 2 * len(rows) < len(value):
            return Change(part, rows, value[rows])
    return Change(part, None, _sharing(value, before))


def _changed(before, change: Change):
    if change.rows is None:
        return change.values
    value = before.copy()
    value[change.rows] = change.values
    return value


def _sharing(value, before):
    """A value like this one, that has what equals it of an earlier one in common with that."""
    if _same(value, before):
        return before
    if type(value) is tuple and type(before) is tuple and len(value) == len(before):
        return tuple(map(_sharing, value, before))
    return value


def _same(value, other) -> bool:
    """Whether two fields of scenes, or parts of them, are equal."""
    if value is other or type(value) is not type(other):
        return value is other
    if isinstance(value, np.ndarray):
        return value.dtype == other.dtype and np.array_equal(value, other)
    if is_dataclass(value):
        return all(_same(getattr(value, each.name), getattr(other, each.name)) for each in fields(value))
    if isinstance(value, dict):
        return value.keys() == other.keys() and all(_same(each, other[name]) for name, each in value.items())
    if isinstance(value, tuple | list):
        return len(value) == len(other) and all(map(_same, value, other))
    return value == other
