# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are either whole or not there."""

from __future__ import annotations

import errno
import os
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacing(path: Path, what: str) -> Iterator[Path]:
    """A temporary file to write, beside path; at the end of the context it is renamed to path.

    So neither a crash nor a full disk leaves half a file at path, or destroys an older file there. what: name, in
    messages, of what is written. Raises OSError naming the path if it cannot be written.
    """
    _check_folder(path, what)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        yield unfinished
        os.replace(unfinished, path)
    except (RuntimeError, OSError) as error:  # OpenEXR reports input and output errors as RuntimeError
        raise OSError(f"Cannot write {what} to '{path}': {error}") from error
    finally:
        with suppress(OSError):  # it was renamed, or never made
            unfinished.unlink()


def check_writable(path: Path, what: str) -> None:
    """Raise OSError naming the path if a file cannot be made there; the arguments are those of `replacing`."""
    _check_folder(path, what)
    try:
        tempfile.TemporaryFile(dir=path.parent).close()
    except OSError as error:
        raise OSError(f"Cannot write {what} to '{path}': {error.strerror}") from error


def _check_folder(path: Path, what: str) -> None:
    if not path.parent.is_dir():
        raise FileNotFoundError(errno.ENOENT, f"Cannot write {what}, there is no such folder", str(path.parent))
