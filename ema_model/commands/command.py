"""What every command is, those of a formula (T 3.5 … 3.8, multisine, staircase), and one taken from a recording."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass, field, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.quantities import check_number

# --- what every command is: settings with units in their names, and the user's position demand over time --------------

Array = NDArray[np.floating]


@dataclass(frozen=True)
class Command(ABC):
    """A position command at the user, rad.  The dataclass's fields are its settings."""

    name: ClassVar[str]
    place: ClassVar[int] = 9  # in lists; those of one place stand by their names
    title: ClassVar[str]

    @abstractmethod
    def at(self, time_s: Array) -> Array:
        """Command, rad, at these times, s; both (n,)."""

    def settings(self) -> dict[str, Any]:
        """The settings by name."""
        return asdict(self)

    def __post_init__(self) -> None:
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(f.default, int | float):
                check_number(value, f"{self.name}: {f.name}")
                if not math.isfinite(value):
                    raise InputError(f"{self.name}: {f.name} must be a finite number, not {value}")
                never_negative = f.name.endswith(("_Hz", "time_s"))
                if never_negative and value < 0.0:
                    raise InputError(f"{self.name}: {f.name} must not be negative, not {value:g}")


# --- commands of a formula --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Step(Command):
    """From one position to another at a time; the thesis's 1 rad cannot be reached within 0.5 s."""

    name = "step"
    place = 1  # the thesis's four come first
    title = "Step"
    initial_rad: float = 0.0
    final_rad: float = 1.0
    time_s: float = 0.01

    def at(self, time_s: Array) -> Array:
        return np.where(time_s < self.time_s - 1e-12, self.initial_rad, self.final_rad)


@dataclass(frozen=True)
class Ramp(Command):
    """A constant speed from a start time on."""

    name = "ramp"
    place = 2  # the thesis's four come first
    title = "Ramp"
    slope_rad_s: float = 1e-3
    initial_rad: float = 0.0
    time_s: float = 0.0

    def at(self, time_s: Array) -> Array:
        return self.initial_rad + self.slope_rad_s * np.maximum(time_s - self.time_s, 0.0)


@dataclass(frozen=True)
class Sine(Command):
    """A sine about a bias."""

    name = "sine"
    place = 3  # the thesis's four come first
    title = "Sine"
    amplitude_rad: float = 5e-3
    frequency_Hz: float = 15.0
    bias_rad: float = 0.0

    def at(self, time_s: Array) -> Array:
        return self.bias_rad + self.amplitude_rad * np.sin(2.0 * np.pi * self.frequency_Hz * time_s)


@dataclass(frozen=True)
class Chirp(Command):
    """A sine whose frequency rises linearly until the end time and stays there: 2π(f₀t + ½(f₁ − f₀)t²/T)."""

    name = "chirp"
    place = 4  # the thesis's four come first
    title = "Chirp"
    amplitude_rad: float = 5e-3
    start_Hz: float = 0.0
    end_Hz: float = 15.0
    end_time_s: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.end_time_s <= 0.0:
            raise InputError(f"chirp: end_time_s must be above 0, not {self.end_time_s:g}")

    def at(self, time_s: Array) -> Array:
        swept = np.minimum(time_s, self.end_time_s)
        rise = (self.end_Hz - self.start_Hz) / self.end_time_s
        cycles = self.start_Hz * swept + 0.5 * rise * swept**2 + self.end_Hz * (time_s - swept)
        return self.amplitude_rad * np.sin(2.0 * np.pi * cycles)


@dataclass(frozen=True)
class Multisine(Command):
    """The mean of sines with Schroeder's phases (IEEE Trans. Inf. Theory 16, 1970), which keep the peak low."""

    name = "multisine"
    title = "Multisine"
    amplitude_rad: float = 5e-3
    frequencies_Hz: tuple[float, ...] = (2.0, 6.0, 14.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.frequencies_Hz:
            raise InputError("multisine: frequencies_Hz must name one frequency or more (1+3+7)")
        if not all(0.0 < f < 1e4 for f in self.frequencies_Hz):
            raise InputError("multisine: frequencies_Hz must lie between 0 and 10000 Hz")

    def at(self, time_s: Array) -> Array:
        n = len(self.frequencies_Hz)
        phases = [-np.pi * i * (i + 1) / n for i in range(n)]
        waves = [np.sin(2.0 * np.pi * f * time_s + p) - np.sin(p) for f, p in zip(self.frequencies_Hz, phases)]
        return self.amplitude_rad * np.mean(waves, axis=0)


@dataclass(frozen=True)
class Staircase(Command):
    """Rises by one step after every dwell."""

    name = "staircase"
    title = "Staircase"
    step_rad: float = 2e-3
    dwell_s: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.dwell_s <= 0.0:
            raise InputError(f"staircase: dwell_s must be above 0, not {self.dwell_s:g}")

    def at(self, time_s: Array) -> Array:
        return self.step_rad * np.floor(time_s / self.dwell_s + 1e-9)


# --- a command taken from a recording ---------------------------------------------------------------------------------

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
