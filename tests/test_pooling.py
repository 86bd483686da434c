# SPDX-License-Identifier: GPL-3.0-or-later
"""Variance of pixels from their own passes and their neighbours, where all passes differ alike and where few do."""

import numpy as np
import pytest

from addon.solver.image.pooling import pooled_variance, variance_of_edges

SHAPE = 40, 50
ALL = np.ones(SHAPE, bool)


def pooled(passes):
    """pooled_variance of passes (n, h, w)."""
    deviation = passes - passes.mean(axis=0)
    return pooled_variance(
        (deviation**2).sum(axis=0), (deviation**4).sum(axis=0), ALL[: passes.shape[1], : passes.shape[2]], len(passes)
    )


def rare(chance, count, seed=1):
    """Passes (count, h, w) that are 1 with a small chance, else 0: their variance is chance (1 - chance)."""
    return (np.random.default_rng(seed).random((count, *SHAPE)) < chance).astype(float)


@pytest.mark.parametrize("passes", [rare(0.05, 16), np.random.default_rng(0).normal(size=(32, *SHAPE))])
def test_sharing_keeps_the_sum(passes):
    assert pooled(passes).sum() == pytest.approx(passes.var(axis=0, ddof=1).sum(), rel=1e-12)


@pytest.mark.parametrize("chance", [0.3, 0.05, 0.012])
def test_nobody_is_sure_of_what_is_rare(chance):
    """In 64 passes an event of 1.2 % is met by half of the pixels alone. The errors of all over the stated ones:
    about 1 in the mean square, and none beyond 5."""
    passes = rare(chance, 64)
    stated = np.sqrt(pooled(passes) / 64)
    ratio = (passes.mean(axis=0) - chance) / np.maximum(stated, 1e-30)
    assert 0.8 < np.sqrt(np.mean(ratio**2)) < 1.2
    assert np.abs(ratio).max() < 5


def test_own_passes_alone_would_be_too_sure():
    """What the pooling is for: pixels that met nothing state no error at all."""
    assert np.mean(rare(0.012, 64).std(axis=0) == 0.0) > 0.4
    assert np.all(pooled(rare(0.012, 64)) > 0.0)


@pytest.mark.parametrize("count, most", [(16, 0.4), (64, 0.25), (1024, 0.06)])
def test_a_quiet_pixel_beside_noise_states_little(count, most):
    """Half of the image has no noise. At the border its error is stated too large, by a share that vanishes with the
    passes: n of normal deviations count as n / 3 events, so 2 / (n / 3 + 2) is shared, and 2 of 5 columns receive it.
    """
    passes = np.random.default_rng(2).normal(size=(count, *SHAPE))
    passes[:, :, 25:] = 0.0
    variance = pooled(passes)
    assert np.all(variance[:, 27:] == 0.0)
    assert np.sqrt(variance[:, 25].mean()) < most
    assert variance[:, 20].mean() == pytest.approx(1.0, abs=3 * np.sqrt(2 / (count * SHAPE[0])))


def test_nothing_is_not_noisy():
    assert np.all(pooled_variance(np.zeros(SHAPE), np.zeros(SHAPE), ALL, 2) == 0.0)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (5, 1), (2, 3)])
def test_small_images(shape):
    passes = np.random.default_rng(3).normal(size=(8, *shape))
    assert np.all(np.isfinite(pooled(passes))) and pooled(passes).shape == shape


def test_a_pixel_alone_has_its_own_variance():
    passes = np.random.default_rng(3).normal(size=(8, 1, 1))
    assert pooled(passes)[0, 0] == pytest.approx(passes.var(ddof=1), rel=1e-12)


def test_what_is_known_exactly_receives_nothing():
    """But it keeps what it has: pixels with an edge that the survey did not see."""
    passes = rare(0.05, 64)
    estimated = np.arange(SHAPE[1]) < 25
    passes[:, :, 25:40] = 0.0
    deviation = passes - passes.mean(axis=0)
    squares, fourths = (deviation**2).sum(axis=0), (deviation**4).sum(axis=0)
    variance = pooled_variance(squares, fourths, np.broadcast_to(estimated, SHAPE), 64)
    assert np.all(variance[:, 25:40] == 0.0) and np.all((variance[:, 40:] > 0.0) == (squares[:, 40:] > 0.0))
    assert variance.sum() * 63 == pytest.approx(squares.sum(), rel=1e-12)


def of_edges(passes):
    """variance_of_edges of passes (n, h, w)."""
    deviation = passes - passes.mean(axis=0)
    planned, resolved = passes.var(axis=0, ddof=1), np.full(passes.shape[1:], np.inf)  # the plan was right
    return variance_of_edges((deviation**2).sum(axis=0), (deviation**4).sum(axis=0), planned, resolved, len(passes))


def test_edges_of_which_all_passes_tell_fall_by_the_root_of_the_passes():
    passes = np.random.default_rng(3).normal(size=(256, *SHAPE))
    ratio = of_edges(passes) / passes.var(axis=0, ddof=1)
    assert ratio.mean() == pytest.approx(1 / 16, rel=0.05)  # the kurtosis of 256 normal values is 3 to 10 %


@pytest.mark.parametrize("hits", [1, 4])
def test_what_is_seldom_met_falls_by_the_root_of_the_hits(hits):
    """256 passes of which few meet something, which is then not known better than that."""
    passes = np.zeros((256, *SHAPE))
    passes[:hits] = 1.0
    np.testing.assert_allclose(of_edges(passes) / passes.var(axis=0, ddof=1), (3.0 * hits) ** -0.5, rtol=0.02)


def test_neighbours_of_what_is_seldom_met_state_it_too():
    """A wire across the image that rays met in one pixel, in one of 64 passes: those around share two thirds of its
    variance, as far as 61 of 64 are rare, and it keeps its own."""
    passes = np.zeros((64, *SHAPE))
    passes[5, 20, 25] = 1.0
    variance = of_edges(passes)
    own = passes.var(axis=0, ddof=1)[20, 25] * 3.0**-0.5
    assert variance[20, 25] == pytest.approx(own, rel=0.04)
    assert variance[18:23, 23:28].min() == pytest.approx(own * 2.0 / 3.0 * 61.0 / 64.0 / 25.0, rel=0.04)
    assert variance[17].max() == 0.0


def test_edges_that_are_met_share_what_may_cut_a_corner():
    """Of an edge that all passes meet, pixels beside it state 0.02 m^-1/2 of the variance, and further ones nothing if
    passes deviate alike, little if normally."""
    for count in (2, 16, 256):
        passes = np.zeros((count, *SHAPE))
        passes[::2, :, 25] = 1.0
        variance = of_edges(passes)
        assert not variance[:, :24].any()
        np.testing.assert_allclose(variance[1:-1, 24], 0.02 * count**-0.5 * variance[1:-1, 25])
        passes[:, :, 25] = np.random.default_rng(4).normal(size=(count, SHAPE[0]))
        variance = of_edges(passes)
        assert variance[:, 23].mean() < 0.01 * variance[:, 25].mean()


def test_passes_that_agree_by_chance_do_not_state_that_there_is_no_error():
    """Of two to eight passes the plan's variance counts as one more: n of it, by the root of n."""
    for count in (2, 8):
        nothing, planned = np.zeros(SHAPE), np.full(SHAPE, 5.0)
        variance = variance_of_edges(nothing, nothing, planned, np.full(SHAPE, np.inf), count)
        np.testing.assert_allclose(variance, 5.0 / count**1.5)
