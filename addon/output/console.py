# SPDX-License-Identifier: GPL-3.0-or-later
"""What libraries print to the console and means nothing."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager

STANDARD_ERROR = 2  # number of the file
# A Blender of a Linux distribution shares its own OpenEXR with all that it loads, where functions have the same names:
# the file is right all the same, see docs/dependencies.md
HARMLESS = b"EXR_ERR_ARGUMENT_OUT_OF_RANGE"

_lock = threading.Lock()  # two at once would leave the console to the file of one of them


@contextmanager
def without_harmless_messages() -> Iterator[None]:
    """Lines with HARMLESS that are printed in this context are dropped; all others follow at its end."""
    if sys.platform != "linux":
        yield
        return
    with _lock, tempfile.TemporaryFile() as caught:
        console = os.dup(STANDARD_ERROR)
        os.dup2(caught.fileno(), STANDARD_ERROR)
        try:
            yield
        finally:
            os.dup2(console, STANDARD_ERROR)
            os.close(console)
            caught.seek(0)
            kept = b"".join(line for line in caught if HARMLESS not in line)
            if kept:
                os.write(STANDARD_ERROR, kept)
