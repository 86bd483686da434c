# SPDX-License-Identifier: GPL-3.0-or-later
"""The command infrared_pairs: its arguments, and what it does with the open file's scene."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy

from ..output.png import KelvinScale
from ..pass_ranges import read_frames
from ..solver.scene import SceneError
from .frames import RGB_ENGINES, PairOptions, render_pairs


def argument_parser() -> argparse.ArgumentParser:
    """Of the arguments of infrared_pairs."""
    parser = argparse.ArgumentParser("infrared_pairs", description="Render pairs of RGB and thermal pictures")
    parser.add_argument("--output", required=True, help="folder of the pairs; frames that it has are kept")
    parser.add_argument("--frames", type=read_frames, help="first and last one, such as 1-100; without it the scene's")
    parser.add_argument("--rgb", default="cycles", choices=RGB_ENGINES, help="engine of the RGB pictures")
    parser.add_argument("--samples", type=_positive(int), help="of the RGB pictures; without it the scene's")
    parser.add_argument("--randomize", help="JSON or YAML file of what is drawn for each frame, and within what ranges")
    parser.add_argument("--seed", type=_at_least_0, default=0, help="of all that is drawn, and of the renders")
    parser.add_argument("--offset", type=_finite, default=0.0, help="K that 0 means in the 16-bit pictures")
    parser.add_argument("--step", type=_positive(float), default=0.01, help="K between two of their values")
    parser.add_argument("--kitti", action="store_true", help="write labels as KITTI's text, too")
    return parser


def _positive(kind: Callable) -> Callable:
    """A function that reads a number above 0 of a kind: int or float."""

    def read(text: str):
        value = kind(text)
        if not 0 < value < math.inf:
            raise argparse.ArgumentTypeError(f"{text} is not above 0")
        return value

    read.__name__ = kind.__name__  # in argparse's message about what is no number
    return read


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not finite")
    return value


_finite.__name__ = "float"  # in argparse's message, likewise


def _at_least_0(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is below 0")
    return value


def main(arguments: Sequence[str]) -> int:
    """Render pairs of the open file's scene; returns the exit code."""
    options, scene = argument_parser().parse_args(arguments), bpy.context.scene
    frames = options.frames or range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
    wanted = PairOptions(
        Path(options.output).resolve(),
        frames,
        options.rgb,
        options.samples,
        options.seed,
        Path(options.randomize) if options.randomize else None,
        KelvinScale(options.offset, options.step),
        options.kitti,
    )
    try:
        count = render_pairs(scene, wanted)
    except (SceneError, OSError, RuntimeError) as error:
        print(f"Error: {str(error).removeprefix('Error: ').strip()}", file=sys.stderr)
        return 1
    print(f"{count} frames are complete in {wanted.folder}")
    return 0
