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
from contextlib import contextmanager
from functools import cache
from pathlib import Path

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
    """Let a kernel's files have names that no other process gives.

    Numba numbers the files of a kernel's signatures, and looks at its index for the next number. Two processes that
    compile one kernel for different types at the same time would take the same number, and one file would stand for
    both: that is code for other types. With names of their own all that can be lost is an entry of the index, and what
    is missing is compiled again.
    """
    file = getattr(kernel._cache, "_cache_file", None)  # None if it is not kept
    if file is not None:
        file._data_name_pattern = file._data_name_pattern.replace("{number", f"{_PROCESS}-{{number")
