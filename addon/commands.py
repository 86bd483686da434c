# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands of Blender without a window: `blender -b x.blend --command NAME ...`.

infrared_passes: render some passes of a frame into a film, to be merged with others.
infrared_merge: merge films, see merge.
infrared_pairs: render frames by this engine and by Cycles or EEVEE, with labels, see pairs.
infrared_recombine: a finished render at other temperatures of its groups, see ui.temperatures.temperature_groups.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import bpy

from .interface import ENGINE
from .pairs.command import main as pairs
from .pass_ranges import read_passes
from .ui.temperatures.temperature_groups import recombine_by_command

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


COMMANDS = {
    "infrared_passes": render_passes,
    "infrared_merge": merge,
    "infrared_pairs": pairs,
    "infrared_recombine": recombine_by_command,
}


def register():
    if not {"-c", "--command"} & set(sys.argv):
        return  # nobody can ask for them; and with more than four commands Blender 4.5 speaks of a leak when it ends
    for name, command in COMMANDS.items():
        _handles.append(bpy.utils.register_cli_command(name, command))


def unregister():
    while _handles:
        bpy.utils.unregister_cli_command(_handles.pop())
