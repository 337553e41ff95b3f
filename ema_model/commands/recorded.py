"""A command taken from a recording."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.commands.command import Array, Command

_JUMP = 8.0  # times the changes just before and after it: a change within one sample that is no slope
_LEAST = 1e-6  # of the command's range: less is how its numbers are rounded, and stands beside a 0 anywhere
_ROUNDING_S = 1e-9
_OF_A_CURVE = 2  # samples on either side that decide how it bends
_LONGEST_SAMPLE_S = 0.02  # what is farther apart are corners of a profile, with slopes between them


def between(at_s: Array, time_s: Array, command: Array, *, moving: bool = False) -> Array:
    """A sampled command (n,) at other times: smooth between samples, but a jump comes with the sample that shows it.

    Constant outside; moving: before the first sample it came as it goes on from there, since a log that begins in mid
    motion, and is late by a part of a sample, would else begin with a jump of the command's speed.  Holding every
    sample would add 0.05 A to the fit of a chirp; a jump drawn as a slope begins up to a sample early, which is 3 A in
    the first half millisecond of a step sampled at 10 kHz; and chords leave a sine of 0.03 rad and 3 Hz, sampled at
    500 Hz, by 5e-6 rad, where Akima's curve is off by 1e-7; corners stay corners.
    """
    values = np.interp(at_s, time_s, command)
    if len(command) <= 2:
        return values
    change, step_s = jumps(command), np.diff(time_s)
    if moving and not change[0] and step_s[0] > 0.0:
        early = at_s < time_s[0]
        values[early] += (at_s[early] - time_s[0]) * (command[1] - command[0]) / step_s[0]
    near = step_s <= _LONGEST_SAMPLE_S
    last = np.clip(np.searchsorted(time_s, at_s + _ROUNDING_S, side="right") - 1, 0, len(time_s) - 1)
    if np.all(step_s > 0.0):
        bent = np.append(False, jumps(np.diff(command) / step_s))
        cornered = _corners(command, time_s) & near
        beside = (
            np.convolve(~near | change | bent | cornered, np.ones(2 * _OF_A_CURVE + 1), mode="same")[: len(change)] > 0
        )
        inside = np.append(~beside, False)[last] & (at_s >= time_s[0])
        from scipy.interpolate import Akima1DInterpolator  # takes a third of a second to import

        values[inside] = Akima1DInterpolator(time_s, command)(at_s[inside])
        _around_corners(values, at_s, last, np.append(cornered, False), time_s, command)
    held = np.append(change & near, False)
    return np.where(held[last], command[last], values)


def _corners(command: Array, time_s: Array) -> NDArray[np.bool_]:
    """In which intervals of a sampled command (n,) two straight lines meet, (n − 1,): a triangle's, seldom at a sample.

    The slope then changes on both sides of the interval, the same way, and hardly beyond.
    """
    found = np.zeros(len(command) - 1, dtype=bool)
    slopes = np.diff(command) / np.diff(time_s)
    changes = np.diff(slopes)
    if len(changes) < 4:
        return found
    before, after = changes[1:-2], changes[2:-1]
    beyond = np.maximum(np.abs(changes[:-3]), np.abs(changes[3:]))
    least = np.maximum(_JUMP * beyond, _LEAST * np.ptp(slopes))
    found[2:-2] = (before * after > 0.0) & (np.abs(before + after) > least)
    return found


def _around_corners(
    values: Array, at_s: Array, last: NDArray[np.intp], cornered: NDArray[np.bool_], time_s: Array, command: Array
) -> None:
    """Puts in, at times within cornered intervals, the two lines that meet there: a chord cuts the corner off."""
    at = np.flatnonzero(cornered[last] & (at_s >= time_s[0]))
    i = last[at]
    slopes = np.diff(command) / np.diff(time_s)
    left = command[i] + slopes[i - 1] * (at_s[at] - time_s[i])
    right = command[i + 1] + slopes[i + 1] * (at_s[at] - time_s[i + 1])
    values[at] = np.where(slopes[i - 1] > slopes[i + 1], np.minimum(left, right), np.maximum(left, right))


def jumps(command: Array) -> NDArray[np.bool_]:
    """Between which samples of a command (n,) it jumps, (n − 1,)."""
    change = np.abs(np.diff(command))
    beside = np.maximum(np.append(0.0, change[:-1]), np.append(change[1:], 0.0))
    return change > np.maximum(_JUMP * beside, _LEAST * np.ptp(command))


@dataclass(frozen=True)
class Recorded(Command):
    """Samples of a command; `between` says what is between them."""

    name = "recorded"
    title = "From a recording"
    time_s: Array = field(default_factory=lambda: np.zeros(1))
    command_rad: Array = field(default_factory=lambda: np.zeros(1))
    file: str = ""

    def at(self, time_s: Array) -> Array:
        return between(np.asarray(time_s, dtype=float), self.time_s - self.time_s[0], self.command_rad)

    def settings(self) -> dict[str, Any]:
        return {"file": self.file, "samples": len(self.time_s)}
