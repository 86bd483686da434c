# SPDX-License-Identifier: GPL-3.0-or-later
"""Gas against exact values, through the camera, until the standard error is small.

    python -m tests.benchmarks.gas_values [--only TEXT] [--seconds S] [--threads N]

The scenes are those of tests/helpers/gas_cases.py. A short render with another seed tells how many passes bring the
standard error below ERROR of the value, and how long each takes; the second render has so many, or as many as fit into
so many seconds of processor time. Printed for each: the value, the exact one, the deviation, the standard error, which
the spread of the passes tells, the deviation over it (with what the case allows beside noise), passes and processor
time; where that did not suffice, how much would.

It ends with an error if a deviation is above SIGNIFICANT standard errors, or above LARGEST though its standard error is
small enough.
"""

import argparse
import math
import time

import numpy as np

from addon.solver import Settings, render
from tests.helpers.gas_cases import gas_cases
from tests.helpers.path_tracer import standard_error

ERROR, LARGEST, SIGNIFICANT = 7e-4, 2e-3, 3.0
_TRIAL, _LEAST = 16, 32  # passes


def pass_values(case, passes, seed, threads):
    """(passes,) values of the single passes of a render."""
    weights = 1.0 / (case.scene.camera.height * case.scene.camera.width) if case.weights is None else case.weights
    sums = [0.0]

    def note(film):
        sums.append(film.passes * float(np.sum(film.radiance() * weights, dtype=float)) / case.scale)

    settings = {"photons_per_pass": 1000, **case.settings}
    render(case.scene, Settings(passes=passes, seed=seed, threads=threads, **settings), note)
    return np.diff(sums)


def measure(case, seconds, threads):
    """Print a row of the table; returns whether the value is right."""
    started = time.process_time()
    trial = pass_values(case, _TRIAL, 1, threads)
    of_pass = (time.process_time() - started) / _TRIAL
    # with a quarter to spare, as few passes do not tell their spread well
    needed = max(_LEAST, math.ceil((1.25 * trial.std(ddof=1) / (ERROR * case.truth)) ** 2))
    passes = min(needed, max(_LEAST, int(seconds / of_pass)))
    started = time.process_time()
    values = pass_values(case, passes, 0, threads)
    taken = time.process_time() - started
    off, error = values.mean() / case.truth - 1.0, standard_error(values) / case.truth
    ratio = off / math.hypot(error, case.tolerance / SIGNIFICANT)
    is_sure = error < ERROR
    took = f"{taken:.0f} s" if is_sure else f"{taken:.0f} of {taken * (error / ERROR) ** 2:.0f} s"
    shown = f"{error:.3%}" if error > 1e-7 else "none"
    print(
        f"| {case.name} | {values.mean():.6g} | {case.truth:.6g} | {off:+.3%} | {shown} | {ratio:+.1f} | {passes} | "
        f"{took} |",
        flush=True,
    )
    return abs(ratio) < SIGNIFICANT and (abs(off) < LARGEST or not is_sure)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0], allow_abbrev=False)
    parser.add_argument("--only", default="", help="cases whose names hold this text")
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="of processor time of a render, at most (%(default)s)"
    )
    parser.add_argument("--threads", type=int, default=1, help="(%(default)s)")
    options = parser.parse_args()
    columns = "what", "ours", "exact", "deviation", "standard error", "ratio", "passes", "processor time"
    print("|", " | ".join(columns), "|\n|---|" + (len(columns) - 1) * "--:|")
    chosen = [case for case in gas_cases() if options.only in case.name]
    wrong = [case.name for case in chosen if not measure(case, options.seconds, options.threads)]
    if wrong:
        raise SystemExit(f"Values are off: {'; '.join(wrong)}")


if __name__ == "__main__":
    main()
