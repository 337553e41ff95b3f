"""Orders: how a residual repeats with each turn of the motor.

A part of the residual that goes A sin(h θ + φ) has the order h.  The turn is seldom evenly covered, so sines and
cosines are not orthogonal on the samples and a Fourier sum would leak between orders: all are fitted together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from ema_model.comparison.curves import HIGHEST_ORDER, harmonics, orders_in
from ema_model.comparison.explain import advance_of, used_blocks
from ema_model.comparison.residuals import Residuals

Array = NDArray[np.float64]

_RIDGE = 1e-3  # of the number of samples: directions that the angles hardly cover do not blow up
_AROUND = 25  # orders, over which noise is as strong
_MEDIAN_CHI2 = 2.0 * np.log(2.0)  # of 2 degrees of freedom
_LEVEL = 0.01  # of recordings in which noise would show an order


@dataclass(frozen=True)
class Order:
    """A sin(order·θ + phase), θ the motor's angle."""

    order: float  # periods in each turn, whole; in 2π m of a linear axis, any number
    amplitude: float  # in the signal's unit
    phase: float  # rad
    significance: float  # χ² of 2 degrees of freedom that noise of the same colour would give 2 of, on average

    def is_significant(self, tried: int = HIGHEST_ORDER, level: float = _LEVEL) -> bool:
        """Whether noise would reach this in less than `level` of the cases, with `tried` orders to choose from."""
        return self.significance > 2.0 * np.log(max(1, tried) / level)


def residual_orders(residuals: Residuals, signal: str) -> list[Order]:
    """The significant orders of a signal's residual, strongest first; none where the motor's angle is not known."""
    used = used_blocks(residuals, signal)
    angle = residuals.variables.get("motor_angle")
    if used is None or angle is None or not np.all(np.isfinite(angle[used.chosen])):
        return []
    found = orders(angle[used.chosen], used.values, residuals.turns, advance_of(residuals, used))
    return [one for one in found if one.is_significant()]


def orders(angle: Array, values: Array, turns: float, advance: Array | None = None) -> list[Order]:
    """The orders that so many turns can show, strongest first.

    angle, values: (samples,), rad and the signal's unit; advance: the turn during a sample, rad.
    """
    tried = orders_in(turns, advance)[: max(0, (len(angle) - 2) // 4)]
    if not len(tried):
        return []
    columns = np.column_stack([np.ones(len(angle)), harmonics(angle, tried, advance)])
    gram = columns.T @ columns
    scale = float(np.mean(np.diag(gram)[1:]))
    inverse = np.linalg.inv(gram + 2.0 * _RIDGE * scale * np.diag([0.0, *np.ones(2 * len(tried))]))
    coefficients = inverse @ (columns.T @ values)
    left = values - columns @ coefficients
    freedom = max(1.0, len(values) - float(np.sum(inverse * gram)))
    covariance = inverse @ gram @ inverse * max(float(left @ left) / freedom, 1e-300)
    pairs = [slice(2 * j + 1, 2 * j + 3) for j in range(len(tried))]
    white = np.array([float(coefficients[at] @ np.linalg.solve(covariance[at, at], coefficients[at])) for at in pairs])
    found = []
    for h, at, chi2 in zip(tried, pairs, white / colour(white)):
        a, b = coefficients[at]
        found.append(Order(int(h), float(np.hypot(a, b)), float(np.arctan2(b, a)), float(chi2)))
    return sorted(found, key=lambda order: -order.amplitude)


def colour(chi2: Array) -> Array:
    """How many times stronger than white noise the noise is around each order, at least 1.

    The median over neighbouring orders does not see those few that stand out.
    """
    around = median_filter(chi2, size=min(_AROUND, len(chi2)), mode="nearest")
    return np.maximum(1.0, around / _MEDIAN_CHI2)
