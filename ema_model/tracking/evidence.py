"""Evidence of a trend or a jump, flight after flight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import log_ndtr

# --- every number that decides in the tracking of flights -------------------------------------------------------------

FALSE_TREND = 0.01  # probability of a trend that is none, of a unit's whole life, all k and all looks together
ONSET_EVERY = 4  # flights between two onsets that are looked at
SLOPES = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)  # of k in a flight, spread of what a trend may be
GROWN_BY = 10  # flights before one, by which it is told how far its sensitivities have grown with k
NOISE_PRIOR = 3.0  # flights, by which the stated noise counts beside the one that is seen

JUMP_BACK = 6.0  # of the differences' spread: towards healthy, a part replaced
JUMP_ON = 12.0  # the same away from healthy, where wear itself is uneven
JUMP_LEAST = 0.02  # of k, and no less
JUMP_AFTER = 3  # flights that must follow it
JUMP_SURE = 6  # flights after which one towards healthy is looked for once more
JUMP_WINDOW = 12  # flights beside it, by which its size is judged

LEAST_FLIGHTS = 8  # usable ones, before which nothing is told
MISFIT_WINDOW, MISFIT_SHARE = 10, 0.5  # of the last flights that the model fits badly: trends are then not trusted
WORN_BEFORE = 0.05  # of k, 1 σ of what a unit or a new part has already when its first flight is seen

LONGEST = 100_000.0  # flights; what would remain longer has no end that could be told
AHEAD = (1, 2, 5, 10, 20, 50, 100, 200)  # flights within which the probability of crossing is told
SAMPLES = 2000  # of the remaining life


# --- a sudden step of k between two flights: a part replaced, or a fault that came at once ----------------------------

Array = NDArray[np.float64]


def jump(k: Array, variance: Array, common: Array, healthy: float) -> int | None:
    """The place of the first flight after a step, of the flights (n,) of one k; None where there is none.

    Only one that JUMP_AFTER flights follow is looked for, so that it is found as soon as it can be, and once more, if
    k went back towards healthy, after JUMP_SURE.  What the base parameters may add in other commands is no step: k is
    without what is known of it, common (flights, parameters) is what is not.
    """
    soon = _step(k, variance, common, JUMP_AFTER, healthy)
    if soon.sure > (JUMP_BACK if soon.back else JUMP_ON):
        return soon.at
    later = _step(k, variance, common, JUMP_SURE, healthy)
    return later.at if later.back and later.sure > JUMP_BACK else None


class _Step(NamedTuple):
    at: int  # place of the first flight after it
    sure: float  # its size over the spread
    back: bool  # towards healthy


def _step(k: Array, variance: Array, common: Array, after: int, healthy: float) -> _Step:
    """One that so many flights follow.

    Medians of as many flights on either side tell its size, less what wear adds meanwhile; the differences of the
    flights beside it tell the spread.
    """
    at = len(k) - after
    if at < after + 1:
        return _Step(at, 0.0, False)
    low, high = float(np.median(k[at - after : at])), float(np.median(k[at:]))
    first = max(0, at - JUMP_WINDOW)
    beside = np.delete(np.diff(k[first:]), at - first - 1)
    spread = max(
        1.4826 * float(np.median(np.abs(beside - np.median(beside)))),
        float(np.sqrt(2.0 * np.median(variance[first:]))),
    )
    # The median of a few differences is no slope for long; the flights before a step tell one, it itself does not.
    wear = float(np.median(beside)) if after == JUMP_AFTER else _slope(k[first:at])
    of_unit = np.linalg.norm(np.mean(common[at:], axis=0) - np.mean(common[at - after : at], axis=0))
    spread = float(np.hypot(spread * np.sqrt(JUMP_AFTER / after), of_unit))
    size = abs(high - low - after * wear)
    near = k[at - 2 : at + 2]  # medians leave it open by one
    back = abs(high - healthy) < abs(low - healthy)
    return _Step(at - 1 + int(np.argmax(np.abs(np.diff(near)))), size / spread if size > JUMP_LEAST else 0.0, back)


def _slope(k: Array) -> float:
    """Of a flight, by Theil and Sen: the median of those between any two."""
    sooner, later = np.triu_indices(len(k), 1)
    return float(np.median((k[later] - k[sooner]) / (later - sooner)))


# --- evidence for a trend of each k that may be looked at after each flight -------------------------------------------
# Without a trend k̂_t = c + s_t · u + e_t: c any constant, u the base parameters (σ = 1 each), e_t the flight's own
# noise; s_t is stated for one state of wear (`tracking.sensitivity`). With one, a slope is added from an onset on.
# The marginal likelihoods' ratio, c flat in both (the ratio is then one of the differences alone, whatever c),
# averaged over onsets and slopes, is a martingale without a trend: the probability that it ever reaches 1/α is α at
# most (Ville; Ramdas et al., Statistical Science 38, 2023, for such e-processes). The noise is the stated one, or
# what successive flights differ by where that is more.


class Evidence:
    """Of several k side by side, a flight at a time; each can begin anew."""

    def __init__(self, base: int, one_sided: ArrayLike) -> None:
        """base: how many base parameters; one_sided (k,): whether each can only grow."""
        self._one_sided = np.asarray(one_sided, dtype=bool)
        count, size = len(self._one_sided), base + 1
        self._prior = np.diag([0.0, *np.ones(base)])
        self._information = np.tile(self._prior, (count, 1, 1))
        self._seen = np.zeros((count, size))
        self._onsets = np.zeros(0)
        self._slopes = np.zeros((count, 0, size + 2))  # by onset: with the nuisances, with itself, with what is seen
        self._flights = np.zeros(count, dtype=int)
        self._first = np.full(count, np.inf)
        self._last = [(0.0, np.zeros(base), 0.0)] * count
        self._differences = np.full((2, count), NOISE_PRIOR)  # their sum, and how many

    @property
    def noise_factor(self) -> Array:
        """(k,), by which the variance that is seen exceeds the stated one; 1 at least."""
        return np.maximum(1.0, self._differences[0] / self._differences[1])

    def forget(self, i: int) -> None:
        """Begins anew with one of the k."""
        self._information[i], self._seen[i], self._slopes[i] = self._prior, 0.0, 0.0
        self._flights[i], self._first[i], self._differences[:, i] = 0, np.inf, NOISE_PRIOR

    def add(self, at: float, k: Array, variance: Array, common: Array, which: NDArray[np.int64]) -> Array:
        """The logarithms of the evidence of `which` k after a flight, in their order.

        at: its number; k̂, own variance (k,) and common (k, base parameters), of all.
        """
        if not len(self._onsets) or at >= self._onsets[-1] + ONSET_EVERY:
            self._onsets = np.append(self._onsets, at - 1.0)
            fresh = np.zeros((len(k), 1, self._slopes.shape[2]))
            self._slopes = np.concatenate([self._slopes, fresh], axis=1)
        factor = self.noise_factor[which]  # before this flight
        self._first[which] = np.minimum(self._first[which], at)
        row = np.concatenate([np.ones((len(which), 1)), common[which]], axis=1)
        over = row / variance[which, None]
        ramp = np.maximum(at - self._onsets, 0.0)
        self._information[which] += over[:, :, None] * row[:, None, :]
        self._seen[which] += over * k[which, None]
        with_slope = np.concatenate([over, np.zeros((len(which), 1)), (k / variance)[which, None]], axis=1)
        moved = ramp[None, :, None] * with_slope[:, None, :]
        moved[:, :, -2] = ramp**2 / variance[which, None]
        self._slopes[which] += moved
        self._flights[which] += 1
        inverse = np.linalg.inv(self._information[which])
        self._observe(k, variance, common, inverse, which)
        if np.all(self._flights[which] < LEAST_FLIGHTS):
            return np.zeros(len(which))
        slopes = self._slopes[which]
        projected = slopes[:, :, :-2] @ inverse
        size = np.maximum(slopes[:, :, -2] - np.sum(projected * slopes[:, :, :-2], axis=2), 0.0) / factor[:, None]
        score = (slopes[:, :, -1] - (projected @ self._seen[which][:, :, None])[:, :, 0]) / factor[:, None]
        return np.where(self._flights[which] < LEAST_FLIGHTS, 0.0, self._averaged(size, score, which))

    def _averaged(self, size: Array, score: Array, which: NDArray[np.int64]) -> Array:
        """Over onsets, the early ones heavier, and normal (or half normal) slopes of each spread."""
        order = np.cumsum(self._onsets[None, :] >= self._first[which, None] - 1.0, axis=1).astype(float)
        weight = np.where(order > 0.0, 1.0 / np.maximum(order * (order + 1.0), 1e-300), 0.0)
        tau = np.array(SLOPES)[:, None, None]
        shrunk = 1.0 + tau**2 * size
        z = tau * score / np.sqrt(shrunk)
        ratio = 0.5 * z**2 - 0.5 * np.log(shrunk)
        sided = self._one_sided[which]
        ratio[:, sided] += np.log(2.0) + log_ndtr(z[:, sided])
        with np.errstate(divide="ignore"):
            ratio += np.log(weight) - np.log(len(SLOPES))
        most = ratio.max(axis=(0, 2))
        return most + np.log(np.sum(np.exp(ratio - most[None, :, None]), axis=(0, 2)))

    def _observe(self, k: Array, variance: Array, common: Array, inverse: Array, which: NDArray[np.int64]) -> None:
        for place, i in enumerate(which):
            if self._flights[i] > 1:
                before, row, other = self._last[i]
                changed = common[i] - row
                moved = float(changed @ (inverse[place] @ self._seen[i])[1:])
                unknown = float(changed @ inverse[place][1:, 1:] @ changed)
                self._differences[0, i] += (k[i] - before - moved) ** 2 / (variance[i] + other + unknown)
                self._differences[1, i] += 1.0
            self._last[i] = float(k[i]), common[i], float(variance[i])
