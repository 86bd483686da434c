# SPDX-License-Identifier: GPL-3.0-or-later
"""Merge films of different passes of a render into its images. Works without Blender:

    python -m addon.merge a.npz b.npz ... --output out_####.exr

Films may come in any order, of several frames and view layers. They are refused if they are of different renders, if
two hold the same pass, or if passes between them are missing; the message lists these.
"""

from __future__ import annotations

import argparse
import glob
import math
import sys
from collections.abc import Sequence
from functools import reduce
from itertools import chain, product
from pathlib import Path

import numpy as np

from .output.description import CORRECTION_FACTS
from .output.formats import FORMATS, clash, layer_suffixes, numbered, replaced, without_extension, write_file
from .pass_ranges import read_passes
from .solver import layered_image
from .solver.checkpoint import CheckpointError, StoredFilm, differences, read, save, told_ranges
from .solver.image.film import Film
from .solver.physics.correction import Correction

WITHOUT_GROUPS = "the films have no temperature groups"
LEAST_TARGET = 1e-6  # K; a float32 does not tell temperatures any finer


class MergeError(ValueError):
    """Films cannot be merged; the message names the files and says why."""


def merged(films: dict[Path, StoredFilm], wanted: range | None = None, partial: bool = False) -> StoredFilm:
    """The film of the passes of all films of one frame and view layer. wanted: the passes that there should be;
    without, all before the last. partial: whether passes may be missing.

    The result equals that of one machine but for the rounding of float64, its noise included: see Film.merge. Raises
    MergeError.
    """
    (first, known), *others = films.items()
    correction = _correction(known)
    for path, stored in others:
        if different := differences(known.marks, stored.marks):
            raise MergeError(f"'{first}' and '{path}' are of different renders: {different} differ")
        if different := _differently_corrected(correction, _correction(stored)):
            raise MergeError(f"'{first}' and '{path}' have temperatures that are corrected differently: {different}")
    in_order = sorted(films.items(), key=lambda item: item[1].film.ranges)
    try:
        film = reduce(Film.merge, (stored.film for _, stored in in_order))
    except ValueError as error:
        listed = ", ".join(f"'{path}' has {told_ranges(stored.film)}" for path, stored in in_order)
        raise MergeError(f"{error}: {listed}") from error
    missing = missing_passes(film, wanted)
    if missing and not partial:
        raise MergeError(f"{told_ranges(film)[:1].upper()}{told_ranges(film)[1:]} are there; missing are {missing}")
    film.correction = correction
    return StoredFilm(film, known.marks, _about(known.about, film))


def _correction(stored: StoredFilm) -> Correction:
    return Correction(**stored.about.get("correction", {}))


def _differently_corrected(one: Correction, other: Correction) -> str:
    """What differs between two corrections, with its values; an empty text if nothing does."""
    pairs = ((fact, getattr(one, field), getattr(other, field)) for fact, field in CORRECTION_FACTS.items())
    return ", ".join(f"{fact} {mine:.9g} and {others:.9g}" for fact, mine, others in pairs if mine != others)


def missing_passes(film: Film, wanted: range | None = None) -> str:
    """The wanted passes that a film does not hold, in words, such as '10 to 14 and 20'; an empty text if none is
    missing. Without wanted ones, of those before the last."""
    gaps, end = [], 0 if wanted is None else wanted.start
    last = film.ranges[-1][2] if wanted is None else wanted.stop
    for first, stop in [*(each[1:] for each in film.ranges), (last, last)]:
        first = min(first, last)
        if first > end:
            gaps.append(f"{end} to {first - 1}" if first > end + 1 else f"{end}")
        end = max(end, stop)
    return " and ".join(gaps)


def passes_needed(film: Film, target: float) -> int:
    """How many more passes a film needs until 95 % of its pixels have a noise below a target, K; 0 if they have. The
    error is taken to fall with the root of the number of passes. A single pass tells no noise: that needs one more."""
    if film.passes < 2:
        return 1
    noise = float(np.percentile(film.noise(), 95))
    return max(0, math.ceil(film.passes * ((noise / target) ** 2 - 1.0)))


def images_of(stored: StoredFilm) -> dict[str, object]:
    """The fields of output.frame.FrameImages of a film."""
    film = stored.film
    return {
        "bands": list(film.bands()),
        "band_edges": film.band_edges,
        "radiance": film.radiance(),
        "temperature": film.temperature(),
        "noise": film.noise(),
        "metadata": {**stored.about.get("facts", {}), "frame": stored.about.get("frame", 1)},
    }


def _about(about: dict, film: Film) -> dict:
    """The facts about a merged film, from those of one of its parts."""
    facts = about.get("facts", {})
    return {**about, "facts": {**facts, "passes": film.passes, "firstPass": film.ranges[0][1], "photons": film.photons}}


def by_image(films: dict[Path, StoredFilm]) -> dict[tuple[int, str], dict[Path, StoredFilm]]:
    """Films by frame and view layer."""
    found = {}
    for path, stored in films.items():
        key = int(stored.about.get("frame", 1)), str(stored.about.get("layer", ""))
        found.setdefault(key, {})[path] = stored
    return dict(sorted(found.items()))


def read_films(patterns: Sequence[str]) -> dict[Path, StoredFilm]:
    """The films of files, whose names may have wildcards. Raises CheckpointError, or MergeError if there are none."""
    paths = [Path(name) for pattern in patterns for name in (sorted(glob.glob(pattern)) or [pattern])]
    if not paths:
        raise MergeError("No film is given")
    return {path: read(path) for path in dict.fromkeys(paths)}


def parser() -> argparse.ArgumentParser:
    """Of the command's arguments."""
    result = argparse.ArgumentParser("addon.merge", description=__doc__.partition("\n")[0])
    result.add_argument("films", nargs="+", help="files of films; wildcards may be used")
    result.add_argument("--output", help="file of the images; '####' is the frame number")
    result.add_argument("--format", default="BAND_EXR", choices=FORMATS, help="of the images")
    result.add_argument("--groups", help="EXR file of the temperature groups, if the films have any")
    result.add_argument("--film", help="file of the merged film, to be merged with further passes")
    result.add_argument("--target-noise", type=float, default=0.0, help="K; says how many more passes it takes")
    result.add_argument("--passes", type=read_passes, help="those that there should be, such as 0-39")
    result.add_argument("--partial", action="store_true", help="merge though passes between the films are missing")
    return result


def main(arguments: Sequence[str] | None = None) -> int:
    """Merge films; returns the exit code: 0, 1 if they cannot be merged, 2 if the noise is above the target."""
    options = parser().parse_args(arguments)
    if not (options.output or options.groups or options.film):
        parser().error("nothing to write: give --output, --groups or --film")
    if options.target_noise != 0.0 and not LEAST_TARGET <= options.target_noise < math.inf:
        parser().error(f"--target-noise is {options.target_noise:g} K, expected 0 or at least {LEAST_TARGET:g}")
    try:
        images = by_image(read_films(options.films))
        _check_targets(options, images)
        needed = [_write(options, key, films, images) for key, films in images.items()]
    except (CheckpointError, MergeError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        return 1
    return 2 if any(needed) else 0


def _path(text: str, ending: str, key: tuple[int, str], images) -> Path:
    """The file that an option names, of one frame and view layer among all images."""
    (frame, layer), several = key, len({frame for frame, _ in images}) > 1
    suffix = layer_suffixes(sorted({layer for _, layer in images}))[layer]
    return numbered(without_extension(text, {Path(ending).suffix, ending}), ending, frame, several, suffix)


def _check_targets(options, images) -> None:
    """Raise MergeError if two options name the same file, or if a merged film would replace one that is read: passes
    could then not be merged in another way again. All are looked at before the first is written."""
    endings = {"output": FORMATS[options.format].ending, "groups": ".exr", "film": ".npz"}
    pairs = product((name for name in endings if getattr(options, name)), images)
    both = clash((name, _path(getattr(options, name), endings[name], key, images)) for name, key in pairs)
    if both:
        raise MergeError(f"Two options would both write '{both[2]}'; give --{both[1]} another path")
    targets = (_path(options.film, ".npz", key, images) for key in images if options.film)
    if source := replaced(targets, chain.from_iterable(images.values())):
        raise MergeError(f"'{source}' is read, and would be replaced: --film names another")


def _write(options, key: tuple[int, str], films: dict[Path, StoredFilm], images) -> int:
    """Write the images of one frame and view layer; returns how many more passes they need."""
    frame, layer = key
    stored, name = merged(films, options.passes, options.partial), f"Frame {frame}" + (f", {layer}" if layer else "")
    if options.output:
        path = _path(options.output, FORMATS[options.format].ending, key, images)
        write_file(options.format, path, images_of(stored))
    if options.groups and len(stored.film.layers) > 1:
        from .output.group_exr import write_group_exr  # here, as not all merges need OpenEXR

        write_group_exr(
            _path(options.groups, ".exr", key, images), layered_image(stored.film), images_of(stored)["metadata"]
        )
    elif options.groups:
        if not (options.output or options.film):
            raise MergeError(f"{name}: {WITHOUT_GROUPS}, so there is nothing to write")
        print(f"Warning: {name}: {WITHOUT_GROUPS}; no file of them is written", file=sys.stderr)
    if options.film:
        save(_path(options.film, ".npz", key, images), stored.film, stored.marks, stored.about, "the film")
    needed = passes_needed(stored.film, options.target_noise) if options.target_noise else 0
    print(f"{name}: {_told(stored.film, len(films), needed, options.target_noise)}")
    return needed


def _told(film: Film, films: int, needed: int, target: float) -> str:
    """What users read of a merged film. films: how many it was merged from. needed, target: see passes_needed."""
    if film.passes < 2:
        more = f"; more passes are needed to tell whether it is below {target:g} K" if needed else ""
        return f"a single pass, whose noise is not known{more}"
    more = f"; {needed} more passes are needed for {target:g} K" if needed else ""
    return f"{film.passes} passes of {films} films, noise {float(np.percentile(film.noise(), 95)):.3g} K{more}"


if __name__ == "__main__":
    sys.exit(main())
