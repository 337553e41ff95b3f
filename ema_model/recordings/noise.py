"""The white noise of a recorded signal, from the signal itself."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray

from ema_model.quantities.signals import SIGNALS

Array = NDArray[np.float64]

# What no sensor and no simulation resolves, by the kind of signal, in its unit: the noise of one that hardly tells its
# own, because it was calculated or does not change.
_FINEST = {"position": 1e-9, "speed": 1e-6, "current": 1e-6, "torque": 1e-8, "force": 1e-6}

_ORDERS = range(3, 9)  # of the differences: a smooth motion has no third ones, but where it is sampled slowly
_LEVEL = 0.98  # of an order's noise, that the next order's must reach: noise is white, and motion is not
_PIECE, _SLOW = 64, 0.25  # samples, and the share of such pieces in which a signal moves slowly
_ROUNDING, _ON_GRID = 1e-12, 0.01  # of a value, and of a grid's step
_BEAT = 0.25  # of a beat, that a mean spans
_LASTS = 50  # means, over which a pace stays whole
_AROUND = 2  # means on either side, over which a pace is told
SCATTER = 1.3  # times 1/n: relative variance of a noise's standard deviation that n samples tell (third differences)
_MORE, _AT_MOST = 1.05, 1.12  # of a grid's noise: what differences tell of it in the mean, and of some motions
NEAR, WITHIN = 3.0, 0.9866  # standard deviations, and the rms of a normal distribution's values within them


def sample_noise(values: Array, signal: str) -> float:
    """White noise and quantisation of a signal (samples,), rms.

    From its third differences, which a smooth motion lacks, or from higher ones where these are smaller until they
    are so no more: the median of their size is blind to steps and reversals.  A signal on a grid whose values are held
    shows where it moves slowly whether it has more noise than the grid's, s/√12.  Never 0: a floor is what errors are
    counted in.
    """
    return max(_own_noise(np.asarray(values, dtype=float).tobytes())[0], least_noise(signal))


def is_of_grid(values: Array) -> bool:
    """Whether a signal's noise (samples,) is that of the grid on which it lies, and so known without a guess."""
    return _own_noise(np.asarray(values, dtype=float).tobytes())[1]


@lru_cache(maxsize=256)  # every model of a discovery asks it of the same recordings and of their parts
def _own_noise(given: bytes) -> tuple[float, bool]:
    """`sample_noise` of float64 values, before a signal's least, and whether it is a grid's."""
    values = np.frombuffer(given)
    steps = np.abs(np.diff(values))
    steps = steps[steps > _ROUNDING * (1.0 + np.max(np.abs(values)))]
    step = float(np.min(steps)) if len(steps) else 0.0
    repeated = len(steps) < 0.9 * (len(values) - 1)  # held values are the mark of quantisation
    if not repeated:
        return _of_grid(white_noise(values), _step(values), len(values))
    pieces = np.array_split(values, max(1, len(values) // _PIECE))
    return _of_grid(float(np.quantile([white_noise(one) for one in pieces], _SLOW)), step, len(values))


def _of_grid(noise: float, step: float, samples: int) -> tuple[float, bool]:
    """s/√12 where a noise on a grid of steps s is that, within 2 σ of what differences tell; and whether it is."""
    grid = step / np.sqrt(12.0)
    most = max(_AT_MOST, _MORE + 2.0 * np.sqrt(SCATTER / samples))
    return (grid, True) if noise < most * grid else (noise, False)


def beating(values: Array, size: int) -> Array:
    """What quantisation leaves in means over size samples beyond s/√(12 size), rms, (means,).

    A signal that goes on by a whole number of steps a sample is off by the same in each, which no mean takes away: at
    a pace of p steps it beats every 1/|p − round(p)| samples.  0 where the pace changes, and without a grid.
    """
    means = values[: len(values) // size * size].reshape(-1, size).mean(axis=1)
    step = _step(values)
    if step == 0.0 or len(means) <= 2 * _AROUND:
        return np.zeros(len(means))
    around = 2 * _AROUND + 1
    smooth = np.convolve(np.pad(means, _AROUND, mode="edge"), np.full(around, 1.0 / around), "valid")
    pace = np.abs(np.gradient(smooth)) / (size * step)
    whole = (np.round(pace) >= 1.0) & (size * np.abs(pace - np.round(pace)) < _BEAT)
    from scipy.ndimage import binary_opening  # takes a third of a second to import, which reading does without

    lasts = binary_opening(whole, np.ones(_LASTS, dtype=bool))
    return np.where(lasts, step * np.sqrt((1.0 - 1.0 / size) / 12.0), 0.0)


def held(values: Array, size: int) -> Array:
    """For how many samples a value stays where it is, in the mean of each of the means over size samples, (means,)."""
    values = values[: len(values) // size * size]
    if not len(values):
        return np.zeros(0)
    new = np.abs(np.diff(values)) > _ROUNDING * (1.0 + np.max(np.abs(values)))
    ends = np.flatnonzero(np.concatenate([[True], new, [True]]))
    lengths = np.diff(ends)
    return np.repeat(lengths, lengths).astype(float).reshape(-1, size).mean(axis=1)


def _step(values: Array) -> float:
    """The step of a grid on which values lie, that all their differences are multiples of; 0 where there is none."""
    steps = np.diff(values)
    changes = np.abs(np.diff(steps))
    changes = changes[changes > _ROUNDING * (1.0 + np.max(np.abs(values)))]
    step = float(np.min(changes, initial=np.inf))
    multiples = steps / step
    return step if np.all(np.abs(multiples - np.round(multiples)) < _ON_GRID) and np.isfinite(step) else 0.0


def least_noise(signal: str) -> float:
    """The least that a signal's noise can be, in its unit; above 0."""
    return _FINEST[SIGNALS[signal].kind]


def white_noise(values: Array) -> float:
    """rms, by the lowest order of differences from which on the next tells the same; by the first where none does."""
    found = [_typical(np.diff(values, order)) / np.sqrt(comb(2 * order, order)) for order in _ORDERS]
    return next((one for one, after in pairwise(found) if after > _LEVEL * one), found[0])


def _typical(differences: Array) -> float:
    """Standard deviation of what is normal about 0: the rms of all that is not far, by the median, which knows no far.

    The median alone scatters by twice as much, and on a grid it is one of few numbers, up to a seventh off.
    """
    size = np.abs(differences)
    near = size <= NEAR * 1.4826 * float(np.median(size))
    return float(np.sqrt(np.mean(size[near] ** 2))) / WITHIN
