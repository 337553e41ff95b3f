"""What all flights of a unit, and all its k, tell of its base parameters: what these add can then be taken out of k̂.

k̂_t = x_t + s_t · u + e_t (`tracking.flight`), with the same u in every flight and in all eight k.  Commands and loads
change s_t, so that flights beside each other differ by u; and each part had begun little worn, so that what all k̂
stood off by at first is mostly u's.  A Kalman filter follows the levels x, their drifts, where they began, and u.  It
knows no law of wear: flights may wear very unevenly, and a level may step.

s_t also changes with wear, which no u may explain (`tracking.sensitivity`): what counts is s of a part's first flights
and how a flight's differs from those of the last ones; of a k whose sensitivity grows with it, the first alone.
"""

from __future__ import annotations

from collections import deque
from copy import copy

import numpy as np
from numpy.typing import NDArray

from ema_model.physics.jit import recursion
from ema_model.tracking.evidence import WORN_BEFORE
from ema_model.tracking.sensitivity import growth

Array = NDArray[np.float64]

FIRST = 10  # flights of a part, by which its sensitivities at first are told
_LAST = 20  # flights, from whose mean a flight's sensitivities differ by command and load
_ANYWHERE = 1.0  # of k, 1 σ of a level of which nothing is known yet
_DRIFT = 0.01  # of k in a flight, the same of a drift
# In a flight a level strays by so many of its drifts (the harder ones wear more, and differ in s_t as well: what they
# wear must not pass for what u adds), and by so much of k without one; and so does a drift itself.
_UNEVEN, _CREEP = 4.0, 3e-4
_TURNS, _TURN = 0.1, 2e-5
_STEP = 2.5  # σ, beyond which a level has stepped
_LINEAR = 0.05  # what a base parameter adds is as stated but for such a share
_TOLD = 0.1  # σ of a tolerance, and no better is u told by however many flights, as all is linear only nearly
_TOGETHER = 0.6  # of WORN_BEFORE, 1 σ of what all parts of a unit had worn more or less than is usual
_HALF_MEAN, _HALF_SIGMA = np.sqrt(2.0 / np.pi), np.sqrt(1.0 - 2.0 / np.pi)  # of what is normal, but not below 0


class Unit:
    """Takes one flight after another; `known` tells of u."""

    def __init__(self, base: int, one_sided: NDArray[np.bool_], healthy: Array) -> None:
        """base: how many base parameters; one_sided, healthy (k,): whether each only grows, and where it begins."""
        self._count = count = len(healthy)
        worn_before = WORN_BEFORE * (1.0 - healthy)  # of the way that there is
        self._begun = healthy + np.where(one_sided, worn_before * _HALF_MEAN, 0.0)
        together = _TOGETHER * worn_before * one_sided
        alone = worn_before * np.where(one_sided, _HALF_SIGMA, 1.0)
        self._begun_covariance = np.diag(alone**2) + np.outer(together, together)
        size = 3 * count + base
        self._mean = np.zeros(size)  # levels, drifts, where each began, u
        self._covariance = np.eye(size)
        for i in range(count):
            self._unknown(i, float(healthy[i]))
        self._differs = growth(np.ones(count)) == 1.0
        self._flights = np.zeros(count)  # of each part
        self._first = np.zeros((count, base))  # the mean of its first ones' sensitivities
        self._last: deque[Array] = deque(maxlen=_LAST)
        self._at = np.nan

    def copy(self) -> Unit:
        """As it is now; flights that this one takes do not change it."""
        other = copy(self)
        other._mean, other._covariance, other._last = self._mean.copy(), self._covariance.copy(), self._last.copy()
        other._flights, other._first = self._flights.copy(), self._first.copy()
        return other

    def add(self, at: float, k: Array, own: Array, common: Array) -> None:
        """The flight's number; k̂ (k,), own covariance (k, k), common (k, base parameters)."""
        self._last.append(common)
        self._flights += 1.0
        first = self._flights <= FIRST
        self._first[first] += (common[first] - self._first[first]) / self._flights[first, None]
        rows = np.zeros((self._count, len(self._mean)))
        rows[:, : self._count] = np.eye(self._count)
        differs = common - np.mean(self._last, axis=0)
        rows[:, 3 * self._count :] = self._first + np.where(self._differs[:, None], differs, 0.0)
        own = own + np.diag((_LINEAR * np.linalg.norm(common, axis=1)) ** 2 + 1e-12)
        if not np.isnan(self._at):
            _ahead(self._mean, self._covariance, self._count, at - self._at)
        self._at = at
        gap = k - rows @ self._mean
        expected = np.sum((rows @ self._covariance) * rows, axis=1) + np.diag(own)
        places = np.arange(self._count)
        self._covariance[places, places] += np.where(gap**2 > _STEP**2 * expected, gap**2, 0.0)
        root = np.linalg.inv(np.linalg.cholesky(own))
        _see(self._mean, self._covariance, root @ rows, root @ k)

    def replaced(self, i: int) -> None:
        """Before the flight in which a part is new to us: where the last one began is taken up, the level is any."""
        self._mean, self._covariance = self._with([i])
        self._unknown(i, float(self._mean[2 * self._count + i]))
        self._flights[i], self._first[i] = 0.0, 0.0

    def known(self, apart: tuple[int, ...] = ()) -> tuple[Array, Array]:
        """Mean and covariance of u; where the parts of these k began counts as not known."""
        mean, covariance = self._with([i for i in range(self._count) if i not in apart])
        base = slice(3 * self._count, None)
        return mean[base], covariance[base, base] + _TOLD**2 * np.eye(len(mean[base]))

    def _with(self, parts: list[int]) -> tuple[Array, Array]:
        """What is known once it is said that these parts had begun little worn."""
        places = [2 * self._count + i for i in parts]
        to = self._covariance[:, places]
        gain = np.linalg.solve(to[places] + self._begun_covariance[np.ix_(parts, parts)], to.T).T
        return self._mean + gain @ (self._begun[parts] - self._mean[places]), self._covariance - gain @ to.T

    def _unknown(self, i: int, about: float) -> None:
        level, drift, begun = i, self._count + i, 2 * self._count + i
        for place in (level, drift, begun):
            self._covariance[place], self._covariance[:, place] = 0.0, 0.0
        self._mean[[level, begun]], self._mean[drift] = about, 0.0
        self._covariance[np.ix_([level, begun], [level, begun])] = _ANYWHERE**2
        self._covariance[drift, drift] = _DRIFT**2


@recursion
def _ahead(mean, covariance, count, ahead):  # pragma: no cover (compiled)
    """In place: so many flights later."""
    size = len(mean)
    for i in range(count):
        drift = count + i
        mean[i] += ahead * mean[drift]
        for j in range(size):
            covariance[i, j] += ahead * covariance[drift, j]
        for j in range(size):
            covariance[j, i] += ahead * covariance[j, drift]
        worn = abs(mean[drift])
        covariance[i, i] += ahead * ((_UNEVEN * worn) ** 2 + _CREEP**2)
        covariance[drift, drift] += ahead * ((_TURNS * worn) ** 2 + _TURN**2)


@recursion
def _see(mean, covariance, rows, seen):  # pragma: no cover (compiled)
    """In place: what is seen (k,), of unit variance, by rows (k, state); the covariance is symmetric."""
    size, to = len(mean), np.empty(len(mean))
    for row in range(len(seen)):
        to[:] = 0.0
        for i in range(size):
            for j in range(size):
                to[j] += covariance[i, j] * rows[row, i]
        total, gap = 1.0, seen[row]
        for i in range(size):
            total += rows[row, i] * to[i]
            gap -= rows[row, i] * mean[i]
        gap /= total
        for i in range(size):
            mean[i] += to[i] * gap
            for j in range(size):
                covariance[i, j] -= to[i] * to[j] / total
