"""The white noise of a recorded signal, from the signal itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ema_model.quantities.signals import SIGNALS

Array = NDArray[np.float64]

# What no sensor and no simulation resolves, by the kind of signal, in its unit: the noise of one that hardly tells its
# own, because it was calculated or does not change.
_FINEST = {"position": 1e-9, "speed": 1e-6, "current": 1e-6, "torque": 1e-8}


def sample_noise(values: Array, signal: str) -> float:
    """White noise and quantisation of a signal (samples,), rms.

    From its third differences, which a smooth motion lacks: the median of their size is blind to steps and
    reversals.  A signal that hardly ever changes gives the step of its quantisation, s/√12.  Never 0: a floor is
    what errors are counted in.
    """
    third = np.diff(values, 3)
    robust = 1.4826 * float(np.median(np.abs(third))) / np.sqrt(20.0)  # 1 + 9 + 9 + 1
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-12 * (1.0 + np.max(np.abs(values)))]
    repeated = len(steps) < 0.9 * (len(values) - 1)  # held values are the mark of quantisation
    quantum = float(np.min(steps)) / np.sqrt(12.0) if repeated and len(steps) else 0.0
    return max(robust, quantum, least_noise(signal))


def least_noise(signal: str) -> float:
    """The least that a signal's noise can be, in its unit; above 0."""
    return _FINEST[SIGNALS[signal].kind]
