# SPDX-License-Identifier: GPL-3.0-or-later
"""The finished passes of a render in a file: a checkpoint, from which a render that was killed goes on, or a film that
is kept, to be extended or merged with those of other machines.

A pass depends on the scene, the settings and its index alone, so the film is all that has to be kept. With the film the
file holds a fingerprint of all that the image depends on, so that passes of another scene are not mixed in, and facts
about the render. The file is a NumPy archive.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import logging
import os
import time
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .image.film import Film
from .passes import render
from .physics.correction import Correction
from .scene import Scene
from .settings import Settings
from .system.files import check_writable, replacing
from .system.kernel_cache import source_digest

log = logging.getLogger(__name__)

# settings that change no pass: which ones, when to stop, how fast to go, and what is made of the finished image
_NO_PASS = {"passes", "pass_offset", "time_limit", "target_noise", "threads"}
_NO_PASS |= {"assumed_emissivity", *Correction._fields[1:]}
_WHAT = "the checkpoint"


class CheckpointError(ValueError):
    """The passes in a file cannot be used; the message names the file and what is wrong."""


class StoredFilm(NamedTuple):
    """A film in a file. marks: the fingerprint. about: facts about the render, by name; none of a checkpoint."""

    film: Film
    marks: dict[str, str]
    about: dict


def fingerprint(scene: Scene, settings: Settings) -> dict[str, str]:
    """All that a pass depends on, by name: digests of the scene's parts, settings, and the version of the solver."""
    parts = {field.name: _digest(getattr(scene, field.name)) for field in fields(scene)}
    names = [field.name for field in fields(settings) if field.name not in _NO_PASS]
    return {"engine": source_digest()} | parts | {name: repr(getattr(settings, name)) for name in names}


def _digest(value) -> str:
    """Hash of a dataclass, tuple, array or plain value, the same in every process. Names do not count."""
    if is_dataclass(value):
        value = (type(value).__name__, *(getattr(value, field.name) for field in fields(value) if field.name != "name"))
    if isinstance(value, tuple | list):
        content = " ".join(_digest(item) for item in value).encode()
    elif isinstance(value, np.ndarray):
        content = f"{value.dtype.str} {value.shape} ".encode() + np.ascontiguousarray(value).tobytes()
    else:
        content = repr(value.item() if isinstance(value, np.generic) else value).encode()
    return hashlib.sha256(content).hexdigest()


def save(path: Path, film: Film, marks: dict[str, str], about: Mapping | None = None, what: str = _WHAT) -> None:
    """Write a film; an older file stays until the new one is complete. marks: the fingerprint. about: see StoredFilm,
    of plain values. what: name, in messages, of the file.

    Raises OSError naming the path if it cannot be written.
    """
    texts = {"fingerprint": np.array(json.dumps(marks)), "about": np.array(json.dumps(dict(about or {})))}
    arrays = texts | film.state()
    with replacing(path, what) as unfinished, open(unfinished, "wb") as file:
        with zipfile.ZipFile(file, "w") as archive:  # np.savez leaves the archive open if a write fails
            for name, array in arrays.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                    np.save(entry, array, allow_pickle=False)
        file.flush()
        os.fsync(file.fileno())  # before it replaces the older file: the power may fail


def read(path: Path) -> StoredFilm:
    """The film in a file. Raises CheckpointError if the file is damaged."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            marks = json.loads(str(stored["fingerprint"]))
            about = json.loads(str(stored["about"])) if "about" in stored.files else {}
            film = Film.from_state({name: stored[name] for name in stored.files})
        return StoredFilm(film, dict(marks), dict(about))
    except Exception as error:  # whatever the readers of archives, arrays and text meet in a damaged file
        raise CheckpointError(f"'{path}' is no checkpoint, or a damaged one: {error}") from error


def differences(marks: dict[str, str], others: dict[str, str]) -> str:
    """Names of what differs between two fingerprints, in order; an empty text if nothing does."""
    return ", ".join(sorted({name for name, _ in marks.items() ^ others.items()}))


def load(path: Path, scene: Scene, settings: Settings) -> Film:
    """The first passes of a render. Raises CheckpointError if the file is damaged or of another render."""
    film, marks, _ = read(path)
    if different := differences(marks, fingerprint(scene, settings)):
        raise CheckpointError(f"The checkpoint '{path}' is of another render: {different} differ")
    if len(film.ranges) > 1 or film.ranges[0][1] != settings.pass_offset:
        raise CheckpointError(f"'{path}' does not hold the first passes of this render, but {told_ranges(film)}")
    film.correction = settings.correction  # it changes no pass, so it may differ from the saved one
    return film


def told_ranges(film: Film) -> str:
    """The passes of a film in words, such as 'passes 0 to 9 and 20 to 24'."""
    ranges = [f"{first} to {stop - 1}" for _, first, stop in film.ranges if first < stop]
    return f"passes {' and '.join(ranges)}" if ranges else "no passes"


def set_aside(path: Path) -> Path:
    """Rename a file that is in the way to a new name, which is returned. Raises OSError if that fails."""
    names = (path.with_name(f"{path.stem}.old{number}{path.suffix}") for number in itertools.count(1))
    kept = next(name for name in names if not name.exists())
    os.rename(path, kept)
    return kept


def go_on(
    scene: Scene,
    settings: Settings,
    on_pass: Callable[[Film], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
    *,
    saved: Film | None = None,
    **options,
) -> Film:
    """Render as `render` does, with finished passes of this render (see `load`), to which further passes are added;
    on_pass gets this film first. options: image_copies and geometry, as in `render`."""
    if saved is not None:
        log.info("Going on after %d saved passes", saved.passes)
        if on_pass:
            on_pass(saved)
    return render(scene, settings, on_pass, cancelled, saved, **options)


def render_with_checkpoints(
    scene: Scene,
    settings: Settings,
    on_pass: Callable[[Film], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
    *,
    path: Path,
    interval: float,
    saved: Film | None = None,
    **options,
) -> Film:
    """Render as `render` does, and save the finished passes every `interval` seconds and when cancelled.

    saved, options: see `go_on`.
    A complete render removes its checkpoint. If a checkpoint cannot be written during the render, the log warns.
    Raises OSError, before the first pass, if path cannot be written.
    """
    marks = fingerprint(scene, settings)
    check_writable(path, _WHAT)
    last = time.monotonic()

    def try_to_save(film: Film) -> None:
        nonlocal last
        try:
            save(path, film, marks)
            log.info("%d passes saved to %s", film.passes, path)
        except OSError as error:
            log.warning("%s; the render goes on", error)
        last = time.monotonic()

    def after_pass(film: Film) -> None:
        if time.monotonic() >= last + interval:
            try_to_save(film)
        if on_pass:
            on_pass(film)

    film = go_on(scene, settings, after_pass, cancelled, saved=saved, **options)
    if not cancelled():
        path.unlink(missing_ok=True)
    elif film.passes:
        try_to_save(film)
    return film
