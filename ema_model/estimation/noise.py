"""The noise model: what sensors and a model that is not quite the rig's leave, in one likelihood.

A residual over its floor is cut into pieces of an eighth of a second, and each piece is taken apart into cosines of the
same energy.  There an error that lasts stands in few coefficients, and one that comes in bursts in few pieces: either
counts as the few values that it is.  A coefficient is Student's t about 0; its level, a variance in floors², is one of
its signal and octave of frequency, and is estimated with the model, above what sensors alone leave.

So a fall of the error beside a large rest that nobody knows is worth its share of that rest, and at the floor it is
worth itself (Lange, Little and Taylor, J. Am. Stat. Assoc. 84, 1989; Kennedy and O'Hagan, J. R. Stat. Soc. B 63, 2001).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.special import gammaln

Array = NDArray[np.float64]

PIECE = 256  # values: an eighth of a second at 2 kHz

# Degrees of freedom: a line or a burst of ten levels counts as four values of one level.
_FREEDOM = 4.0
# Least level, in floors²: healthy plants leave 0.3 to 0.5 of their current's floor and less of a position's.
_LEAST_LEVEL = 0.5
# Values of level 1 that a level is believed to have been seen in before.
_SEEN_BEFORE = 4.0

_CONSTANT = float(gammaln(0.5 * (_FREEDOM + 1.0)) - gammaln(0.5 * _FREEDOM) - 0.5 * np.log(_FREEDOM * np.pi))


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Of a residual (values,): where its pieces begin and end, and the signal and octave of each coefficient."""

    pieces: tuple[slice, ...]
    group: NDArray[np.intp]  # (values,)
    names: tuple[tuple[str, int], ...]  # of the groups: signal, octave

    @classmethod
    def of(cls, parts: Iterable[tuple[str, slice]]) -> NoiseModel:
        """parts: each window's signals with their rows in a residual, in its order."""
        pieces: list[slice] = []
        keys: list[tuple[str, int]] = []
        for name, rows in parts:
            count = rows.stop - rows.start
            ends = rows.start + np.linspace(0, count, max(1, round(count / PIECE)) + 1).astype(int)
            for start, stop in pairwise(ends):
                pieces.append(slice(int(start), int(stop)))
                cycles = np.arange(stop - start) * PIECE / (stop - start)  # half cycles of a whole piece
                keys += [(name, int(np.ceil(np.log2(one + 1.0)))) for one in cycles]
        names = tuple(dict.fromkeys(keys))
        place = {name: i for i, name in enumerate(names)}
        return cls(tuple(pieces), np.array([place[key] for key in keys], dtype=np.intp), names)

    def coefficients(self, values: Array) -> Array:
        """Of values (values, …) over the floor: the same shape, and the same sum of squares."""
        found = np.empty(values.shape)
        for piece in self.pieces:
            found[piece] = np.asarray(dct(values[piece], axis=0, norm="ortho"))
        return found

    def weights(self, coefficients: Array, levels: Array) -> Array:
        """What each counts in a least-squares step toward the greatest likelihood, (values,)."""
        own = levels[self.group]
        return (_FREEDOM + 1.0) / (_FREEDOM * own + coefficients**2)

    def levels(self, coefficients: Array, start: Array | None = None) -> Array:
        """The most probable level of each group, (groups,), toward which one goes from another guess."""
        count = len(self.names)
        number = np.bincount(self.group, minlength=count)
        found = np.bincount(self.group, coefficients**2, count) / number if start is None else start
        for _ in range(3):
            found = np.maximum(found, _LEAST_LEVEL)
            power = np.bincount(
                self.group, self.weights(coefficients, found) * found[self.group] * coefficients**2, count
            )
            found = (power + _SEEN_BEFORE) / (number + _SEEN_BEFORE)
        return np.maximum(found, _LEAST_LEVEL)

    def log_likelihood(self, coefficients: Array, levels: Array) -> float:
        """Of coefficients with these levels, and of the levels."""
        own = levels[self.group]
        likelihood = (
            _CONSTANT - 0.5 * np.log(own) - 0.5 * (_FREEDOM + 1.0) * np.log1p(coefficients**2 / (_FREEDOM * own))
        )
        prior = -0.5 * _SEEN_BEFORE * (np.log(levels) + 1.0 / levels)
        return float(likelihood.sum() + prior.sum())
