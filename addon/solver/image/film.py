# SPDX-License-Identifier: GPL-3.0-or-later
"""The film: running mean of every band, and the variance between passes, which gives the noise."""

from __future__ import annotations

import math
import threading
from collections.abc import Mapping

import numpy as np

from ..physics.correction import Correction
from ..physics.layers import SINGLE, Layer, from_json, layer_factors, to_json
from ..physics.radiometry import reference_radiance
from ..physics.spectrum import apparent_temperature, band_names
from ..scene import check_band_edges
from ..system.kernels import INLINED, KERNEL, njit
from .pooling import REACH, pooled_variance, sum_around, variance_of_edges
from .regression import Regression
from .self_check import GRID, region_means, regions, significant, spread_out
from .trend import blur

_VALUES = ("width", "height", "band_edges", "reference_temperature", "weights", "passes", "photons", "moments")
_SEEN, _REST = ("_seen_squares", "_seen_cubes", "_seen_fourths"), ("_squares", "_cubes", "_fourths")
_ARRAYS = ("_mean", "_seen", *_SEEN, *_REST)  # by pixel
_CHECKS = ("_missed", "_missed_squares")  # by region of the image
_FOLLOWED = ("seen", "rest", "blur")  # what a film may hold a Regression of, see follow and follow_disks
# Degrees of freedom from which on a spread without what follows known numbers is used. By Student's t of 8, 0.1 % lie
# beyond 5 errors; of 2, 4 %.
_FREEDOM = 8


class Film:
    """Mean over passes of the radiance of each pixel and band. Row 0 is the bottom row.

    Films of disjoint pass ranges merge into the film of all of them. Memory does not depend on the number of passes.

    width, height: pixels. band_edges: (b + 1,) um. reference_temperature: K, 0 without subtraction.
    weights: (b,) response of the sensor in each band (`sensors.band_weights`), by which the bands count in radiance();
    None counts all alike. correction: of temperature() and noise(); it may be changed at any time.
    openness: share of the rays that leave the scene and see its surroundings, as far as the pilot knows.
    estimated: (height * width,) bool, pixels whose reflected light is estimated, which may have missed something; the
    others are exact but for edges.
    expected: (4, height * width) float64, what the plan knows of what is seen, through the sensor's response: its
    variance in a pass; and of specks, so small that no ray may have met them, the radiance that they add to the pixel,
    how many rays of a pass meet them in the mean, and how many meet a square of their width, infinite where there are
    none. None if nothing was planned.
    moments: number of times over which the passes are spread; 0 if the scene stands still.
    layers: the temperature groups that are kept apart; images show them at the temperatures of the scene.
    seed, first_pass: of the passes that will be added. ranges: list of (seed, first pass, last pass + 1) of finished
    passes. passes: number of finished passes. photons: emitted in these passes.
    lock: held while a pass is added; hold the lock to read several images of the same passes from another thread.
    """

    def __init__(
        self,
        width: int,
        height: int,
        band_edges: np.ndarray,
        reference_temperature: float = 0.0,
        seed: int = 0,
        first_pass: int = 0,
        weights: np.ndarray | None = None,
        layers: tuple[Layer, ...] = SINGLE,
    ):
        self.width, self.height = width, height
        self.band_edges = np.asarray(band_edges, dtype=np.float64)
        self.reference_temperature = reference_temperature
        self.weights = np.ones(self.band_count) if weights is None else np.asarray(weights, dtype=np.float64)
        self.correction = Correction()
        self.openness = 0.0
        self.moments = 0
        self.estimated = np.ones(height * width, np.bool_)
        self.expected: np.ndarray | None = None
        self.layers = layers
        self._factors = layer_factors(layers, self.band_edges, reference_temperature)
        self.ranges = [(seed, first_pass, first_pass)]
        self.passes = 0
        self.photons = 0
        self.lock = threading.RLock()
        self._reference = reference_radiance(self.band_edges, reference_temperature)
        # float64: a float32 mean stops moving after 2^24 passes and drifts long before
        self._mean = np.zeros((height * width, self._factors.size))
        # sums of second to fourth powers (Welford 1962, Pebay 2008) of the deviations of the radiance that steady rays
        # meet (seen, see rays.Rays), and of all other radiance, both through the sensor's response
        self._seen, self._seen_squares, self._seen_cubes, self._seen_fourths = np.zeros((4, height * width))
        self._squares, self._cubes, self._fourths = np.zeros((3, height * width))
        # mean over the passes, and sum of squared deviations, of what regions miss (see self_check)
        self._missed, self._missed_squares = np.zeros((2, GRID**2))
        self._followed: dict[str, Regression] = {}

    def follow(self, exact: np.ndarray) -> None:
        """Expect with each pass (j,) numbers that its picture follows, whose exact mean is given: what it drew of
        spectra, and cosines of its time."""
        self._followed |= {part: Regression(self.height * self.width, exact) for part in ("seen", "rest")}

    def follow_disks(self) -> None:
        """Expect with each pass the area of the disks that blur it, see trend."""
        self._followed["blur"] = Regression(self.height * self.width, np.zeros(1))

    def __getstate__(self):
        """A film can be pickled, to be merged on another machine; a lock cannot."""
        return {name: value for name, value in self.__dict__.items() if name != "lock"}

    def __setstate__(self, state):
        self.__dict__.update(state, lock=threading.RLock())

    def state(self) -> dict[str, np.ndarray]:
        """All that the film holds, by name, to be kept in a file: `from_state` makes an equal film of it."""
        arrays = {name: np.asarray(getattr(self, name)) for name in (*_VALUES, "ranges", *_ARRAYS, *_CHECKS)}
        followed = {f"{part}_{name}": a for part, each in self._followed.items() for name, a in each.state().items()}
        expected = {} if self.expected is None else {"expected": self.expected}
        return arrays | {"layers": np.asarray(to_json(self.layers))} | expected | followed

    @classmethod
    def from_state(cls, state: Mapping[str, np.ndarray]) -> Film:
        """The film of a state. Raises ValueError if something is missing, misshapen or not finite."""
        missing = {*_VALUES, "ranges", "layers", *_ARRAYS, *_CHECKS} - set(state)
        if missing:
            raise ValueError(f"{', '.join(sorted(missing))} missing")
        counts = "width", "height", "passes", "photons", "moments"
        width, height, passes, photons, moments = (int(state[name]) for name in counts)
        edges = np.asarray(state["band_edges"], np.float64)
        check_band_edges(edges)
        layers = from_json(str(state["layers"]))
        shapes = dict.fromkeys(_ARRAYS, (height * width,)) | dict.fromkeys(_CHECKS, (GRID**2,))
        shapes["_mean"] = height * width, len(layers) * (len(edges) - 1)
        if "expected" in state:
            shapes["expected"] = 4, height * width
        for name, shape in shapes.items():
            if state[name].shape != shape or state[name].dtype != np.float64:
                raise ValueError(f"{name} is {state[name].dtype} {state[name].shape}, expected float64 {shape}")
            if np.isnan(state[name]).any() or (name != "expected" and np.isinf(state[name]).any()):
                raise ValueError(f"{name} holds values that are not finite")
        weights = state["weights"]
        if weights.shape != (len(edges) - 1,) or not (
            np.isfinite(weights).all() and weights.min() >= 0 < weights.max()
        ):
            raise ValueError(f"weights {weights.tolist()} are no response in {len(edges) - 1} bands")
        ranges = state["ranges"]
        if ranges.dtype != np.int64 or ranges.shape[1:] != (3,) or np.sum(ranges[:, 2] - ranges[:, 1]) != passes:
            raise ValueError(f"ranges {ranges.tolist()} are not those of {passes} passes")
        film = cls(width, height, edges, float(state["reference_temperature"]), weights=weights, layers=layers)
        film.ranges = [tuple(row) for row in ranges.tolist()]
        film.passes, film.photons, film.moments = passes, photons, moments
        for name in shapes:
            setattr(film, name, state[name])
        for part in (each for each in _FOLLOWED if f"{each}_exact" in state):
            own = {name.removeprefix(f"{part}_"): state[name] for name in state if name.startswith(f"{part}_")}
            film._followed[part] = Regression.from_state(own, height * width)
        return film

    @property
    def band_count(self) -> int:
        return len(self.band_edges) - 1

    @property
    def layer_weights(self) -> np.ndarray:
        """(layers, b) by which each band of each layer counts in radiance()."""
        return self._factors * self.weights

    @property
    def band_names(self) -> list[str]:
        """Names of the bands as in Blender's passes."""
        return band_names(self.band_edges)

    def add_pass(
        self,
        excess: np.ndarray,
        seen: np.ndarray,
        photons: int,
        missed: np.ndarray | None = None,
        known: np.ndarray | None = None,
        area: float = 1.0,
    ) -> None:
        """Add one finished pass.

        excess: (height * width, layers * b) float32, excess radiance, W m-2 sr-1 per band. seen: (height * width,)
        float32, the part of its sum, weighted with layer_weights, that surfaces emit into the camera, straight or by
        way of mirrors, so that only the place in the pixel decides what is met. photons: emitted in the pass. missed:
        (height * width,) float32, what the excess misses where rays recall, as few rays tell (see render_pixels); None
        for nothing. known: see follow; None if nothing is followed. area: of the disks in which photons are counted,
        over that of the first pass, see follow_disks.
        """
        with self.lock:
            if self._followed:
                rest = _weighted(excess, np.zeros(self._factors.size), self.layer_weights.ravel()) - seen
                values, numbers = {"seen": seen.astype(np.float64)}, {"blur": np.array([area])}
                for part, regression in self._followed.items():
                    regression.add(values.get(part, rest), numbers.get(part, known))
            count = self.passes + 1
            means, powers = (self._mean, self._seen), (self._powers(_SEEN), self._powers(_REST))
            _accumulate(means, powers, (excess, seen), self.layer_weights.ravel(), count)
            by_region = 0.0 if missed is None else region_means(missed, regions(self.width, self.height))
            delta = by_region - self._missed
            self._missed = self._missed + delta / count
            self._missed_squares = self._missed_squares + delta * (by_region - self._missed)
            seed, first, stop = self.ranges[-1]
            self.ranges[-1] = seed, first, stop + 1
            self.passes += 1
            self.photons += photons

    def _powers(self, names: tuple[str, ...]) -> tuple[np.ndarray, ...]:
        """Sums of second to fourth powers of deviations, (pixels,) each: _SEEN or _REST."""
        return tuple(getattr(self, name) for name in names)

    def check_same_kind(self, other: Film) -> None:
        """Raise ValueError if the passes of two films cannot be of one image."""
        same_shape = (self.width, self.height) == (other.width, other.height)
        if not (same_shape and np.array_equal(self.band_edges, other.band_edges)):
            raise ValueError("Only films of the same size and bands can be merged")
        if self.reference_temperature != other.reference_temperature:
            raise ValueError(
                f"Films with different reference temperatures cannot be merged: "
                f"{self.reference_temperature:g} K and {other.reference_temperature:g} K"
            )
        if not np.array_equal(self.weights, other.weights):
            raise ValueError("Films of sensors with different responses cannot be merged")
        if self.moments != other.moments:
            raise ValueError("Films of scenes that move otherwise cannot be merged")
        mine, others = ({part: len(each.exact) for part, each in of._followed.items()} for of in (self, other))
        if mine != others:
            raise ValueError("Films of scenes with and without molecules or caustics cannot be merged")
        if to_json(self.layers) != to_json(other.layers):
            raise ValueError("Films with different temperature groups cannot be merged")

    def merge(self, other: Film) -> Film:
        """The Film of the passes of both films (Chan, Golub and LeVeque 1979; Pebay 2008).

        Raises ValueError if the films do not belong together, or if both hold the same pass: it would count twice, and
        the noise would be too small.
        """
        self.check_same_kind(other)
        options = {"weights": self.weights, "layers": self.layers}
        total = Film(self.width, self.height, self.band_edges, self.reference_temperature, **options)
        total.correction, total.estimated, total.moments = self.correction, self.estimated, self.moments
        total.expected = self.expected
        total.ranges = _joined(self.ranges + other.ranges) or self.ranges[:]
        total.passes = self.passes + other.passes
        total.photons = self.photons + other.photons
        if total.passes:
            share = other.passes / total.passes
            difference = other._mean - self._mean
            total._mean = self._mean + share * difference
            seen = other._seen - self._seen
            total._seen = self._seen + share * seen
            rest = _weighted(difference, np.zeros(self._factors.size), self.layer_weights.ravel()) - seen
            passes = self.passes, other.passes
            for names, apart in ((_SEEN, seen), (_REST, rest)):
                merged = _merged_powers(self._powers(names), other._powers(names), apart, passes)
                for name, power in zip(names, merged, strict=True):
                    setattr(total, name, power)
            total._followed = {part: each.merge(other._followed[part]) for part, each in self._followed.items()}
            missed = other._missed - self._missed
            total._missed = self._missed + share * missed
            total._missed_squares = self._missed_squares + other._missed_squares + missed**2 * self.passes * share
        return total

    def band_radiance(self, band: int) -> np.ndarray:
        """(height, width) float32 spectral radiance averaged over one band, W m-2 sr-1 um-1."""
        width = self.band_edges[band + 1] - self.band_edges[band]
        return self._image((self._excess()[:, band] + self._reference[band]) / width)

    def bands(self) -> np.ndarray:
        """(b, height, width) float32, band_radiance of every band, in one pass over the film."""
        images = np.empty((self.band_count, self.height * self.width), np.float32)
        _split(self._excess(), self._reference, np.diff(self.band_edges), images)
        return images.reshape(self.band_count, self.height, self.width)

    def layer_means(self) -> np.ndarray:
        """(pixels, layers * b) float64 excess radiance of the layers as traced, W m-2 sr-1. Do not change it."""
        return self._mean

    def radiance(self) -> np.ndarray:
        """(height, width) float32 radiance over all bands through the sensor's response, W m-2 sr-1."""
        return self._image(self._radiance())

    def temperature(self) -> np.ndarray:
        """(height, width) float32 temperature of the blackbody with the pixel's radiance, after the correction, K.

        0 K where the correction leaves no radiance, as the assumed reflection, air and optics send more than is seen.
        """
        return self._image(self._apparent(self._object_radiance()))

    def noise(self) -> np.ndarray:
        """(height, width) float32 standard error of temperature(), K. Neighbouring pixels have a say, see pooling.

        It includes what regions are known to miss, see self_check, what shrinking disks tell of their blur, see trend,
        and what is seen that is so small that no ray may have met it, see `expected`. After a single pass the error is
        unknown, and the result is the temperature itself.
        """
        if self.passes < 2:
            return self.temperature()
        radiance = self._object_radiance()
        directly, others, off = self._unfollowed()
        shape = self.height, self.width
        sums = tuple(of.reshape(shape) for of in others)
        rest = pooled_variance(*sums, self.estimated.reshape(shape), self.passes).ravel()
        planned, added, hits, resolved = self._expected()
        planned = None if self.expected is None else planned.reshape(shape)
        directly, resolved = (of.reshape(shape) for of in directly), self.passes * resolved.reshape(shape)
        seen = variance_of_edges(*directly, planned, resolved, self.passes).ravel()
        if self.moments:
            seen, rest = self._in_motion(seen, rest)
        if "blur" in self._followed:
            rest = rest * (1.0 + blur(self._followed["blur"], sums[0] / (self.passes - 1)).ravel())
        # of specks the squared radiance, times the chance that no ray has met them
        variance = (rest + seen) / self.passes + added**2 * np.exp(-hits * self.passes)
        bias = significant(self._missed, self._missed_squares, self.passes)
        if bias.any():
            variance += spread_out(bias, np.sqrt(rest / self.passes), regions(self.width, self.height)) ** 2
        variance += off**2
        error = np.sqrt(variance) / self.correction.share
        # half of the interval from one standard error below to one above: finite even where the radiance is 0
        above = self._apparent(radiance + error)
        below = self._apparent(np.maximum(radiance - error, 0.0))
        return self._image(0.5 * (above - below))

    def _expected(self) -> np.ndarray:
        """`expected`; what has no say if nothing was planned."""
        if self.expected is not None:
            return self.expected
        return np.array([0.0, 0.0, 0.0, math.inf])[:, None].repeat(self.height * self.width, axis=1)

    def _in_motion(self, seen: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The variances of what is seen and of the rest (pixels,), times what passes at few times know less.

        Passes are spread evenly over the times, as camera rays are over a pixel. So where an edge passes by, the
        variance of n passes falls as that from an edge in a pixel, n^-3/2 or faster; or slower than the spread of the
        passes tells, if it comes with the rest. But more passes than times find nothing new of the motion. And few
        times may miss what passes a pixel quickly, though not what is around it: a pixel has at least the mean of its
        neighbours.
        """
        over = self.passes / self.moments
        around = sum_around(seen.reshape(self.height, self.width), REACH).ravel() / (2 * REACH + 1) ** 2
        return np.maximum(seen, around) * max(over, 1.0) ** 1.5, rest * max(over / math.sqrt(self.moments), 1.0)

    def _unfollowed(self) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray], np.ndarray | float]:
        """Sums of squares and of fourth powers of what is seen, and of the rest, both without what follows the draws of
        spectra and the times; and how far these let the radiance be off, W m-2 sr-1. As many passes would tell them."""
        sums = [(squares, fourths) for squares, _, fourths in (self._powers(_SEEN), self._powers(_REST))]
        if "rest" not in self._followed or self._followed["rest"].freedom() < _FREEDOM:
            return *sums, 0.0
        followed, left = [self._followed[part] for part in ("seen", "rest")], []
        for (squares, fourths), each in zip(sums, followed, strict=True):
            less = (self.passes - 1) / each.freedom() * np.maximum(squares - each.explained(), 0.0)
            ratio = np.divide(less, squares, out=np.ones_like(less), where=squares > 0.0)
            left.append((less, fourths * ratio**2))
        return *left, sum(each.bias() for each in followed)

    def missed(self) -> tuple[np.ndarray, np.ndarray]:
        """What regions of the image miss where rays recall, in the mean over their pixels and all passes, and its
        standard error: (GRID, GRID) float64 each, W m-2 sr-1 through the sensor's response, row 0 at the bottom. An
        error of infinity is that of a single pass."""
        variance = self._missed_squares / max(self.passes * (self.passes - 1), 1)
        error = np.sqrt(variance) if self.passes > 1 else np.full(GRID**2, math.inf)
        return self._missed.reshape(GRID, GRID), error.reshape(GRID, GRID)

    def _apparent(self, radiance: np.ndarray) -> np.ndarray:
        return apparent_temperature(radiance, self.band_edges, self.weights)

    def _object_radiance(self) -> np.ndarray:
        return self.correction.object_radiance(self._radiance(), self.band_edges, self.weights)

    def _radiance(self) -> np.ndarray:
        return _weighted(self._excess(), self._reference, self.weights)

    def _excess(self) -> np.ndarray:
        """(pixels, b) float64 excess radiance of all layers at the temperatures of the scene, W m-2 sr-1."""
        return self._mean if len(self.layers) == 1 else _combined(self._mean, self._factors)

    def _image(self, values: np.ndarray) -> np.ndarray:
        return values.astype(np.float32).reshape(self.height, self.width)


def _joined(ranges: list[tuple[int, int, int]]) -> list[tuple[int, int, int]]:
    """Film.ranges in order, without empty ranges, adjacent ranges joined. Raises ValueError if two share a pass."""
    joined = []
    for seed, first, stop in sorted(each for each in ranges if each[1] < each[2]):
        last_seed, begin, end = joined[-1] if joined else (None, 0, 0)
        if seed == last_seed and first < end:
            raise ValueError(f"Both films hold pass {first} of seed {seed}: only different passes can be merged")
        if seed == last_seed and first == end:
            joined[-1] = seed, begin, stop
        else:
            joined.append((seed, first, stop))
    return joined


@njit(cache=True, nogil=True)
def _combined(mean, factors):
    """(pixels, b) float64 sum over layers of factor times mean (pixels, layers * b)."""
    total = np.zeros((mean.shape[0], factors.shape[1]))
    for i in range(mean.shape[0]):
        for layer in range(factors.shape[0]):
            first = layer * factors.shape[1]
            for b in range(factors.shape[1]):
                total[i, b] += factors[layer, b] * mean[i, first + b]
    return total


@njit(**KERNEL)
def _split(mean, reference, width, images):
    for i in range(mean.shape[0]):
        for b in range(mean.shape[1]):
            images[b, i] = (mean[i, b] + reference[b]) / width[b]


@njit(cache=True, nogil=True)
def _weighted(mean, reference, weights):
    """(pixels,) float64 sum over bands of weights * (mean + reference): exactly 0 where they cancel in each band."""
    total = np.zeros(mean.shape[0])
    for i in range(mean.shape[0]):
        for b in range(mean.shape[1]):
            total[i] += weights[b] * (mean[i, b] + reference[b])
    return total


def _merged_powers(mine, others, apart, passes) -> tuple[np.ndarray, ...]:
    """Sums of second to fourth powers of the deviations of two groups of passes together (Pebay 2008). mine, others: of
    the groups, of so many passes. apart: (pixels,) difference of their means."""
    (a, b), ((squares, cubes, fourths), (squares_b, cubes_b, fourths_b)) = passes, (mine, others)
    step = apart / (a + b)
    total_cubes = cubes + cubes_b + a * b * (a - b) * apart * step**2 + 3.0 * step * (a * squares_b - b * squares)
    total = fourths + fourths_b + a * b * (a * a - a * b + b * b) * apart * step**3
    total += 6.0 * step**2 * (a * a * squares_b + b * b * squares) + 4.0 * step * (a * cubes_b - b * cubes)
    return squares + squares_b + a * b * apart * step, total_cubes, total


@njit(**KERNEL)
def _accumulate(means, powers, radiance, weights, count):
    """Welford's step for the means of the bands and of what is seen, and for second to fourth powers of the deviations
    of what is seen, and of the rest of the radiance."""
    (mean, seen_mean), (of_seen, of_rest), (excess, seen) = means, powers, radiance
    share = 1.0 / count
    for i in range(excess.shape[0]):
        row = mean[i]
        rest = 0.0  # deviation of the radiance from the old mean
        for b in range(row.size):
            delta = excess[i, b] - row[b]
            row[b] += delta * share
            rest += weights[b] * delta
        delta = seen[i] - seen_mean[i]
        seen_mean[i] += delta * share
        _add_powers(of_seen, i, delta, count)
        _add_powers(of_rest, i, rest - delta, count)


@njit(**INLINED)
def _add_powers(powers, i, deviation, count):
    """Add a pass, the count-th, to the sums of powers of pixel i. deviation: from the mean before (Pebay 2008)."""
    squares, cubes, fourths = powers
    share = 1.0 / count
    step, term = deviation * share, deviation * deviation * (1.0 - share)
    fourth = term * (count * count - 3 * count + 3) + 6.0 * squares[i]
    fourths[i] += step * (step * fourth - 4.0 * cubes[i])
    cubes[i] += step * (term * (count - 2) - 3.0 * squares[i])
    squares[i] += term
