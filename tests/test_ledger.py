# SPDX-License-Identifier: GPL-3.0-or-later
"""The ledger of light: every kind of light path is counted once, and none twice.

A kind is an emitter and the lobes that a path meets, from the eye on: diffuse (D), rough (G), mirror (S). Each is
rendered in a scene in which hardly any other brings light (helpers/chains.py), and compared with the path tracer of
helpers/path_tracer.py, which has no shadow rays, photons or caches. A kind that is left out is 100 % too low, one that
is counted twice 100 % too high.

Left out are lights seen directly or in mirrors alone: they are invisible there (docs/method.md, section 9).

References are in helpers/ledger.csv: for each chain the mean excess radiance of the picture, W m-2 sr-1, its standard
error, and the share of the kinds that meet every plate once.

    python -m tests.test_ledger

makes them (half an hour).
"""

import csv
import itertools
import time
from pathlib import Path

import numpy as np

from tests.helpers.chains import COLD, EMITTERS, chain, kinds_of
from tests.helpers.path_tracer import standard_error, trace_paths

TABLE = Path(__file__).parent / "helpers" / "ledger.csv"
LENGTH = 4  # lobes of the longest kinds
MIXED = (
    "d",
    "s",
    "dd",
    "ds",
    "sd",
    "ss",
    "dD",
    "dG",
    "dS",
    "sD",
    "sG",
    "Dd",
    "Gd",
    "Sd",
    "Ds",
    "Gs",
    "Ss",
    "dsd",
    "sds",
)
TRACED = EMITTERS[:-1]  # by the path tracer; the reference of the light is that of the plate
_ERROR, _SECONDS = 0.02, 25.0  # relative error at which a reference is good enough, and the most time for one


def pure(length):
    """All chains of plates with one lobe each."""
    return ["".join(lobes) for lobes in itertools.product("DGS", repeat=length)]


def reference(lobes, emitter):
    """Mean excess radiance of the picture, its standard error, and the share of the kinds of the chain."""
    scene, means, shares, start = chain(lobes, emitter), [], [], time.monotonic()
    while True:
        traced = trace_paths(scene, 300, 16, first_batch=len(means), reference=COLD, kinds=True)
        means.extend(traced.images.sum(axis=-1).mean(axis=(1, 2)))
        kinds = traced.by_kind()
        shares.append(sum(kinds[kind][0].mean() for kind in kinds_of(lobes) if kind in kinds))
        value, error = np.mean(means), standard_error(np.array(means))
        if error < _ERROR * value or time.monotonic() - start > _SECONDS:
            return value, error, np.mean(shares) / value


def write_references():
    chains = ["", *MIXED, *itertools.chain.from_iterable(pure(length) for length in range(1, LENGTH + 1))]
    with TABLE.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("emitter", "lobes", "excess", "error", "share"))
        for lobes, emitter in itertools.product(sorted(chains, key=len), TRACED):
            value, error, share = reference(lobes, emitter)
            table.writerow((emitter, lobes, f"{value:.5g}", f"{error:.2g}", f"{share:.3f}"))
            file.flush()


if __name__ == "__main__":
    write_references()
