"""What an expression's functions become in a kernel.

All but `power` are made of plain arithmetic, so that a block of lanes vectorises.  NaN stays NaN in every one,
so that a lane that left the real numbers is seen as failed.
"""

from __future__ import annotations

import math

from ema_model.physics.elementary import clamp, decay, sine
from ema_model.physics.jit import scalar

_QUARTER = 0.5 * math.pi


@scalar
def cosine(x):
    """cos x within 1e-6 for |x| < 1e5."""
    return sine(x + _QUARTER)


@scalar
def exponential(x):
    """e^x within 1e-9 of its value: the series at x/1024, squared ten times; 0 below -745, infinite above 710."""
    r = clamp(x, -746.0, 746.0) * (1.0 / 1024.0)
    y = 1.0 + r * (1.0 / 10.0) * (1.0 + r * (1.0 / 11.0) * (1.0 + r * (1.0 / 12.0) * (1.0 + r * (1.0 / 13.0))))
    y = 1.0 + r * (1.0 / 7.0) * (1.0 + r * (1.0 / 8.0) * (1.0 + r * (1.0 / 9.0) * y))
    y = 1.0 + r * (1.0 / 4.0) * (1.0 + r * (1.0 / 5.0) * (1.0 + r * (1.0 / 6.0) * y))
    y = 1.0 + r * (1.0 + r * (1.0 / 2.0) * (1.0 + r * (1.0 / 3.0) * y))
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    y = y * y
    return y * y


@scalar
def square_root(x):
    """√x; NaN below 0."""
    return math.sqrt(x)


@scalar
def sign_of(x):
    """−1, 0 or 1."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0 * x)


@scalar
def hyperbolic_tangent(x):
    """tanh x within 1e-7."""
    e = decay(2.0 * abs(x))
    return sign_of(x) * (1.0 - e) / (1.0 + e)


@scalar
def smaller(a, b):
    """The smaller of two."""
    return a if (a < b) | (a != a) else b


@scalar
def larger(a, b):
    """The larger of two."""
    return a if (a > b) | (a != a) else b


@scalar
def limited(x, low, high):
    """x kept between low and high."""
    return smaller(larger(x, low), high)


@scalar
def power(base, exponent):
    """base ** exponent for a base from 0 on, else NaN.  A library call for each lane, and slow."""
    return math.pow(base, exponent) if base >= 0.0 else math.nan
