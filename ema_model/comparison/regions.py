"""Where a residual stands out: the worst ranges of a variable, and what happened at one moment."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.comparison.explain import Explanation, modulator_of, quantile_knots, used_blocks, without_spikes
from ema_model.comparison.residuals import Residuals, event_sentence, range_text, ratio, region_sentence
from ema_model.comparison.thresholds import (
    BAND,
    EVENT_AT_ONCE,
    EVENT_BEYOND_DRIFT,
    EVENT_BLOCKS,
    EVENT_LOOP_S,
    EVENT_SHARE,
    EVENT_T,
)
from ema_model.quantities import Axes
from ema_model.recordings import SIGNALS
from ema_model.result import NULL, as_named

# --- the worst regions: ranges of a variable in which the residual stands out of its floor most, one way --------------

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_BINS = 20
_SPREAD = 0.5  # of the peak's mean, down to which neighbouring bins belong to its region
_ALIKE = 0.6  # of the smaller region's blocks, from which on two regions are one
_LEAST_Z = 4.0  # of a region's mean over its error
_SLOW = 0.08  # of the largest speed, below which a region is that of reversals
_ALWAYS = ("load", "motor_speed", "user_position", "time")
_ONE_WAY = 0.9
_DIGITS = (3, 4, 5, 6)  # of the ends of a range, as many as tell it from another one


@dataclass(frozen=True, eq=False)
class Region:
    """A range of a variable in which the model fails most."""

    signal: Annotated[str, Meta(description="whose residual it is")]
    variable: Annotated[str, Meta(description="what the range is of: motor_speed, time, …")]
    low: Annotated[float, as_named("from", "where the range begins, in the variable's SI unit")]
    high: Annotated[float, as_named("to", "where it ends, likewise")]
    rmse: Annotated[float, Meta(description="of the residual there, in the signal's unit", extra=NULL)]
    mean: Annotated[
        float, Meta(description="of the residual there, measurement − model, in the signal's unit", extra=NULL)
    ]
    excess: Annotated[float, as_named("over_floor", "rms of the error over the floor there", **NULL)]
    sentence: Annotated[str, Meta(description="the same in words")]  # "The motor needs 35.2 mN·m more torque at …"
    blocks: NDArray[np.bool_]  # (blocks,) of the joined residuals


def worst_moment(residuals: Residuals, region: Region) -> tuple[int, int]:
    """The recording and the block, of all joined ones, in the region whose residual is most out of its floor."""
    size = np.abs(residuals.values[region.signal]) / residuals.sigma[region.signal]
    at = int(np.argmax(np.where(region.blocks & np.isfinite(size), size, -1.0)))
    return int(residuals.recording[at]), at


def worst_regions(
    residuals: Residuals,
    signal: str,
    explanations: Sequence[Explanation],
    axes: Axes,
    recordings: Sequence[str] = (),
    count: int = 5,
) -> list[Region]:
    """Up to `count` regions, distinct from one another in place and in words; those of the best explanation first.

    recordings: their names.
    """
    used = used_blocks(residuals, signal)
    if used is None:
        return []
    told = [(one.variable, one.modulator) for one in explanations if one.significant][:2]
    others = [(name, "1") for name in _ALWAYS if name in residuals.variables]
    found: list[Region] = []
    for group in ([told[0]] if told else [], [*told[1:], *others]):
        regions = [
            region
            for variable, modulator in dict.fromkeys(group)
            for way in ((1, -1) if modulator == "sign_speed" else (None,))
            for region in _of_variable(residuals, signal, variable, way, used.chosen, axes)
        ]
        for region in sorted(regions, key=lambda one: -abs(one.mean) * np.sqrt(np.count_nonzero(one.blocks))):
            if len(found) < count and not any(_alike(region, other) for other in found):
                found.append(region)
    return _named_apart(found, residuals, signal, axes, recordings)


def _named_apart(
    regions: Sequence[Region], residuals: Residuals, signal: str, axes: Axes, recordings: Sequence[str]
) -> list[Region]:
    """Regions of one and the same sentence say their range and, where they lie in one of several, the recording."""
    named = list(regions)
    for digits in _DIGITS:
        counts = Counter(region.sentence for region in named)
        if len(counts) == len(named):
            break
        for i, region in enumerate(regions):
            if counts[named[i].sentence] > 1:
                details = range_text(region.variable, region.low, region.high, axes, digits)
                inside = np.unique(residuals.recording[region.blocks])
                if len(recordings) > 1 and len(inside) == 1:
                    details += f", in {recordings[int(inside[0])] or f'recording {inside[0] + 1}'}"
                place = region.variable, region.low, region.high, region.blocks
                named[i] = _region(residuals, signal, *place, axes, details)
    return named


def _of_variable(
    residuals: Residuals, signal: str, variable: str, way: int | None, chosen: Mask, axes: Axes
) -> Iterator[Region]:
    """The worst region with a positive mean, and the worst with a negative one."""
    values = residuals.variables[variable]
    usable = chosen & np.isfinite(values)
    if way is not None:
        usable &= residuals.direction == way
    if np.count_nonzero(usable) < 4 * _BINS or np.ptp(values[usable]) == 0.0:
        return
    if variable == "motor_angle" and axes.motor == "rotary":
        values = np.mod(values, 2.0 * np.pi)
        edges = np.linspace(0.0, 2.0 * np.pi, 2 * _BINS + 1)
    else:
        edges = quantile_knots(values[usable], _BINS + 1)
    error = residuals.values[signal]
    masks = [usable & (values >= low) & (values <= high) for low, high in pairwise(edges)]
    means = np.array([float(np.mean(error[mask])) if mask.any() else 0.0 for mask in masks])
    for sign in (1.0, -1.0):
        peak = int(np.argmax(sign * means))
        if sign * means[peak] <= 0.0:
            continue
        first = last = peak
        while first > 0 and sign * means[first - 1] > _SPREAD * sign * means[peak]:
            first -= 1
        while last < len(means) - 1 and sign * means[last + 1] > _SPREAD * sign * means[peak]:
            last += 1
        mask = np.logical_or.reduce(masks[first : last + 1])
        region = _region(residuals, signal, variable, float(edges[first]), float(edges[last + 1]), mask, axes)
        sigma = residuals.sigma[signal][mask]
        if abs(region.mean) > _LEAST_Z * float(np.sqrt(np.mean(sigma**2) / mask.sum())):
            yield region


def _region(
    residuals: Residuals, signal: str, variable: str, low: float, high: float, mask: Mask, axes: Axes, details: str = ""
) -> Region:
    error = residuals.values[signal][mask]
    rmse, mean = float(np.sqrt(np.mean(error**2))), float(np.mean(error))
    direction = residuals.direction[mask]
    forward, back = np.mean(direction > 0.0), np.mean(direction < 0.0)
    way = 1 if forward > _ONE_WAY else -1 if back > _ONE_WAY else 0
    speed = residuals.variables.get("motor_speed")
    slow = False
    if variable == "motor_speed" and speed is not None:
        slow = float(np.mean(np.abs(speed[mask]))) < _SLOW * float(np.nanmax(np.abs(speed)))
    time = residuals.variables.get("time")
    return Region(
        signal=axes.signal(signal),
        variable=variable,
        low=low,
        high=high,
        rmse=rmse,
        mean=mean,
        excess=ratio(residuals, [signal], mask),
        sentence=region_sentence(
            axes.signal(signal),
            variable,
            low,
            high,
            float(np.mean(residuals.variables[variable][mask])),
            mean,
            way,
            torque_constant=residuals.torque_constant,
            axes=axes,
            duration_s=0.0 if time is None else float(np.nanmax(time)),
            slow=slow,
            details=details,
        ),
        blocks=mask,
    )


def _alike(one: Region, other: Region) -> bool:
    common = np.count_nonzero(one.blocks & other.blocks)
    return bool(common > _ALIKE * min(np.count_nonzero(one.blocks), np.count_nonzero(other.blocks)))


# --- what happened at one moment of a recording: a load that came on, a sensor that jumped, friction that rose --------
# The residual then has one mean before that moment and another after it, and little else is left.  A drift, or a
# residual that swings, has its best such step as well: a step must tell more than a parabola over time does, and
# stand out of what is left on stretches of time.

_LEAST_BLOCKS = 100
_EDGE = 0.05  # of a recording, nearer to whose ends nothing is dated
_STRETCHES = 24  # of a recording, over which what is left is taken to be independent


@dataclass(frozen=True, eq=False)
class Event:
    """A step of a residual at one moment of a recording."""

    recording: int  # from 0
    name: Annotated[str, as_named("recording", "its name")]
    signal: Annotated[str, Meta(description="whose residual it is")]  # as on the actuator's axes
    time_s: Annotated[float, Meta(description="s, as recorded")]
    change: Annotated[float, Meta(description="after less before, in the signal's unit")]
    by_direction: Annotated[bool, Meta(description="whether it turns over with the direction of motion, as friction")]
    share: Annotated[float, Meta(description="0 … 1, of what the signal's residual has beyond its floor")]
    gain: float  # of χ² over the floor
    sentence: Annotated[str, Meta(description="the same in words")]


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
