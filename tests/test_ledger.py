# SPDX-License-Identifier: GPL-3.0-or-later
"""The ledger of light: every kind of light path is counted once, and none twice.

A kind is an emitter and the lobes that a path meets, from the eye on: diffuse (D), rough (G), mirror (S). Each is
rendered in a scene in which hardly any other brings light (helpers/chains.py), and compared with the path tracer of
helpers/path_tracer.py, which has no shadow rays, photons or caches. Means of pictures must agree within 4 standard
errors of both together, and these are at most 10 % (mostly below 5 %): a kind that is left out is 100 % too low, one
that is counted twice 100 % too high, and 50 % where two ways share it.

Which way finds a kind is planned from scene to scene. Some of the ways are forced, too (see WAYS): the plan may cost
noise, and must not change the mean.

Thin sheets are no lobes: each kind passes them, and is rendered with a film across its way, too.

Left out are lights seen directly or in mirrors alone: they are invisible there (docs/method.md, section 9).

References are in helpers/ledger.csv: for each chain the mean excess radiance of the picture, W m-2 sr-1, its standard
error, and the share of the kinds that meet every plate once.

    python -m tests.test_ledger

makes them (an hour).
"""

import csv
import functools
import itertools
import re
import time
from pathlib import Path

import numpy as np
import pytest

from addon.solver import Settings
from tests.helpers.chains import BEHIND, COLD, EDGES, EMITTERS, FILM, LENGTH, chain, is_compared, kinds_of, with_film
from tests.helpers.path_tracer import black_radiance, standard_error, trace_paths
from tests.helpers.scenes import pass_means

pytestmark = pytest.mark.once

TABLE = Path(__file__).parent / "helpers" / "ledger.csv"
SHORT = 3  # of the longest that are not left to --long
MIXED = tuple("ds")  # plates with two lobes
MIXED += ("dd", "ds", "sd", "ss", "dD", "dG", "dS", "sD", "sG", "Dd", "Gd", "Sd", "Ds", "Gs", "Ss", "dsd", "sds")
TRACED = {"plate": "plate", "lamp": "lamp", "sky": "plate", "light": "plate"}  # emitter: whose reference is its own
PASSES = (8, 8, 16, 24, 48)  # by number of lobes, of chains without much noise, see passes_of
# A kind that is counted twice, or not at all, is off by 8 of the largest errors.
SIGMAS, LARGEST_ERROR = 4.0, 0.125
LEAST_SHARE = 0.85  # of the light, of the kinds that a chain is for
_ERRORS = (0.01, 0.01, 0.01, 0.02, 0.04)  # relative errors at which references are good enough, by number of lobes
_SECONDS = 240.0  # for one reference, about, if it does not get so good


def _all_lamps(surfaces, power, pilot, lit):
    """Instead of choose_caustic_lamps: every sheet that emits and that the image can depend on."""
    return power * pilot.reachable > 0.0


_CAUSTIC, _END = "[Dds][GSds]+$", "[Dds].*[Dds]"  # chains with a caustic, and with ends of final gathers
WAYS = {  # by name: the chains and the emitters that it makes a difference to, and what is changed in the solver
    # photons find what comes by way of specular surfaces alone, not rays (planning/caustics.py)
    "caustics": (_CAUSTIC, ("plate", "lamp"), {"planning.preparation.choose_caustic_lamps": _all_lamps}),
    # the same, and what comes first by way of rough lobes, too, as where these are narrow (physics/lobes.py)
    "narrow": (
        "[Dds][GSs]*G$",
        ("lamp", "light"),
        {"planning.preparation.choose_caustic_lamps": _all_lamps, "physics.lobes._WIDE": np.inf},
    ),
    # no end of a final gather recalls: all go on (photons/irradiance_cache.py). As planned, nearly all recall here
    "continued": (_END, EMITTERS, {"photons.irradiance_cache._RESOLVED": 0.0}),
    # ends look for the surroundings by rays, and photons that arrive from there are not stored (planning/pilot.py)
    "open": (_END, ("sky",), {"planning.pilot._OPEN": -1.0, "planning.pilot._LEAST_OPEN": 0}),
}


def pure(length):
    """All chains of so many plates with one lobe each."""
    return ["".join(lobes) for lobes in itertools.product("DGS", repeat=length)]


def passes_of(lobes):
    """Number of passes after which the error of a chain is small enough."""
    behind, is_longest = BEHIND.match(lobes), len(lobes) == LENGTH
    if behind:
        factor = 16 if is_longest and lobes[0] == "D" else 4 * len(behind[1])
    elif lobes[:3] == "GSS":
        factor = 2 if len(lobes) == SHORT else 3
    else:
        factor = 4 if is_longest and lobes[:2] in ("DD", "GG") else 1
    return PASSES[len(lobes)] * factor


def is_long(lobes, emitter):
    """Whether a chain is left to --long: where it is long or takes many passes, and half of those of two lobes."""
    behind = len(lobes) == SHORT and BEHIND.match(lobes)
    return len(lobes) > SHORT or bool(behind) or (not set(lobes) <= set("DGS") and emitter in ("plate", "sky"))


def cases(chains, emitters=EMITTERS, forced=False):
    """Parameters lobes, emitter."""
    return [
        pytest.param(lobes, emitter, marks=pytest.mark.long if is_long(lobes, emitter) else [])
        for lobes, emitter in itertools.product(chains, emitters)
        if is_compared(lobes, emitter, forced)
    ]


def forced():
    """Parameters way, lobes, emitter: of each way those chains that it makes a difference to."""
    chains = [*MIXED, *itertools.chain.from_iterable(map(pure, range(1, SHORT + 1)))]
    for way, (pattern, emitters, _) in WAYS.items():
        for case in cases([lobes for lobes in chains if re.search(pattern, lobes)], emitters, forced=True):
            # a way is the same whatever lies before: chains of one and two lobes tell it
            is_long = len(case.values[0]) == SHORT
            yield pytest.param(way, *case.values, marks=pytest.mark.long if is_long else case.marks)


@functools.cache
def references():
    """By emitter and lobes: value, standard error, share."""
    with TABLE.open(newline="") as file:
        rows = csv.DictReader(file)
        return {
            (row["emitter"], row["lobes"]): tuple(float(row[name]) for name in ("excess", "error", "share"))
            for row in rows
        }


def settings_of(lobes):
    """The Settings for a chain."""
    return Settings(passes=passes_of(lobes), photons_per_pass=10_000, reference_temperature=COLD, threads=1)


def rendered(lobes, emitter):
    """Mean excess radiance of the picture, and its standard error."""
    means = pass_means(chain(lobes, emitter), settings_of(lobes))[:, 0] - black_radiance(EDGES, COLD)[0]
    return means.mean(), standard_error(means)


def check(lobes, emitter):
    """The picture of a chain against its reference."""
    truth, its_error, share = references()[TRACED[emitter], lobes]
    value, own_error = rendered(lobes, emitter)
    deviation, error = value / truth - 1.0, np.hypot(own_error, its_error) / truth
    print(f"deviation {deviation:+.4f}, standard error {error:.4f}, share {share:.3f}")
    assert share > LEAST_SHARE
    assert error < LARGEST_ERROR
    assert abs(deviation) <= SIGMAS * error + 1e-4


@pytest.mark.parametrize("lobes, emitter", cases(itertools.chain.from_iterable(map(pure, range(LENGTH + 1)))))
def test_every_kind_once(lobes, emitter):
    check(lobes, emitter)


@pytest.mark.long
@pytest.mark.parametrize("lobes, emitter", cases(MIXED))
def test_plates_with_two_lobes(lobes, emitter):
    check(lobes, emitter)


@pytest.mark.parametrize("way, lobes, emitter", list(forced()))
def test_whichever_way_is_planned(monkeypatch, way, lobes, emitter):
    for name, value in WAYS[way][-1].items():
        monkeypatch.setattr(f"addon.solver.{name}", value)
    check(lobes, emitter)


@pytest.mark.parametrize("lobes, emitter", cases(["", "D", "G", "S", "DD", "SD", "DG"]))
def test_every_kind_passes_sheets(lobes, emitter):
    """With a film across every leg: the light of the kind times the film's transmittance for each."""
    truth, its_error, _ = references()[TRACED[emitter], lobes]
    scene, settings = with_film(chain(lobes, emitter), len(lobes)), settings_of(lobes)
    means = pass_means(scene, settings)[:, 0] - black_radiance(EDGES, COLD)[0]
    deviation = means.mean() / (truth * FILM ** (len(lobes) + 1)) - 1.0
    error = np.hypot(standard_error(means) / means.mean(), its_error / truth)
    print(f"deviation {deviation:+.4f}, standard error {error:.4f}")
    assert error < LARGEST_ERROR and abs(deviation) <= SIGMAS * error + 1e-4


def reference(lobes, emitter):
    """Mean excess radiance of the picture, its standard error, and the share of the kinds of the chain."""
    scene, means, shares, start = chain(lobes, emitter), [], [], time.monotonic()
    while True:
        traced = trace_paths(scene, 300, 16, first_batch=len(means), reference=COLD, kinds=True)
        means.extend(traced.images.sum(axis=-1).mean(axis=(1, 2)))
        kinds = traced.by_kind()
        shares.append(sum(kinds[kind][0].mean() for kind in kinds_of(lobes) if kind in kinds))
        value, error = np.mean(means), standard_error(np.array(means))
        if error < _ERRORS[len(lobes)] * value or time.monotonic() - start > _SECONDS:
            return value, error, np.mean(shares) / value


def write_references():
    chains = ["", *MIXED, *itertools.chain.from_iterable(pure(length) for length in range(1, LENGTH + 1))]
    with TABLE.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("emitter", "lobes", "excess", "error", "share"))
        for lobes, emitter in itertools.product(sorted(chains, key=len), sorted(set(TRACED.values()), reverse=True)):
            value, error, share = reference(lobes, emitter)
            table.writerow((emitter, lobes, f"{value:.5g}", f"{error:.2g}", f"{share:.3f}"))
            file.flush()


if __name__ == "__main__":
    write_references()
