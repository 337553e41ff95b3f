"""Intervals of a number that cannot be negative, from an estimate that can lie anywhere.

An interval k̂ ± 1.645 σ cut off at 0 covers a true 0 too often, and one that follows the data alone too seldom.
G. J. Feldman and R. D. Cousins, Unified approach to the classical statistical analysis of small signals, Phys. Rev.
D 57 (1998) 3873–3889, order the outcomes by their likelihood against the best that is allowed, which covers each
true value equally often.  Everything here is in units of σ.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import i0e

from ema_model.quantities.numbers import HALF_90

Array = NDArray[np.float64]

_FAR = 6.0  # from here on the bound is not felt
_STEP = 0.02


def above_zero(estimate: float) -> tuple[float, float]:
    """90 % interval of μ ≥ 0 from an estimate that is normal about μ, σ = 1."""
    return _interval("normal", estimate)


def length_of_vector(estimate: float) -> tuple[float, float]:
    """90 % interval of the length of a vector in the plane from the length of its estimate, σ = 1 along each axis."""
    return _interval("rice", max(estimate, 0.0))


def _interval(kind: str, estimate: float) -> tuple[float, float]:
    if estimate >= _FAR:
        return estimate - HALF_90, estimate + HALF_90
    truth, low, high = _belt(kind)
    at = max(estimate, float(low[0]) + 1e-9)
    # the truths that would have given this estimate among their likely ones
    inside = truth[(low <= at) & (at <= high)]
    return float(inside[0]) if inside[0] > truth[0] else 0.0, float(inside[-1])


@lru_cache(maxsize=2)
def _belt(kind: str) -> tuple[Array, Array, Array]:
    """For truths μ (n,): the ends of the likely outcomes, 90 % of them, by the order of the likelihood ratio."""
    truth = np.arange(0.0, _FAR + 4.0, _STEP)
    outcome = np.arange(-4.0 if kind == "normal" else _STEP / 2, _FAR + 9.0, _STEP)
    m, x = truth[:, None], outcome[None, :]
    if kind == "normal":
        likelihood = np.exp(-0.5 * (x - m) ** 2)
    else:
        likelihood = x * np.exp(-0.5 * (x - m) ** 2) * i0e(x * m)
    ratio = likelihood / likelihood.max(axis=0)
    probability = likelihood / likelihood.sum(axis=1, keepdims=True)
    order = np.argsort(-ratio, axis=1, kind="stable")
    taken = np.cumsum(np.take_along_axis(probability, order, axis=1), axis=1)
    count = np.argmax(taken >= 0.9, axis=1) + 1
    ends = [(outcome[order[i, : count[i]]].min(), outcome[order[i, : count[i]]].max()) for i in range(len(truth))]
    low, high = np.array(ends).T
    return truth, np.where(low <= outcome[0], -np.inf, low), high
