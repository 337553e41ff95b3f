"""Speed and acceleration of a measured position, and the filter that they have passed.

Local parabolas (Savitzky–Golay) give the acceleration; what smoothing that implies is known exactly: the
acceleration of a motion filtered by h, where h is the twice summed kernel of the second difference.  All that is
held against the acceleration passes the same h, so that a comparison is free of the filter's own error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """Filtered position (rad), speed (rad/s) and acceleration (rad/s²), (samples,) each, on an even grid."""

    position: Array
    speed: Array
    acceleration: Array
    kernel: Array  # h, sums to 1

    def filtered(self, values: Array) -> Array:
        """Values (…, samples) through h, the ends held."""
        return _convolved(values, self.kernel)


def motion_of(position: Array, period_s: float, half_s: float) -> Motion:
    """The motion of a run, sampled every period_s; half_s: half width of the parabolas, s."""
    from scipy.signal import savgol_coeffs  # takes a third of a second to import

    half = max(2, round(half_s / period_s))
    half = max(1, min(half, (position.size - 1) // 2 - 1))
    size = 2 * half + 1
    second = savgol_coeffs(size, 2, deriv=2, delta=period_s, use="conv")
    kernel = np.cumsum(np.cumsum(second))[:-2] * period_s**2
    kernel /= kernel.sum()
    first = np.convolve([0.5 / period_s, 0.0, -0.5 / period_s], kernel)
    return Motion(
        position=_convolved(position, kernel),
        speed=_convolved(position, first),
        acceleration=_convolved(position, second),
        kernel=kernel,
    )


def _convolved(values: Array, kernel: Array) -> Array:
    """The middle part of a convolution along the last axis; beyond the ends the line goes straight on."""
    from scipy.signal import fftconvolve

    reach = kernel.size // 2
    first, last = values[..., :1], values[..., -1:]
    before = 2.0 * first - values[..., reach:0:-1]
    after = 2.0 * last - values[..., -2 : -reach - 2 : -1]
    padded = np.concatenate([before, values, after], axis=-1)
    shape = (1,) * (values.ndim - 1) + (-1,)
    return fftconvolve(padded, kernel.reshape(shape), mode="valid", axes=-1)
