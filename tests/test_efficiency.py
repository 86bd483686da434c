# SPDX-License-Identifier: GPL-3.0-or-later
"""What a picture costs: mistakes of planning bring noise or rays, never energy, so tests of means do not see them.

The figure of a scene is the squared error of a pass (K2) times the rays that Embree traces in a pass: flights of
photons, camera rays, final gathers, shadow rays, feelers. More passes or a faster machine leave it as it is; a worse
plan raises it.

The error is that of Film.noise, which is the spread between passes. Its square is averaged over all pixels but the
worst 2 %, as in the benchmark of error against time: over all of them the few pixels at the edges of small hot things
make most of the figure's own spread. That is, as a standard deviation over 12 seeds, 0.7 to 2.6 %, and 7 % where a
caustic is most of it. A figure fails if it is beyond TOLERANCE either way, three standard deviations or more: one that
is far better should be stored.

`python -m pytest -s tests/test_efficiency.py --long` prints the figures beside those that are stored;
`python -m tests.test_efficiency` prints new ones to store, and their spread, which takes some minutes.
"""

import dataclasses

import numpy as np
import pytest

from addon.solver import Settings, render
from addon.solver.planning import preparation
from tests.benchmarks.speed_scenes import SCENES, build
from tests.helpers.counting import counted_rays, total

WIDTH, HEIGHT = 64, 48
SETTINGS = Settings(passes=16, photons_per_pass=25_000)
KEPT = 0.98  # of the pixels
TOLERANCE = 0.2  # relative
# K2 rays, means over 12 seeds, and the spread over them
STORED = {
    "room": 397.4,  # 0.7%
    "ring": 1.782e06,  # 7.5%
    "cavity": 2.041e05,  # 2.7%
    "engine": 5.590e06,  # 0.9%
    "street": 2230,  # 0.7%
    "office": 1231,  # 1.1%
    "bay": 9.092e06,  # 0.9%
}


def figure(name, seed=0):
    """Squared error times rays of a pass of a scene, K2."""
    scene = build(name, (WIDTH, HEIGHT))
    after = []
    with counted_rays() as calls:
        film = render(scene, dataclasses.replace(SETTINGS, seed=seed), lambda _: after.append(total(calls).rays))
    rays_per_pass = (after[-1] - after[0]) / (film.passes - 1)  # those before the first pass learn about the scene
    film.estimated[:] = False  # each pixel tells its own noise: shared with neighbours, the worst 2 % would be others
    squares = np.sort(film.noise().astype(float).ravel() ** 2)[: int(KEPT * WIDTH * HEIGHT)]
    return film.passes * squares.mean() * rays_per_pass


SHORT = "ring", "street"


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in SHORT else pytest.mark.long) for name in SCENES]
)
def test_error_and_rays_together_are_as_small_as_they_were(name):
    now = figure(name)
    print(f"\n{name}: {now:.4g} K2 rays, {now / STORED[name] - 1:+.1%}")
    assert now == pytest.approx(STORED[name], rel=TOLERANCE)


def test_a_wrong_price_is_seen(monkeypatch):
    """With ten times the price there are far fewer rays, and the figure is two fifths higher."""
    plan = preparation.plan_splitting

    def dearer(*arguments):
        splitting = plan(*arguments)
        return splitting._replace(price=10.0 * splitting.price)

    monkeypatch.setattr(preparation, "plan_splitting", dearer)
    assert figure("office") > (1.0 + TOLERANCE) * STORED["office"]


def main():
    """Print the table to store, and the spread."""
    for name in SCENES:
        figures = [figure(name, seed) for seed in range(12)]
        print(f'    "{name}": {np.mean(figures):.4g},  # {np.std(figures, ddof=1) / np.mean(figures):.1%}', flush=True)


if __name__ == "__main__":
    main()
