# SPDX-License-Identifier: GPL-3.0-or-later
"""Where compiled kernels are kept between runs.

Numba notices that a kernel's own file changed, but not the files of the functions compiled into it. So all kernels live
in a folder named after the contents of every source file here: a new version of any of them starts a new folder.
"""

import hashlib
import os
import shutil
import tempfile
from pathlib import Path

import numba

_PREFIX = "infrared-photons-"


def keep_kernels() -> Path:
    """Point numba at the folder for this version of the solver, in NUMBA_CACHE_DIR or beside the sources.

    Must run before any kernel is defined. Folders of other versions are removed.
    """
    here = Path(__file__).parent
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(here.glob("*.py")))).hexdigest()[:16]
    base = Path(numba.config.CACHE_DIR or here / "__pycache__")
    if base.name.startswith(_PREFIX):  # imported again in the same process
        base = base.parent
    folder = base / (_PREFIX + digest)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            raise PermissionError(folder)
    except OSError:  # a read-only installation: kernels are compiled again after a restart of the machine
        folder = Path(tempfile.gettempdir()) / (_PREFIX + digest)
        folder.mkdir(parents=True, exist_ok=True)
    for other in folder.parent.glob(_PREFIX + "*"):
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    numba.config.CACHE_DIR = str(folder)
    return folder
