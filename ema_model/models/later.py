"""Signals a little later than they are, by Taylor's series about each sample."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def later(values: Array, late_s: Array, period_s: float, *, smooth: bool = False) -> Array:
    """Signals (n, samples) so much later, (n, 1): to the first order; of smooth ones to the second."""
    if not np.any(late_s):
        return values
    with np.errstate(invalid="ignore", over="ignore"):  # of one that diverges
        slope = np.gradient(values, period_s, axis=1)
        shifted = values - late_s * slope
        return shifted + 0.5 * late_s**2 * np.gradient(slope, period_s, axis=1) if smooth else shifted
