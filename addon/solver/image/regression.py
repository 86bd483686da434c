# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the difference between passes follows numbers that are known for each pass, and whose true mean is known.

Disks shrink from pass to pass, and have no area in the end (see trend). Passes draw what molecules absorb, and the time
at which they see what moves. Both are stratified over the passes, so that their mean comes to the truth far sooner than
the spread of the passes tells. By linear regression, a pixel's part that follows the draws and slow waves of the time
is taken out of that spread, and the regression tells how far it is off, as it tells so of the known numbers (as a
control variate does; Owen, Monte Carlo theory, methods and examples, section 8.9).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


class Regression:
    """Running regression of pixels' values on j numbers of each pass.

    exact: (j,) float64, the mean of the numbers over endless passes. passes: how many were added.
    """

    def __init__(self, pixels: int, exact: np.ndarray):
        self.exact, self.passes = np.asarray(exact, np.float64), 0
        count = len(self.exact)
        self._numbers, self._squares = np.zeros(count), np.zeros((count, count))  # mean, and sums of products
        self._values, self._products = np.zeros(pixels), np.zeros((pixels, count))

    def add(self, values: np.ndarray, numbers: np.ndarray) -> None:
        """Add a pass. values: (pixels,). numbers: (j,). Welford's step for sums of products."""
        self.passes += 1
        before, deviation = numbers - self._numbers, values - self._values
        self._numbers = self._numbers + before / self.passes
        self._values += deviation / self.passes
        after = numbers - self._numbers
        self._squares += np.outer(before, after)
        self._products += deviation[:, None] * after

    def merge(self, other: Regression) -> Regression:
        """The Regression of the passes of both (Chan, Golub and LeVeque 1979)."""
        total = Regression(len(self._values), self.exact)
        total.passes = self.passes + other.passes
        share = other.passes / max(total.passes, 1)
        numbers, values = other._numbers - self._numbers, other._values - self._values
        total._numbers, total._values = self._numbers + share * numbers, self._values + share * values
        total._squares = self._squares + other._squares + self.passes * share * np.outer(numbers, numbers)
        total._products = self._products + other._products + self.passes * share * values[:, None] * numbers
        return total

    def explained(self) -> np.ndarray:
        """(pixels,) part of the sums of squared deviations that follows the numbers."""
        return np.einsum("pj,pj->p", self._slopes(), self._products)

    def bias(self) -> np.ndarray:
        """(pixels,) how far the mean values are off because the numbers' mean is not the exact one."""
        return self._slopes() @ (self._numbers - self.exact)

    def leverage(self) -> float:
        """Variance of `bias` over the variance of a pixel's values, if these do not follow the numbers."""
        off = self._numbers - self.exact
        return float(off @ np.linalg.pinv(self._squares, hermitian=True) @ off)

    def freedom(self) -> int:
        """Degrees of freedom that are left for the spread of what does not follow the numbers."""
        return self.passes - 1 - len(self.exact)

    def _slopes(self) -> np.ndarray:
        return self._products @ np.linalg.pinv(self._squares, hermitian=True)

    def state(self) -> dict[str, np.ndarray]:
        """All that it holds, by name, for `from_state`."""
        return {name.lstrip("_"): np.asarray(value) for name, value in vars(self).items()}

    @classmethod
    def from_state(cls, state: Mapping[str, np.ndarray], pixels: int) -> Regression:
        """The Regression of a state. Raises ValueError if an array is misshapen or not finite, KeyError if one is
        missing."""
        made = cls(pixels, state["exact"])
        for name, value in vars(made).items():
            stored = state[name.lstrip("_")]
            if stored.shape != np.shape(value) or not np.isfinite(stored).all():
                raise ValueError(f"{name.lstrip('_')} of the regression is misshapen or not finite: {stored.shape}")
            setattr(made, name, int(stored) if name == "passes" else np.array(stored, np.float64))
        return made
