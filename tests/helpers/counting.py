# SPDX-License-Identifier: GPL-3.0-or-later
"""Count rays: a cost that, unlike time, is the same on every machine, whatever else that does."""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

from addon.solver.geometry.segments import Tracer


@contextmanager
def counted_rays() -> Iterator[list[int]]:
    """A list to which each call of Embree adds how many rays it traces: flights of photons, camera rays, final
    gathers, shadow rays, feelers."""
    trace, rays = Tracer.trace, []

    def counted(tracer, origin, *rest):
        rays.append(len(origin))
        return trace(tracer, origin, *rest)

    with mock.patch.object(Tracer, "trace", counted):
        yield rays
