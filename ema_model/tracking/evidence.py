"""Evidence for a trend of one k that may be looked at after each flight.

Without a trend k̂_t = c + s_t · u + e_t: c any constant, u the base parameters (σ = 1 each), e_t the flight's own noise.
With one, a slope is added from an onset on.  The marginal likelihoods' ratio, c flat in both (the ratio is then one of
the differences alone, whatever c), averaged over onsets and slopes, is a martingale without a trend: the probability
that it ever reaches 1/α is α at most (Ville; Ramdas et al., Statistical Science 38, 2023, for such e-processes).
The noise is the stated one, or what successive flights differ by where that is more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from ema_model.tracking.criteria import LEAST_FLIGHTS, NOISE_PRIOR, ONSET_EVERY, SLOPES

Array = NDArray[np.float64]


class Evidence:
    """Of one k, a flight at a time."""

    def __init__(self, base: int, one_sided: bool) -> None:
        """base: how many base parameters; one_sided: whether k can only grow."""
        self.one_sided = one_sided
        self.flights = 0
        size = base + 1
        self._information = np.diag([0.0, *np.ones(base)])
        self._seen = np.zeros(size)
        self._onsets = np.zeros(0)
        self._slopes = np.zeros((0, size + 2))  # by onset: with the nuisances, with itself, with what is seen
        self._first = 0.0
        self._last: tuple[float, Array, float] | None = None
        self._differences, self._count = NOISE_PRIOR, NOISE_PRIOR

    @property
    def noise_factor(self) -> float:
        """By which the variance that is seen exceeds the stated one; 1 at least."""
        return max(1.0, self._differences / self._count)

    def add(self, at: float, k: float, variance: float, common: Array) -> float:
        """The logarithm of the evidence after a flight: its number, k̂, own variance and common (base parameters,)."""
        if self.flights == 0:
            self._first = at
        if at >= self._first + ONSET_EVERY * len(self._onsets):
            self._onsets = np.append(self._onsets, at - 1.0)
            self._slopes = np.vstack([self._slopes, np.zeros(self._slopes.shape[1])])
        factor = self.noise_factor  # before this flight
        row = np.concatenate([[1.0], common])
        ramp = np.maximum(at - self._onsets, 0.0)
        self._information += np.outer(row, row) / variance
        self._seen += row * k / variance
        self._slopes += ramp[:, None] * np.concatenate([row, [0.0, k]]) / variance
        self._slopes[:, -2] += ramp**2 / variance
        self.flights += 1
        inverse = np.linalg.inv(self._information)
        self._observe(k, variance, common, inverse)
        if self.flights < LEAST_FLIGHTS:
            return 0.0
        with_nuisances = self._slopes[:, :-2]
        projected = with_nuisances @ inverse
        size = np.maximum(self._slopes[:, -2] - np.sum(projected * with_nuisances, axis=1), 0.0) / factor
        score = (self._slopes[:, -1] - projected @ self._seen) / factor
        return self._averaged(size, score)

    def _averaged(self, size: Array, score: Array) -> float:
        """Over onsets, the early ones heavier, and normal (or half normal) slopes of each spread."""
        tau = np.array(SLOPES)[:, None]
        shrunk = 1.0 + tau**2 * size
        ratio = -0.5 * np.log(shrunk) + 0.5 * (tau * score) ** 2 / shrunk
        if self.one_sided:
            ratio += np.log(2.0) + log_ndtr(tau * score / np.sqrt(shrunk))
        order = np.arange(len(size)) + 1.0
        ratio -= np.log(order * (order + 1.0)) + np.log(len(SLOPES))
        most = float(ratio.max())
        return most + float(np.log(np.sum(np.exp(ratio - most))))

    def _observe(self, k: float, variance: float, common: Array, inverse: Array) -> None:
        if self._last is not None:
            before, row, other = self._last
            moved = float((common - row) @ (inverse @ self._seen)[1:])
            unknown = float((common - row) @ inverse[1:, 1:] @ (common - row))
            self._differences += (k - before - moved) ** 2 / (variance + other + unknown)
            self._count += 1.0
        self._last = k, common, variance
