# SPDX-License-Identifier: GPL-3.0-or-later
"""Where compiled kernels are kept between runs.

Numba notices when a kernel's own file has changed, but not when the file of a function that is compiled into the kernel
has. So all kernels live in a folder named after the contents of all source files of the solver: a change in any of them
starts a new folder.
"""

import hashlib
import os
import re
import shutil
import tempfile
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

try:
    import fcntl
except ImportError:  # on Windows
    import msvcrt

    fcntl = None

FOLDER_VARIABLE = "INFRARED_PHOTONS_KERNELS"  # environment variable: where to keep kernels, not beside the sources
_PREFIX = "infrared-photons-"
_SOLVER = Path(__file__).parents[1]
_PROCESS = uuid.uuid4().hex[:8]  # of this process alone, see keep_apart


@cache
def source_digest() -> str:
    """16 hexadecimal digits that name the version of the solver: of the contents of its source files."""
    sources = sorted(_SOLVER.rglob("*.py"))  # in all rooms, as kernels of one room are compiled into kernels of another
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]


@cache
def kernel_folder() -> Path:
    """The folder for this version of the solver, which exists now. Folders of other versions are removed."""
    folder = Path(os.environ.get(FOLDER_VARIABLE) or _SOLVER / "__pycache__") / (_PREFIX + source_digest())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(folder)
    except OSError:  # a read-only installation: kernels are compiled in every process
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX))
    for other in folder.parent.iterdir():
        if other != folder and re.fullmatch(_PREFIX + "[0-9a-f]{16}", other.name):
            shutil.rmtree(other, ignore_errors=True)
    return folder


@contextmanager
def kept_kernels() -> Iterator[None]:
    """Kernels defined in this context are kept in kernel_folder(). Numba's own setting is as before afterwards."""
    import numba  # here, so that callers of source_digest() alone do not load Numba

    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(kernel_folder())
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


def keep_apart(kernel) -> None:
    """Let several processes keep what they compile of a kernel at the same time.

    Numba reads a kernel's index, adds an entry with the next number for its file, and writes the index. Two processes
    at once would take the same number, so that one file would stand for code of two types; and of the two entries one
    would be lost. So one process at a time does that, and files have names that no other process gives, should a disk
    know no locks.
    """
    file = getattr(kernel._cache, "_cache_file", None)  # None if it is not kept
    if file is None:
        return
    file._data_name_pattern = file._data_name_pattern.replace("{number", f"{_PROCESS}-{{number")
    save = file.save

    def save_alone(key, data):
        with _alone(Path(file._cache_path)):
            save(key, data)

    file.save = save_alone


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """No other process is in this context for the same folder, which is made. The system ends it with the process."""
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "ab") as file:
        with suppress(OSError):  # the disk knows no locks
            if fcntl:
                fcntl.flock(file, fcntl.LOCK_EX)
            else:
                file.seek(0)
                msvcrt.locking(file.fileno(), msvcrt.LK_LOCK, 1)
        try:
            yield
        finally:
            if not fcntl:
                with suppress(OSError):  # it was not locked
                    file.seek(0)
                    msvcrt.locking(file.fileno(), msvcrt.LK_UNLCK, 1)
