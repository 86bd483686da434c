# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether this process compiles kernels at the moment, for what artists read while they wait."""

from __future__ import annotations

import time

from numba.core import event

COMPILING = " (kernels are compiled once, on first use)"  # end of a status
BRIEFLY = 0.3  # s: what takes no longer is nothing that somebody waits for


class _Watch(event.Listener):
    """Counts what Numba has begun to compile and not ended; one kernel may need others first."""

    def __init__(self):
        self.open = 0
        self.since = 0.0

    def on_start(self, event):
        if self.open == 0:
            self.since = time.monotonic()
        self.open += 1

    def on_end(self, event):
        self.open -= 1


_watch = _Watch()
event.register("numba:compile", _watch)


def compiles_now() -> bool:
    """Whether a kernel is being compiled, and not only for a moment. One that is loaded from a file is not."""
    return _watch.open > 0 and time.monotonic() - _watch.since > BRIEFLY
