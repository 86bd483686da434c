# SPDX-License-Identifier: GPL-3.0-or-later
"""Count rays: a cost that, unlike time, is the same on every machine, whatever else that does. And tell Embree's time,
which no estimator can save but by fewer rays."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple
from unittest import mock

from addon.solver.geometry.segments import Tracer


class Traced(NamedTuple):
    """What a call of Embree did: how many rays it traced, and in how many s of processor time."""

    rays: int
    seconds: float


@contextmanager
def counted_rays() -> Iterator[list[Traced]]:
    """A list of all calls of Embree, one after the other: flights of photons, camera rays, final gathers, shadow rays,
    feelers."""
    trace, calls = Tracer.trace, []

    def counted(tracer, origin, *rest):
        begin = time.thread_time()
        hits = trace(tracer, origin, *rest)
        calls.append(Traced(len(origin), time.thread_time() - begin))
        return hits

    with mock.patch.object(Tracer, "trace", counted):
        yield calls


def total(calls: list[Traced]) -> Traced:
    """Rays and seconds of all calls."""
    return Traced(sum(call.rays for call in calls), sum(call.seconds for call in calls))
