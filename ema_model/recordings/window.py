"""A window of a signal in numbers: between two cursors, as a spectrum, and where its event is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError

Array = NDArray[np.float64]

# --- between two cursors ----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Reading:
    """Of a signal between two times, in its unit; NaN where the signal has no values."""

    first: float  # at the earlier time
    last: float  # at the later one
    mean: float  # over time
    rms: float  # over time
    slope: float  # of the straight line that fits best, per second

    @property
    def difference(self) -> float:
        """Last less first."""
        return self.last - self.first


def reading(time_s: Array, values: Array, from_s: float, to_s: float) -> Reading:
    """Time rising, and values, both (n,): straight lines between samples, so that uneven steps weigh by their length.

    Mean and rms are integrals over the window, slope is least squares in it.  Samples that are not finite are left out.
    """
    known = np.isfinite(time_s) & np.isfinite(values)
    time_s, values = time_s[known], values[known]
    low, high = sorted((from_s, to_s))
    if len(time_s) < 2 or not time_s[0] <= low < high <= time_s[-1]:
        return Reading(_at(time_s, values, low), _at(time_s, values, high), np.nan, np.nan, np.nan)
    inside = (time_s > low) & (time_s < high)
    first, last = _at(time_s, values, low), _at(time_s, values, high)
    t = np.concatenate([[low], time_s[inside], [high]])
    y = np.concatenate([[first], values[inside], [last]])
    step, span = np.diff(t), high - low
    mean = float(np.sum(step * (y[1:] + y[:-1]))) / (2.0 * span)
    square = float(np.sum(step * (y[1:] ** 2 + y[1:] * y[:-1] + y[:-1] ** 2))) / (3.0 * span)
    middle = t - 0.5 * (low + high)  # the integral of middle·y over the one of middle²
    a, b = middle[:-1], middle[1:]
    moment = float(np.sum(step * (2.0 * (a * y[:-1] + b * y[1:]) + a * y[1:] + b * y[:-1]))) / 6.0
    return Reading(first, last, mean, float(np.sqrt(square)), moment / (span**3 / 12.0))


def _at(time_s: Array, values: Array, at_s: float) -> float:
    if not len(time_s):
        return np.nan
    return float(np.interp(at_s, time_s, values, left=np.nan, right=np.nan))


# --- its spectrum -----------------------------------------------------------------------------------------------------

_FEWEST = 16  # samples of a spectrum
_MOST = 2**20  # of its grid, which one sample a long way off would else make endless


def spectrum(time_s: Array, values: Array) -> tuple[Array, Array]:
    """Frequencies, Hz, and amplitudes of the signal's sines there, in its unit; time rising, and values, both (n,).

    About its straight line, with a Hann window, whose broadening keeps a sine's amplitude where it lies on a bin; on
    a grid of the median step, on which an uneven time is interpolated.  InputError: too few samples.
    """
    known = np.isfinite(time_s) & np.isfinite(values)
    time_s, values = time_s[known], values[known]
    if len(time_s) < _FEWEST:
        raise InputError(f"a spectrum needs {_FEWEST} samples, this window has {len(time_s)}; choose a longer one")
    step = float(np.median(np.diff(time_s)))
    count = int(np.floor((time_s[-1] - time_s[0]) / step + 0.5)) + 1
    if count > _MOST:
        raise InputError(f"a spectrum of {count} steps of {step:g} s is too long; choose a shorter window")
    grid = time_s[0] + step * np.arange(count)
    y = np.interp(grid, time_s, values)
    x = np.arange(count) - 0.5 * (count - 1)
    y = y - np.mean(y) - x * (x @ y) / (x @ x)
    window = np.hanning(count + 1)[:-1]
    amplitude: Array = 2.0 * np.abs(np.fft.rfft(window * y)) / float(np.sum(window))
    frequency: Array = np.arange(len(amplitude), dtype=np.float64) / (count * step)
    return frequency[1:], amplitude[1:]


# --- its event --------------------------------------------------------------------------------------------------------

_LEVEL = 0.02  # of the excursion, within which a signal is at its level
_NOISES = 6.0  # standard deviations of its noise, within which it is as well
_ENDS = 0.02  # of the samples, from which a level is known
_AIR = 0.15  # of the event's length, that a window leaves before and after it


def event(time_s: Array, *signals: Array) -> tuple[float, float] | None:
    """From and to when something happens: where any signal leaves its first level, to where all stay at their last.

    Time rising, and signals, all (n,); with some time before and after.  None: nothing happens, or it never ends, as
    of a sine.
    """
    found = [one for one in (_event(time_s, signal) for signal in signals) if one is not None]
    if not found:
        return None
    first, last = min(one[0] for one in found), max(one[1] for one in found)
    air = _AIR * (last - first)
    low, high = max(first - air, float(time_s[0])), min(last + air, float(time_s[-1]))
    return (low, high) if high > low else None


def _event(time_s: Array, values: Array) -> tuple[float, float] | None:
    known = np.isfinite(values)
    time_s, values = time_s[known], values[known]
    few = max(3, int(_ENDS * len(values)))
    if len(values) < 4 * few:
        return None
    ends = values[:few], values[-few:]
    # of neighbours, so that a drift is none; what a level is known by beside it
    noise = min(float(np.std(np.diff(end))) / np.sqrt(2.0) for end in ends)
    near = max(_LEVEL * float(np.ptp(values)), _NOISES * noise)
    start, end = float(values[0]), float(np.median(ends[1]))
    away = np.flatnonzero(np.abs(values - start) > near)
    restless = np.flatnonzero(np.abs(values - end) > near)
    if not len(away) or not len(restless) or restless[-1] >= len(values) - few:
        return None
    first = max(int(away[0]) - 1, 0)
    last = max(int(restless[-1]), int(away[0])) + 1
    return float(time_s[first]), float(time_s[last])
