"""How much later a speed comes than the position that it is the derivative of, and how sure that is.

Over a window the position changes as the speed's integral does, moved by the delay d: Δp(t) = a·ΔV(t + d) + b·Δt, with
the speed's scale and offset in a and b.  Gauss-Newton steps in d have the position's own curvature for an instrument:
the speed's noise is not in it, and the position's lies evenly about the window's ends, so that neither moves d nor
makes its interval narrower than it is.  The interval is Student's over blocks of time, which need be neither white nor
alike inside (a cluster-robust covariance; Cameron and Miller, J. Human Resources 50 (2015)); a block counts by its
share of the motion.  A drift between two clocks is a delay that grows evenly over the recording, d = d₀ + d₁·τ with τ
from −½ to ½, and is told in the same way, with the curvature times τ for its instrument.
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
_SURE = 0.995  # of Student's distribution: a drift is seldom there, so that it takes more to claim one


@dataclass(frozen=True)
class Lag:
    """By how much the speed is later than the position, s, with its 90 % interval."""

    lag_s: float
    low_s: float
    high_s: float


@dataclass(frozen=True)
class Drift:
    """By how much the speed's clock runs fast, s per s of the position's, with its 90 % interval."""

    rate: float
    low: float
    high: float
    is_sure: bool  # zero is outside its 99 % interval


def speed_lag(position: Array, speed: Array, time: Array, stretches: list[slice]) -> Lag | None:
    """The lag of a speed, in any unit, behind its position, (n,) each; None where the motion does not tell one.

    stretches: samples without a gap between them, in order.
    """
    found = _fitted(position, speed, time, stretches, False)
    return found and Lag(found.value, found.value - found.half, found.value + found.half)


def clock_drift(position: Array, speed: Array, time: Array, stretches: list[slice]) -> Drift | None:
    """How much faster the clock of a speed runs than that of its position; as `speed_lag`."""
    found = _fitted(position, speed, time, stretches, True)
    if found is None:
        return None
    rate, half = found.value / found.lasted_s, found.half / found.lasted_s
    return Drift(rate, rate - half, rate + half, abs(found.value) > found.sure_half)


@dataclass(frozen=True)
class _Found:
    """The delay, or what it grows by over the recording, s, and half the widths of its intervals, of 90 and 99 %."""

    value: float
    half: float
    sure_half: float
    lasted_s: float


def _fitted(position: Array, speed: Array, time: Array, stretches: list[slice], drifts: bool) -> _Found | None:
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
        found = [one for window in windows if (one := _late(parts, window, start, drifts)) is not None]
    # The narrowest of several intervals is narrower than it should be, by its luck.
    return sorted(found, key=lambda one: one.half)[:2][-1] if found else None


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


def _late(parts: list[_Part], half_window: int, start: float, drifts: bool) -> _Found | None:
    """By windows of so many samples on either side."""
    period = float(np.median(np.diff(parts[0].time)))
    middle, lasted = 0.5 * (parts[0].time[0] + parts[-1].time[-1]), parts[-1].time[-1] - parts[0].time[0]
    beside = max(1, half_window // 2)
    late = np.array([start, 0.0] if drifts else [start])
    for _ in range(_STEPS):
        rows = [_rows(one, half_window, beside, late, middle, lasted) for one in parts]
        changes, regressors, instruments = (np.concatenate(columns) for columns in zip(*rows))
        if len(changes) < 8 * _BLOCKS:
            return None
        moments = instruments.T @ regressors
        if not np.linalg.cond(moments / np.abs(moments).max(axis=0, initial=1e-300)) < 1e12:
            return None
        found = np.linalg.solve(moments, instruments.T @ changes)
        step = found[1:-1] / found[0]
        late += step
        if np.all(np.abs(step) < 1e-4 * period):
            break
    else:
        return None
    gain, travelled, told = found[0], regressors[:, 0], late.size  # its column, and place
    curved = regressors[:, told]
    if not np.corrcoef(changes, travelled)[0, 1] ** 2 > _ALIKE**2:
        return None
    left = changes - regressors @ found
    edges = np.linspace(0, len(left), _BLOCKS + 1).astype(int)[:-1]
    inverse = np.linalg.inv(moments)[told]
    pulls = np.add.reduceat((instruments @ inverse) * left, edges) / gain
    shares = np.add.reduceat((instruments @ inverse) * curved, edges)
    count = 1.0 / float(shares @ shares)
    if not count >= _FEWEST:
        return None
    from scipy.special import stdtrit  # takes a while to import

    spread = float(np.linalg.norm(pulls / (1.0 - shares)))
    half, sure = (float(np.hypot(stdtrit(count - 1.0, p) * spread, _RESOLVED * period)) for p in (0.95, _SURE))
    if not half < _NEAR * np.std(travelled) / np.std(curved):
        return None
    return _Found(float(late[-1]), half, sure, float(lasted))


def _rows(part: _Part, m: int, beside: int, late: Array, middle: float, lasted: float) -> tuple[Array, Array, Array]:
    """The position's changes over windows; what explains them: the integral's, the speed's and time's; instruments.

    late: the delay, and what it grows by over the recording, which lasts so long about its middle.
    """
    reach, time = m + beside, part.time
    i = np.arange(reach, time.size - reach)
    since = (time - middle) / lasted
    shifted = time + late[0] + (late[1] * since if late.size > 1 else 0.0)
    i = i[(shifted[i - m] >= time[0]) & (shifted[i + m] <= time[-1])]
    after, speed_after = part.later(shifted[i + m])
    before, speed_before = part.later(shifted[i - m])
    travelled, spanned = after - before, time[i + m] - time[i - m]
    p = part.position
    curved = p[i + m + beside] - p[i - m + beside] - p[i + m - beside] + p[i - m - beside]
    regressors, instruments = [travelled, speed_after - speed_before], [travelled, curved]
    if late.size > 1:
        regressors.append(speed_after * since[i + m] - speed_before * since[i - m])
        instruments.append(curved * since[i])
    return (
        p[i + m] - p[i - m],
        np.column_stack([*regressors, spanned]),
        np.column_stack([*instruments, spanned]),
    )
