"""Orders: how a residual repeats with each turn of the motor.

A part of the residual that goes A sin(h θ + φ) has the order h.  The turn is seldom evenly covered, so sines and
cosines are not orthogonal on the samples and a Fourier sum would leak between orders: all are fitted together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.curves import HIGHEST_ORDER, harmonics, orders_in
from ema_model.comparison.explain import advance_of, used_blocks
from ema_model.comparison.residuals import Residuals

Array = NDArray[np.float64]

_RIDGE = 1e-3  # of the number of samples: directions that the angles hardly cover do not blow up
_LEVEL = 0.01  # of recordings in which noise would show an order


@dataclass(frozen=True)
class Order:
    """A sin(order·θ + phase), θ the motor's angle."""

    order: int  # periods in each turn
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

    angle, values: (samples,), rad and the signal's unit, in the order of time (their autocorrelation widens the
    error); advance: the turn during a sample, rad.
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
    variance = float(left @ left) / freedom * correlation_factor(left)
    covariance = inverse @ gram @ inverse * max(variance, 1e-300)
    found = []
    for j, h in enumerate(tried):
        at = slice(2 * j + 1, 2 * j + 3)
        a, b = coefficients[at]
        chi2 = float(coefficients[at] @ np.linalg.solve(covariance[at, at], coefficients[at]))
        found.append(Order(int(h), float(np.hypot(a, b)), float(np.arctan2(b, a)), chi2))
    return sorted(found, key=lambda order: -order.amplitude)


def correlation_factor(values: Array) -> float:
    """How many times a correlated series' mean varies more than a white one's would: 1 + 2 Σ ρ.

    The sum stops at the first pair of lags whose correlations add to nothing (Geyer's rule).
    """
    n = len(values)
    centred = values - np.mean(values)
    spectrum = np.fft.rfft(centred, 2 * n)
    correlation = np.fft.irfft(spectrum * spectrum.conj())[: max(2, n // 4)]
    if not correlation[0] > 0.0:
        return 1.0
    rho = correlation / correlation[0]
    pairs = rho[1 : len(rho) - (len(rho) + 1) % 2].reshape(-1, 2).sum(axis=1)
    # White noise alone has |ρ| of 1/√n: what stands out less is none.
    small = np.flatnonzero(pairs < 2.0 * np.sqrt(2.0 / n))
    stop = int(small[0]) if len(small) else len(pairs)
    return float(max(1.0, 1.0 + 2.0 * np.sum(pairs[:stop])))
