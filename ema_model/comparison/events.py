"""What happened at one moment of a recording: a load that came on, a sensor that jumped, friction that rose.

The residual then has one mean before that moment and another after it, and little else is left.  A drift, or a
residual that swings, has its best such step as well: a step must tell more than a parabola over time does, and
stand out of what is left on stretches of time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.comparison.criteria import (
    BAND,
    EVENT_AT_ONCE,
    EVENT_BEYOND_DRIFT,
    EVENT_BLOCKS,
    EVENT_LOOP_S,
    EVENT_SHARE,
    EVENT_T,
)
from ema_model.comparison.explain import modulator_of, without_spikes
from ema_model.comparison.residuals import Residuals
from ema_model.comparison.sentences import event_sentence
from ema_model.recordings import SIGNALS

Array = NDArray[np.float64]

_LEAST_BLOCKS = 100
_EDGE = 0.05  # of a recording, nearer to whose ends nothing is dated
_STRETCHES = 24  # of a recording, over which what is left is taken to be independent


@dataclass(frozen=True, eq=False)
class Event:
    """A step of a signal's residual within one recording."""

    recording: int  # from 0
    name: str  # the recording's
    signal: str  # as on the actuator's axes
    time_s: float  # as recorded
    change: float  # after less before, in the signal's unit
    by_direction: bool  # whether it turns over with the direction of motion, as friction does
    share: float  # of what is left of the signal beyond its floor in that recording
    gain: float  # of χ² over the floor
    sentence: str


def events(residuals: Residuals, signals: Sequence[str], names: Sequence[str], actuator: Actuator) -> list[Event]:
    """The step of each recording that has one; signals: by their names inside; names: of the recordings.

    A step of the current comes first: positions give way to a load that comes on, and not the other way round.  One of
    a position must exceed the play, within which the user may stand at either flank.
    """
    axes, play = actuator.axes, actuator.transmission.backlash_rad
    least = {"user_position_rad": play, "motor_position_rad": play / actuator.transmission.gear_ratio}
    if residuals.is_map:
        return []
    found = []
    for recording, name in enumerate(names):
        steps = [
            step
            for signal in signals
            for modulator in (("1", "sign_speed") if _drives(signal) else ("1",))
            if (step := _step(residuals, recording, signal, modulator)) is not None
            and abs(step.change) > least.get(signal, 0.0)
        ]
        if not steps:
            continue
        best = max(steps, key=lambda one: (_drives(one.signal), one.share))
        shown, by_direction = axes.signal(best.signal), best.modulator != "1"
        sentence = event_sentence(shown, axes, name, best.time_s, best.change, by_direction)
        found.append(
            Event(recording, name, shown, best.time_s, best.change, by_direction, best.share, best.gain, sentence)
        )
    return found


def _drives(signal: str) -> bool:
    return SIGNALS[signal].kind in ("current", "torque")


@dataclass(frozen=True)
class _Step:
    signal: str
    modulator: str
    time_s: float
    change: float
    share: float
    gain: float


def _step(residuals: Residuals, recording: int, signal: str, modulator: str) -> _Step | None:
    """The best step of one signal in one recording, where it is one."""
    factor = modulator_of(residuals, modulator)
    if factor is None:
        return None
    chosen = (residuals.recording == recording) & np.isfinite(residuals.values[signal]) & ~residuals.saturated
    if modulator != "1":
        chosen &= factor != 0.0
    if np.count_nonzero(chosen) < _LEAST_BLOCKS:
        return None
    known = residuals.known.get(signal, np.zeros(residuals.blocks))
    weight = 1.0 / residuals.sigma[signal][chosen]
    values = without_spikes((residuals.values[signal] - known)[chosen] * weight)
    scale = factor[chosen] * weight
    time = residuals.time_s[chosen]
    moments, powers = np.cumsum(scale * values), np.cumsum(scale**2)
    constant = moments[-1] ** 2 / powers[-1]
    inner = slice(int(_EDGE * len(time)), len(time) - 1 - int(_EDGE * len(time)))
    before = moments[inner] / powers[inner]
    after = (moments[-1] - moments[inner]) / (powers[-1] - powers[inner])
    gains = before * moments[inner] + after * (moments[-1] - moments[inner]) - constant
    at = int(np.argmax(gains))
    gain, change = float(gains[at]), float(after[at] - before[at])
    total = float(values @ values)
    if total - constant < BAND**2 * len(values):
        return None  # but for an offset it is at its floor
    share = gain / (total - len(values))
    if share < EVENT_SHARE or gain < EVENT_BEYOND_DRIFT * (_drift(time, values, scale) - constant):
        return None
    place = inner.start + at
    left = values - scale * np.where(np.arange(len(time)) > place, after[at], before[at])
    if abs(change) < EVENT_T * _uncertainty(left, scale, place):
        return None
    if _at_once(time, values, scale, place, _drives(signal)) / change < EVENT_AT_ONCE:
        return None
    return _Step(signal, modulator, float(0.5 * (time[place] + time[place + 1])), change, min(share, 1.0), gain)


def _at_once(time: Array, values: Array, scale: Array, place: int, drives: bool) -> float:
    """The step as it is seen close to its moment, between the blocks `place` and the one after it.

    0 where these are too far apart, as about a standstill whose friction is not known: nothing was seen at once there.
    """
    within_s = max(EVENT_BLOCKS * float(np.median(np.diff(time))), EVENT_LOOP_S if drives else 0.0)
    if time[place + 1] - time[place] > within_s:
        return 0.0
    late_s = time - 0.5 * (time[place] + time[place + 1])
    before, after = (
        float(scale[side] @ values[side]) / float(scale[side] @ scale[side])
        for side in ((-within_s < late_s) & (late_s < 0.0), (late_s > 0.0) & (late_s < within_s))
    )
    return after - before


def _drift(time: Array, values: Array, scale: Array) -> float:
    """χ² that a parabola over time takes away, with its constant part."""
    t = (time - time.mean()) / max(float(np.ptp(time)), 1e-12)
    columns = np.column_stack([np.ones_like(t), t, t**2]) * scale[:, None]
    moments = columns.T @ values
    return float(moments @ np.linalg.lstsq(columns.T @ columns, moments, rcond=None)[0])


def _uncertainty(left: Array, scale: Array, place: int) -> float:
    """Standard deviation of a step's size, from what it leaves on stretches of time, whose means are independent."""
    cuts = np.linspace(0, len(left), _STRETCHES + 1).astype(int)
    sums = np.add.reduceat(scale * left, cuts[:-1])
    powers = np.add.reduceat(scale**2, cuts[:-1])
    spread = float(np.sum(sums**2 / powers)) / (_STRETCHES - 2)
    first, last = float(np.sum(scale[: place + 1] ** 2)), float(np.sum(scale[place + 1 :] ** 2))
    return float(np.sqrt(spread * (1.0 / first + 1.0 / last)))
