"""Elementary functions that LLVM can vectorise (the library's sin and exp are one call per lane)."""

from __future__ import annotations

import math

import numpy as np

from ema_model.numba_options import scalar

_PI = math.pi
_INVERSE_PI = 1.0 / math.pi


@scalar
def clamp(x, low, high):
    """x kept between low and high; NaN stays NaN.  (In this form each line is one machine instruction.)"""
    raised = low if x < low else x
    return high if raised > high else raised


@scalar
def sign(x):
    """−1, 0 or 1."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)


@scalar
def sine(x):
    """sin x within 1e-9 for |x| < 1e5: reduction by multiples of π, then the series to x¹³."""
    turns = np.floor(x * _INVERSE_PI + 0.5)
    r = x - turns * _PI
    q = r * r
    series = r * (
        1.0
        + q
        * (
            -1.0 / 6.0
            + q
            * (
                1.0 / 120.0
                + q * (-1.0 / 5040.0 + q * (1.0 / 362880.0 + q * (-1.0 / 39916800.0 + q * (1.0 / 6227020800.0))))
            )
        )
    )
    odd = turns - 2.0 * np.floor(0.5 * turns)
    return series * (1.0 - 2.0 * odd)


@scalar
def decay(x):
    """e^{−x} within 1e-8 (absolute) for x ≥ 0: the series at x/64, squared six times; 0 beyond x = 40."""
    r = -clamp(x, 0.0, 40.0) * (1.0 / 64.0)
    y = 1.0 + r * (
        1.0
        + r
        * (
            0.5
            + r
            * (
                1.0 / 6.0
                + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0 + r * (1.0 / 5040.0 + r * (1.0 / 40320.0)))))
            )
        )
    )
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    return y * y


@scalar
def rotate(s, c, angle):
    """(sin, cos) turned by a small angle, |angle| < 0.1, within 2e-11 a step.

    The series go so far that the norm drifts by rounding alone (1e-11 in a million steps), which is
    cheaper than to renormalise.
    """
    q = angle * angle
    ds = angle * (1.0 - q * (1.0 / 6.0 - q * (1.0 / 120.0)))
    dc = q * (0.5 - q * (1.0 / 24.0 - q * (1.0 / 720.0)))
    return s - s * dc + c * ds, c - c * dc - s * ds
