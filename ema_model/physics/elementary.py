"""Elementary functions that LLVM can vectorise (the library's sin and exp are one call per lane)."""

from __future__ import annotations

import math

import numpy as np

from ema_model.physics.jit import scalar

_TURNS = 0.5 / math.pi
# sin 2πw for |w| ≤ ¼
_SINE_1 = 6.283164044127185
_SINE_3 = -41.33714234371979
_SINE_5 = 81.34076785339295
_SINE_7 = -70.99342237081245


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
    """sin x within 1e-6 for |x| < 1e5: folded into a quarter turn either way, then a minimax polynomial."""
    turns = x * _TURNS + 0.25
    w = 0.25 - abs(turns - np.floor(turns) - 0.5)
    q = w * w
    return w * (_SINE_1 + q * (_SINE_3 + q * (_SINE_5 + q * _SINE_7)))


@scalar
def decay(x):
    """e^{−x} within 2e-8 (absolute) for x ≥ 0: four terms of the series at x/64, squared six times."""
    r = -clamp(x, 0.0, 40.0) * (1.0 / 64.0)
    y = 1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0))))
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
