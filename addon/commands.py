# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands of Blender without a window: `blender -b x.blend --command NAME ...`.

infrared_passes: render some passes of a frame into a film, to be merged with others.
infrared_merge: merge films, see merge.
infrared_pairs: render frames by this engine and by Cycles or EEVEE, with labels, see pairs.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy

from .interface import ENGINE
from .output.png import KelvinScale
from .pairs.frames import RGB_ENGINES, PairOptions, render_pairs
from .pass_ranges import read_frames, read_passes
from .solver.scene import SceneError

_handles = []  # of registered commands


def passes_parser() -> argparse.ArgumentParser:
    """Of the arguments of infrared_passes."""
    parser = argparse.ArgumentParser("infrared_passes", description="Render some passes of a frame into a film")
    parser.add_argument("--frame", type=int, help="of the scene; without it the current one")
    parser.add_argument("--passes", type=read_passes, required=True, help="first and last one, such as 10-19")
    parser.add_argument("--film", required=True, help="file of the film; a film of these passes is kept as it is")
    parser.add_argument("--threads", type=int, help="0 takes all cores")
    return parser


def render_passes(arguments: Sequence[str]) -> int:
    """Render passes of the open file's scene into a film, and nothing else; returns the exit code."""
    options, scene = passes_parser().parse_args(arguments), bpy.context.scene
    if scene.render.engine != ENGINE:
        print(f"Error: Scene '{scene.name}' renders with '{scene.render.engine}', not {ENGINE}", file=sys.stderr)
        return 1
    if options.frame is not None:
        scene.frame_set(options.frame)
    infrared, path = scene.infrared, Path(options.film).resolve()
    infrared.pass_offset, infrared.passes = options.passes.start, len(options.passes)
    infrared.time_limit = infrared.target_noise = 0.0
    infrared.film_path, infrared.checkpoint_path, infrared.band_exr_path = str(path), "", ""
    if infrared.group_exr_path:  # groups are kept apart only if they have a file
        infrared.group_exr_path = str(path.with_name(f"{path.stem}_groups.exr"))
    if options.threads is not None:
        infrared.threads = options.threads
    try:
        bpy.ops.render.render()
    except RuntimeError as error:  # what a render reports
        print(error, file=sys.stderr)
        return 1
    return 0


def merge(arguments: Sequence[str]) -> int:
    """As `python -m addon.merge`."""
    from .merge import main  # here, as it loads the solver

    return main(arguments)


def pairs_parser() -> argparse.ArgumentParser:
    """Of the arguments of infrared_pairs."""
    parser = argparse.ArgumentParser("infrared_pairs", description="Render pairs of RGB and thermal pictures")
    parser.add_argument("--output", required=True, help="folder of the pairs; frames that it has are kept")
    parser.add_argument("--frames", type=read_frames, help="first and last one, such as 1-100; without it the scene's")
    parser.add_argument("--rgb", default="cycles", choices=RGB_ENGINES, help="engine of the RGB pictures")
    parser.add_argument("--samples", type=_positive(int), help="of the RGB pictures; without it the scene's")
    parser.add_argument("--randomize", help="JSON or YAML file of what is drawn for each frame, and within what ranges")
    parser.add_argument("--seed", type=_at_least_0, default=0, help="of all that is drawn, and of the renders")
    parser.add_argument("--offset", type=float, default=0.0, help="K that 0 means in the 16-bit pictures")
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


def _at_least_0(text: str) -> int:
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is below 0")
    return value


def pairs(arguments: Sequence[str]) -> int:
    """Render pairs of the open file's scene; returns the exit code."""
    options, scene = pairs_parser().parse_args(arguments), bpy.context.scene
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


def register():
    if not {"-c", "--command"} & set(sys.argv):
        return  # nobody can ask for them; and with more than four commands Blender 4.5 speaks of a leak when it ends
    commands = {"infrared_passes": render_passes, "infrared_merge": merge, "infrared_pairs": pairs}
    for name, command in commands.items():
        _handles.append(bpy.utils.register_cli_command(name, command))


def unregister():
    while _handles:
        bpy.utils.unregister_cli_command(_handles.pop())
