# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands of Blender without a window: `blender -b x.blend --command NAME ...`.

infrared_passes: render some passes of a frame into a film, to be merged with others.
infrared_merge: merge films, see merge.
infrared_pairs: render frames by this engine and by Cycles or EEVEE, with labels, see pairs.
infrared_recombine: a finished render at other temperatures of its groups, see ui.temperatures.temperature_groups.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

import bpy

from .interface import ENGINE
from .kept import Kept
from .pairs.command import main as pairs
from .pass_ranges import read_passes
from .rendering.last_render import finished_layers, forget_last_render
from .rendering.render_files import film_path, picture_suffixes
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
    """Render passes of the open file's scene into a film, and nothing else; returns the exit code. The scene is as
    before when this ends."""
    options, scene = passes_parser().parse_args(arguments), bpy.context.scene
    if not os.path.basename(options.film):
        passes_parser().error(f"--film is the folder '{options.film}', expected a file")
    if scene.render.engine != ENGINE:
        print(f"Error: Scene '{scene.name}' renders with '{scene.render.engine}', not {ENGINE}", file=sys.stderr)
        return 1
    frame, subframe = scene.frame_current, scene.frame_subframe
    if options.frame is not None:
        scene.frame_set(options.frame)
    forget_last_render()
    try:
        with Kept() as kept:
            _choose_passes(scene, options, kept)
            bpy.ops.render.render()
            problem = _film_problem(scene, options.passes)
    except RuntimeError as error:  # what a render reports
        print(error, file=sys.stderr)
        return 1
    finally:
        scene.frame_set(frame, subframe=subframe)
    if problem:
        print(f"Error: {problem}", file=sys.stderr)
    return 1 if problem else 0


def _choose_passes(scene, options, kept: Kept) -> None:
    """Let the next render be of the passes of the options, into their film and into no other file."""
    infrared, path = scene.infrared, Path(options.film).resolve()
    # Strips would be rendered in place of the scene, and nodes may write files and render other scenes.
    kept.set(scene.render, use_sequencer=False, use_compositing=False, use_single_layer=False)
    kept.set(infrared, pass_offset=options.passes.start, passes=len(options.passes), time_limit=0.0, target_noise=0.0)
    kept.set(infrared, film_path=str(path), checkpoint_path="", band_exr_path="", label_path="")
    if infrared.group_exr_path:  # groups are kept apart only if they have a file
        kept.set(infrared, group_exr_path=str(path.with_name(f"{path.stem}_groups.exr")))
    if options.threads is not None:
        kept.set(infrared, threads=options.threads)


def _film_problem(scene, passes: range) -> str:
    """Why the films of a render that has ended are not those of the passes, or an empty text."""
    paths = [film_path(scene, suffix, False) for suffix in picture_suffixes(scene)]
    if not paths:
        return f"Scene '{scene.name}' has no view layer that is rendered, so there is no film"
    for path, images in zip_longest(paths, finished_layers.values()):
        if images is None or not path.is_file():
            return f"The render has ended without the film '{path}'"
        count = images["metadata"]["passes"]
        if count != len(passes):
            held = f"passes {passes.start} to {passes.start + count - 1}"
            return f"'{path}' holds {held}, asked for are {passes.start} to {passes.stop - 1}: choose another file"
    return ""


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
