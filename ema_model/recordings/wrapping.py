"""Angles that a sensor gives within one turn (0 … 360°, ±π, one turn of counts), with their turns counted again.

A wrapped angle jumps by a turn, less the step of a sample, where it passes the end of its range; with the turn put
back the step is like its neighbours'.  Up to half a turn a sample the step itself says how often the range was passed,
beyond it only a recorded speed does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.files.opened import refusal
from ema_model.recordings.column_mapping import ColumnMapping
from ema_model.recordings.measurement import Measurement

Array = NDArray[np.float64]

_SPEEDS = {"motor_position_rad": "motor_speed_rad_s", "user_position_rad": "user_speed_rad_s"}
_COMMANDS = ("command_rad",)
_TURN = 2.0 * np.pi
_COUNTER = 1 << 16  # counts after which a usual counter begins again
# In periods:
_WIDEST = 1.01  # range of a wrapped angle
_STEP_OFF, _STEP_SHARE = 0.05, 0.5  # a step may leave its neighbours' by so much, and by this share of them
_FAST = 0.4  # a step from which on the next one may pass the half
_SLOW = 0.25  # a step at which a recording shows where it begins
_HALF = 0.5
_ROUGH = 0.25  # a change of the step from sample to sample, beyond which nothing can be followed
_SPEED_FITS = 0.2  # what the recorded speed and the steps may disagree by
# Shares:
_MOST = 0.7  # of the jumps, that must be ends of the range
_MANY = 0.1  # of the steps, that are jumps where a fast angle was sampled too seldom
_FULL = 0.9  # of a period, that such an angle fills
_AROUND = 5  # samples, about each


@dataclass(frozen=True, eq=False)
class _Turns:
    """What is found of one run: the turns to add to each sample, and the largest step, in periods."""

    turns: Array  # (samples,)
    jumps: int
    largest: float
    by_speed: bool = False


class _Ambiguous(Exception):
    """The turns cannot be counted; the text says how large a step is, in periods."""


def unwrapped(path: str, measurement: Measurement, mapping: ColumnMapping) -> Measurement:
    """The measurement with its wrapped angles made continuous, each said in a remark; a static map stays as it is.

    Signals under the names of files, each run by itself.  Raises InputError where an angle moves by more than half a
    turn a sample and no speed tells how many turns it makes.
    """
    if measurement.is_map:
        return measurement
    found: dict[str, Array] = {}
    remarks = []
    for name in (*_SPEEDS, *_COMMANDS):
        if name not in measurement or (name in _COMMANDS and not found):  # alone, it may be meant to jump
            continue
        for period, called in _periods(name, mapping):
            try:
                runs = _wrapped(measurement, name, period)
            except _Ambiguous as step:
                raise refusal(
                    path,
                    f"{name} is wrapped to {called} and moves by half of it a sample or more ({step}), so that its "
                    f"turns cannot be counted; record faster, or record {_SPEEDS.get(name, 'the speed')} as well",
                ) from None
            if runs is None:
                continue
            found[name] = measurement[name] + period * np.concatenate([run.turns for run in runs])
            jumps = sum(run.jumps for run in runs)
            by = f", by {_SPEEDS[name]}" if any(run.by_speed for run in runs) else ""
            remarks.append(
                f"{name} is wrapped to {called} and is made continuous{by} ({jumps} jump{'s' * (jumps != 1)}, up to "
                f"{max(run.largest for run in runs):.2g} of {called} a sample)"
            )
            break
    if not found:
        return measurement
    reading = replace(measurement.reading, remarks=(*measurement.reading.remarks, *remarks))
    return replace(measurement.with_signals(**found).with_notes(*remarks), reading=reading)


def _periods(name: str, mapping: ColumnMapping) -> list[tuple[float, str]]:
    """After which a signal may begin again, in SI, and what a message calls that."""
    entry = mapping.get(name)
    if entry is None:
        return [(_TURN, "one turn")]
    scale = abs(entry.scale)
    found = [(scale * _TURN, "one turn")]
    if entry.unit.startswith("counts/"):
        found.append((scale * _COUNTER * float(entry.converter.to_si(1.0)), f"{_COUNTER} counts"))
    return found


def _wrapped(measurement: Measurement, name: str, period: float) -> list[_Turns] | None:
    """The turns of each run; None where the signal is not wrapped.  Raises _Ambiguous."""
    values = measurement[name] / period
    if np.ptp(values) > _WIDEST:
        return None
    speed = measurement.get(_SPEEDS.get(name, ""))
    steps = [np.diff(values[run]) for run in measurement.runs]
    if not any(np.any(np.abs(one) > _HALF) for one in steps):
        return None
    found = []
    ends = jumps = 0
    for run, own in zip(measurement.runs, steps):
        times = np.diff(measurement.time_s[run])
        counted = None if speed is None or not own.size else _by_speed(own, times, speed[run] / period)
        true = _by_continuity(own, times) if counted is None else counted
        is_jump = np.abs(own) > _HALF
        jumps += int(np.count_nonzero(is_jump))
        ends += int(np.count_nonzero(_are_ends(own, true, counted is not None, name in _COMMANDS) & is_jump))
        turns = np.concatenate([[0.0], np.cumsum(np.round(true - own))])
        largest = float(np.max(np.abs(_median(true)), initial=0.0))
        found.append(_Turns(turns, int(np.count_nonzero(np.round(true - own))), largest, counted is not None))
    if ends < _MOST * jumps:
        is_full = np.ptp(values) > _FULL and jumps > _MANY * sum(one.size for one in steps)
        if is_full and name in _SPEEDS:
            raise _Ambiguous("its steps follow no course")
        return None
    for run, own, one in zip(measurement.runs, steps, found):
        if not one.by_speed:
            _check_countable(own, np.diff(measurement.time_s[run]))
    return found


def _by_speed(steps: Array, times: Array, speed: Array) -> Array | None:
    """The true steps that the recorded speed says; None where it does not fit them, as one of another unit."""
    predicted = 0.5 * (speed[1:] + speed[:-1]) * times
    true = steps + np.round(predicted - steps)
    return true if np.quantile(np.abs(true - predicted), 0.95) < _SPEED_FITS else None


def _by_continuity(steps: Array, times: Array) -> Array:
    """The true steps where each is like the one before; half a turn at most as a rule."""
    if not steps.size:
        return steps
    usual = float(np.median(times))
    wrapped = steps - np.round(steps)
    pace = np.unwrap(wrapped, period=1.0)  # follows a step that passes the half
    pace -= np.round(np.median(pace))
    lost = times > 1.5 * usual  # of a longer step nothing is known by its neighbours
    return np.where(lost, wrapped, pace)


def _are_ends(steps: Array, true: Array, is_known: bool, is_command: bool) -> NDArray[np.bool_]:
    """Which steps, with their turns, are like those about them; a command must be on its way against its jump."""
    about = _median(true)
    alike = np.abs(true - about) <= _STEP_OFF + _STEP_SHARE * np.abs(about)
    if is_command:
        return alike & (np.sign(about) == -np.sign(steps))
    return alike | is_known


def _check_countable(steps: Array, times: Array) -> None:
    """Raises _Ambiguous where the steps alone do not tell the turns: near the half, or rough, or never slow."""
    if not steps.size:
        return
    pace = _by_continuity(steps, times)
    sizes = np.abs(_median(pace))
    largest = float(np.max(sizes))
    if largest < _FAST:
        return
    rough = float(np.quantile(np.abs(np.diff(pace)), 0.99)) if pace.size > 1 else 0.0
    if largest > _HALF or rough > _ROUGH or float(np.min(sizes)) > _SLOW:
        raise _Ambiguous(f"up to {largest:.2g}")


def _median(values: Array) -> Array:
    """The median about each sample."""
    from scipy.ndimage import median_filter

    return median_filter(values, min(_AROUND, max(values.size, 1)), mode="nearest")
