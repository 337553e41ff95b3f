"""Least squares judged on stretches of time that were left out of the fit.

Neighbouring blocks are alike, so whole stretches are left out, never single blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FOLDS = 5
_STRETCHES = 50  # over which the folds are shared out
_SHORTEST = 10  # blocks in a stretch
_RIDGE = 1e-6  # of the mean power of a column


@dataclass(frozen=True, eq=False)
class Folds:
    """Which stretch, and which fold, each block belongs to: (blocks,) each."""

    stretch: NDArray[np.intp]
    fold: NDArray[np.intp]

    def sums(self, values: Array) -> Array:
        """Sum of the values in each stretch, (stretches,)."""
        return np.bincount(self.stretch, values, int(self.stretch.max()) + 1).astype(np.float64)


def share_out(run: NDArray[np.intp], *, independent: bool = False) -> Folds:
    """Stretches of equal length that do not cross from one run to the next, dealt to the folds.

    Dealt in a shuffled order, since taking every fifth could beat against a periodic command.
    independent: blocks have no order in time, and each is a stretch.
    """
    length = 1 if independent else max(_SHORTEST, len(run) // _STRETCHES)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(run)) + 1])
    position = np.arange(len(run)) - np.repeat(starts, np.diff([*starts, len(run)]))
    label = np.cumsum(position % length == 0) - 1
    count = int(label[-1]) + 1
    random = np.random.default_rng(0)
    dealt = np.concatenate([random.permutation(FOLDS) for _ in range(-(-count // FOLDS))])[:count]
    return Folds(label.astype(np.intp), dealt[label].astype(np.intp))


@dataclass(frozen=True, eq=False)
class Given:
    """Columns that every fit has; a prior of variance 1 pulls their coefficients toward `prior`."""

    columns: Array  # (blocks, given)
    prior: Array  # (given,)
    room: tuple[Array, Array]  # (given,) each, least and greatest coefficients


def nothing_given(blocks: int) -> Given:
    """No such columns."""
    return Given(np.zeros((blocks, 0)), np.zeros(0), (np.zeros(0), np.zeros(0)))


class LeftOut:
    """Normal equations of y ≈ G g + X c, kept per fold, so that leaving one out costs no pass over the data.

    G are the given columns; gains are what X tells beyond them.
    """

    def __init__(self, columns: Array, y: Array, folds: Folds, given: Given) -> None:
        self.columns = np.concatenate([given.columns, columns], axis=1)
        self.y, self.folds, self.given = y, folds, given
        self._members = [folds.fold == fold for fold in range(FOLDS)]
        self._grams = np.stack([self.columns[member].T @ self.columns[member] for member in self._members])
        self._moments = np.stack([self.columns[member].T @ y[member] for member in self._members])

    def equations(self, fold: int | None) -> tuple[Array, Array]:
        """Gram matrix, with its ridge, and moments of all folds but this one (None: of all)."""
        gram, moment = self._grams.sum(axis=0), self._moments.sum(axis=0)
        share = 1.0
        if fold is not None:
            gram, moment = gram - self._grams[fold], moment - self._moments[fold]
            share = 1.0 - 1.0 / FOLDS
        n = len(self.given.prior)
        own = np.diag(gram)[n:]
        ridge = _RIDGE * float(np.mean(own)) if own.size else 0.0
        gram = gram + ridge * np.eye(len(gram))
        moment = moment.copy()
        gram[:n, :n] += share * np.eye(n)
        moment[:n] += share * self.given.prior
        return gram, moment

    def gains(self, choices: list[NDArray[np.intp]] | None = None, *, bounded: bool = False) -> Array:
        """What X takes off the squared error of each stretch where it was left out, beyond the given columns.

        choices: columns of X to take for each fold; all, without them.  bounded: keep the given columns'
        coefficients within their room, which takes ten times as long.
        """
        n = len(self.given.prior)
        fixed = np.arange(n)
        every = [np.arange(self.columns.shape[1] - n)] * FOLDS
        left = self._errors([np.concatenate([fixed, n + chosen]) for chosen in choices or every], bounded)
        return self.folds.sums(self._errors([fixed] * FOLDS, bounded) ** 2 - left**2)

    def _errors(self, choices: list[NDArray[np.intp]], bounded: bool) -> Array:
        errors = self.y.copy()
        for fold, (member, chosen) in enumerate(zip(self._members, choices)):
            if len(chosen):
                gram, moment = self.equations(fold)
                solve = self._within if bounded else np.linalg.solve
                coefficients = solve(gram[np.ix_(chosen, chosen)], moment[chosen])
                errors[member] -= self.columns[np.ix_(member, chosen)] @ coefficients
        return errors

    def _within(self, gram: Array, moment: Array) -> Array:
        """The coefficients, those of the given columns, which come first, within their room."""
        from scipy.optimize import lsq_linear  # takes a third of a second to import

        n = len(self.given.prior)
        free = np.full(len(moment) - n, np.inf)
        scale = 1.0 / np.sqrt(np.diag(gram))
        root = np.linalg.cholesky(gram * np.outer(scale, scale) + 1e-9 * np.eye(len(gram)))
        target = np.linalg.solve(root, moment * scale)
        low, high = (np.concatenate([side, way * free]) / scale for side, way in zip(self.given.room, (-1.0, 1.0)))
        return lsq_linear(root.T, target, (low - 1e-12, high + 1e-12), method="bvls").x * scale

    def pursue(self, fold: int | None, pairs: int) -> list[int]:
        """Pairs of columns (0, 1), (2, 3), … of X that reduce the error most, one after another, a fold left out.

        Orthogonal matching pursuit; returns the pairs' numbers from 0, best first.
        """
        matrix, moment = self.equations(fold)
        n = len(self.given.prior)
        count = (len(matrix) - n) // 2
        first, second = n + np.arange(0, 2 * count, 2), n + np.arange(1, 2 * count, 2)
        picked: list[int] = []
        fixed = list(range(n))
        for _ in range(min(pairs, count)):
            left, rest = matrix, moment
            if fixed:
                inner = np.linalg.solve(matrix[np.ix_(fixed, fixed)], np.column_stack([matrix[fixed], moment[fixed]]))
                left = matrix - matrix[:, fixed] @ inner[:, :-1]
                rest = moment - matrix[:, fixed] @ inner[:, -1]
            a, b, c = left[first, first], left[first, second], left[second, second]
            x, z = rest[first], rest[second]
            # A pair that those before already span has nothing of its own to add: what is left of it is rounding.
            spanned = a + c < 1e-2 * (matrix[first, first] + matrix[second, second])
            determinant = np.maximum(a * c - b * b, 1e-12 * (np.abs(a * c) + 1e-300))
            gain = (c * x * x - 2.0 * b * x * z + a * z * z) / np.where(spanned, np.inf, determinant)
            gain[spanned] = -np.inf
            gain[picked] = -np.inf
            best = int(np.argmax(gain))
            if not np.isfinite(gain[best]):
                break
            picked.append(best)
            fixed += [n + 2 * best, n + 2 * best + 1]
        return picked
