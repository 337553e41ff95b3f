"""How much later a speed comes than the position that it is the derivative of, and how sure that is.

Over a window the position changes as the speed's integral does, moved by the delay d: Δp(t) = a·ΔV(t + d) + b·Δt, with
the speed's scale and offset in a and b.  Gauss-Newton steps in d have the position's own curvature for an instrument:
the speed's noise is not in it, and the position's lies evenly about the window's ends, so that neither moves d nor
makes its interval narrower than it is.  The interval is Student's over blocks of time, which need be neither white nor
alike inside (a cluster-robust covariance; Cameron and Miller, J. Human Resources 50 (2015)); a block counts by its
share of the motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.recordings.health import estimates

Array = NDArray[np.float64]

_MOST = 60_000  # samples that are looked at; of more, means over neighbours, which move neither against the other
_BLOCKS = 16
_FEWEST = 4.0  # blocks that must have a part in the motion
_STEPS = 12
_ALIKE = 0.5  # correlation of the two changes, below which one is not the other's derivative
_NEAR = 0.3  # of the time in which the speed changes by itself, up to which an interval is told
_RESOLVED = 0.01  # of a period: what interpolation between samples is off by


@dataclass(frozen=True)
class Lag:
    """By how much the speed is later than the position, s, with its 90 % interval."""

    lag_s: float
    low_s: float
    high_s: float


def speed_lag(position: Array, speed: Array, time: Array, stretches: list[slice]) -> Lag | None:
    """The lag of a speed, in any unit, behind its position, (n,) each; None where the motion does not tell one.

    stretches: samples without a gap between them, in order.
    """
    total = sum(one.stop - one.start for one in stretches)
    parts = [_thinned(position[one], speed[one], time[one], max(1, -(-total // _MOST))) for one in stretches]
    parts = [one for one in parts if one.time.size >= 32]
    if not parts:
        return None
    longest = max(parts, key=lambda one: one.time.size)
    start, _ = estimates.delay_s(longest.position, longest.travelled, longest.time)
    if not np.isfinite(start):
        return None
    samples = sum(one.time.size for one in parts)
    windows = [2**i for i in range(1, 16) if 6 * 2**i <= samples // _BLOCKS]
    with np.errstate(all="ignore"):  # what does not move tells nothing, and is left out
        found = [one for window in windows if (one := _lag(parts, window, start)) is not None]
    # The narrowest of several intervals is narrower than it should be, by its luck.
    return sorted(found, key=lambda one: one.high_s - one.low_s)[:2][-1] if found else None


@dataclass(frozen=True)
class _Part:
    """A stretch: position, speed and its integral at the same times, (n,) each."""

    position: Array
    speed: Array
    travelled: Array
    time: Array

    def later(self, time: Array) -> tuple[Array, Array]:
        """The integral and the speed at times between samples."""
        at = np.clip(np.searchsorted(self.time, time, "right") - 1, 0, self.time.size - 2)
        since, step = time - self.time[at], self.time[at + 1] - self.time[at]
        gained = since / step * (self.speed[at + 1] - self.speed[at])
        return self.travelled[at] + since * (self.speed[at] + 0.5 * gained), self.speed[at] + gained


def _thinned(position: Array, speed: Array, time: Array, every: int) -> _Part:
    whole = time.size // every * every
    position, speed, time = (values[:whole].reshape(-1, every).mean(axis=1) for values in (position, speed, time))
    return _Part(position, speed, estimates.integrated(speed, time), time)


def _lag(parts: list[_Part], half_window: int, start: float) -> Lag | None:
    """By windows of so many samples on either side."""
    lag, period = start, float(np.median(np.diff(parts[0].time)))
    beside = max(1, half_window // 2)
    for _ in range(_STEPS):
        rows = [_rows(one, half_window, beside, lag) for one in parts]
        changes, regressors, instruments = (np.concatenate(columns) for columns in zip(*rows))
        if len(changes) < 8 * _BLOCKS:
            return None
        moments = instruments.T @ regressors
        if not np.linalg.cond(moments / np.abs(moments).max(axis=0, initial=1e-300)) < 1e12:
            return None
        gain, slope, offset = np.linalg.solve(moments, instruments.T @ changes)
        step = slope / gain
        lag += step
        if abs(step) < 1e-4 * period:
            break
    else:
        return None
    travelled, curved = regressors[:, 0], regressors[:, 1]
    if not np.corrcoef(changes, travelled)[0, 1] ** 2 > _ALIKE**2:
        return None
    left = changes - regressors @ [gain, slope, offset]
    edges = np.linspace(0, len(left), _BLOCKS + 1).astype(int)[:-1]
    inverse = np.linalg.inv(moments)[1]
    pulls = np.add.reduceat((instruments @ inverse) * left, edges) / gain
    shares = np.add.reduceat((instruments @ inverse) * curved, edges)
    count = 1.0 / float(shares @ shares)
    if not count >= _FEWEST:
        return None
    from scipy.special import stdtrit  # takes a while to import

    spread = float(np.linalg.norm(pulls / (1.0 - shares)))
    half = float(np.hypot(stdtrit(count - 1.0, 0.95) * spread, _RESOLVED * period))
    if not half < _NEAR * np.std(travelled) / np.std(curved):
        return None
    return Lag(lag, lag - half, lag + half)


def _rows(part: _Part, m: int, beside: int, lag: float) -> tuple[Array, Array, Array]:
    """The position's changes over windows; what explains them: the integral's, the speed's and time's; instruments."""
    reach, time = m + beside, part.time
    i = np.arange(reach, time.size - reach)
    i = i[(time[i - m] + lag >= time[0]) & (time[i + m] + lag <= time[-1])]
    after, speed_after = part.later(time[i + m] + lag)
    before, speed_before = part.later(time[i - m] + lag)
    travelled, lasted = after - before, time[i + m] - time[i - m]
    p = part.position
    curved = p[i + m + beside] - p[i - m + beside] - p[i + m - beside] + p[i - m - beside]
    regressors = np.column_stack([travelled, speed_after - speed_before, lasted])
    return p[i + m] - p[i - m], regressors, np.column_stack([travelled, curved, lasted])
