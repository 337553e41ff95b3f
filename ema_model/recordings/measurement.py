"""A measurement: signals over time, at hand, made even, delayed, as sensors record them, and as words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.commands.command import between as samples_between
from ema_model.errors import InputError
from ema_model.files.opened import listed, refusal, shown
from ema_model.quantities import MOTOR, SIGNALS, USER, Axes, check_number, check_seed, number
from ema_model.recordings.column_mapping import ColumnMapping, Reading
from ema_model.recordings.formats.format import GAP, between
from ema_model.recordings.side_file import SideFile
from ema_model.recordings.signals import rotation_order
from ema_model.text import Document, InWords, Lines, Table

# --- a measurement in words: its size, how its file was read, and its signals with their ranges -----------------------


def document_of(measurement: Measurement) -> Document:
    """Signals by their names in files, in SI; beside each the column that it was read from."""
    size = f"{measurement.samples} samples"
    if not measurement.is_map:
        size += f" over {number(measurement.duration_s)} s"
    mapping = measurement.reading.mapping
    columns = {entry.signal: entry.column for entry in mapping.entries}
    rows, units, remarks = [], [], []
    for name, values in measurement.signals.items():
        outside = measurement.shown(name)
        rows.append([outside, number(float(np.min(values))), number(float(np.max(values)))])
        units.append(SIGNALS[outside].unit if outside in SIGNALS else "")
        remarks.append(f"from {shown(columns[outside])}" if columns.get(outside, outside) != outside else "")
    said = [measurement.reading.told, *(f"left aside: {shown(column)} ({why})" for column, why in mapping.unmapped)]
    beside = [f"{unit}   {remark}".strip() for unit, remark in zip(units, remarks)]
    return Document(
        [
            Lines([f"{measurement.name or 'recording'}: {size}", *filter(None, said)]),
            Table(("least", "most"), rows, "signal", beside),
        ]
    )


# --- signals that a mapping says to come late, moved back to the time at which they were ------------------------------


def without_delays(measurement: Measurement, mapping: ColumnMapping) -> Measurement:
    """The measurement with each delay of its mapping taken out, run by run, without the ends that one then lacks."""
    late = {entry.signal: entry.delay_s for entry in mapping.entries if entry.delay_s and entry.signal in measurement}
    if not late:
        return measurement
    parts: list[dict[str, np.ndarray]] = []
    for run in measurement.runs:
        time = measurement.time_s[run]
        whole = (time + min(0.0, *late.values()) >= time[0]) & (time + max(0.0, *late.values()) <= time[-1])
        part = {name: measurement[name][run] for name in measurement}
        for name, delay in late.items():
            part[name] = between(time + delay, time, part[name], SIGNALS[name].kind == "state")
        parts.append({name: values[whole] for name, values in part.items()})
    signals = {name: np.concatenate([part[name] for part in parts]) for name in measurement}
    told = tuple(f"{name} is moved {1e3 * delay:.6g} ms back, as its mapping says" for name, delay in late.items())
    return replace(measurement, signals=signals, notes=(*measurement.notes, *told))


# --- the equivalent current from three phase currents (T 3.14) --------------------------------------------------------

PHASES = ("phase_a_current_A", "phase_b_current_A", "phase_c_current_A")

Array = NDArray[np.float64]

_CLEAR = 0.5  # likeness of the currents to a turning field, from which on its angle counts


def equivalent_current(a: Array, b: Array, c: Array, motor_position_rad: Array, pole_pairs: float) -> Array:
    """I_3eq = [−I_A + ½(I_B + I_C)] sin θ_e + (√3/2)(I_B − I_C) cos θ_e, A; θ_e is pole_pairs times the position."""
    angle = pole_pairs * motor_position_rad
    return (0.5 * (b + c) - a) * np.sin(angle) + 0.5 * math.sqrt(3.0) * (b - c) * np.cos(angle)


def can_have_current(measurement: Measurement) -> bool:
    """Whether the equivalent current is missing and can be made."""
    return "current_A" not in measurement and all(name in measurement for name in (*PHASES, "motor_position_rad"))


def with_third_phase(measurement: Measurement) -> Measurement:
    """The measurement with the current of the phase that was not recorded: in a star the three add up to zero."""
    recorded = [name for name in PHASES if name in measurement]
    if len(recorded) != 2:
        return measurement
    third = next(name for name in PHASES if name not in recorded)
    made = measurement.with_signals(**{third: -(measurement[recorded[0]] + measurement[recorded[1]])})
    return made.with_notes(f"{third} is made of the other two phases' currents, since the three of a star add up to 0")


def with_equivalent_current(measurement: Measurement, pole_pairs: float, rotor_offset_rad: float = 0.0) -> Measurement:
    """The measurement with `current_A` made from its phase currents and motor position; one that has it is kept.

    `rotor_offset_rad` is the rotor's angle where the motor position is zero.  Raises InputError if a phase
    or the position is missing.
    """
    if "current_A" in measurement:
        return measurement
    measurement.require(*PHASES, "motor_position_rad")
    if not (math.isfinite(pole_pairs) and pole_pairs > 0.0):
        raise InputError(f"the pole pairs must be a number above 0, not {pole_pairs:g}")
    angle = measurement["motor_position_rad"] + rotor_offset_rad
    a, b, c = (measurement[name] for name in PHASES)
    current = equivalent_current(a, b, c, angle, pole_pairs)
    note = f"current_A is made from the phase currents with {pole_pairs:g} pole pairs"
    return measurement.with_signals(current_A=current).with_notes(note)


def with_current(measurement: Measurement, pole_pairs: float, rotor_offset_rad: float) -> Measurement:
    """The same where a current can be made, at the rotor offset that the phase currents themselves show.

    They show it up to a multiple of π/pole_pairs; of these the nearest to `rotor_offset_rad` is taken.
    """
    if not can_have_current(measurement):
        return measurement
    phases = np.array([measurement[name] for name in PHASES])
    _, forward, backward, shown = rotation_order(phases, measurement["motor_position_rad"], pole_pairs)
    offset = rotor_offset_rad
    if forward > _CLEAR and forward > 2.0 * backward and math.isfinite(shown):
        step = math.pi / pole_pairs
        offset = shown + step * round((rotor_offset_rad - shown) / step)
    made = with_equivalent_current(measurement, pole_pairs, offset)
    return made.with_notes(f"the rotor's offset is taken as {offset:.4g} rad") if offset != rotor_offset_rad else made


# --- the motor's motion from the user's, where only the output was recorded -------------------------------------------

_OF_USER = {"motor_position_rad": "user_position_rad", "motor_speed_rad_s": "user_speed_rad_s"}  # names inside


def with_motor_side(
    measurement: Measurement, gear_ratio: float, between: Sequence[str] = (), speed_only: bool = False
) -> Measurement:
    """The measurement with the motor's position and speed as the gear makes them of the user's: θ_m = θ_u/τ.

    Signals by their names inside; those that were recorded stay.  gear_ratio: τ, the user's angle (or length) per
    motor's; between: what of the model lies between the two sides and is not seen so.
    """
    axes = measurement.axes or Axes()
    names = [name for name, source in _OF_USER.items() if name not in measurement and source in measurement]
    if speed_only:
        names = [name for name in names if SIGNALS[name].kind == "speed"]
    if not names:
        return measurement
    made = measurement.with_signals(**{name: measurement[_OF_USER[name]] / gear_ratio for name in names})
    told = [f"{axes.signal(name)} is made of {axes.signal(_OF_USER[name])} by {gear_in_words(gear_ratio, axes)}"
            for name in names]  # fmt: skip
    if between:
        told.append(f"the model has {listed(between)} between motor and user, which a motion made so does not show")
    return made.with_notes(*told)


def gear_in_words(gear_ratio: float, axes: Axes) -> str:
    """`the gear 1:101`, or `the screw's lead of 10 mm`."""
    if (axes.motor, axes.user) == ("rotary", "linear"):
        return f"the screw's lead of {2e3 * math.pi * gear_ratio:.6g} mm a turn"
    if axes.motor == axes.user:
        reduces = gear_ratio <= 1.0
        ratio = 1.0 / gear_ratio if reduces else gear_ratio
        said = f"{round(ratio)}" if abs(ratio / round(ratio) - 1.0) < 1e-6 else f"{ratio:.6g}"
        return f"the gear 1:{said}" if reduces else f"the gear {said}:1"
    return f"the ratio of {gear_ratio:.6g} {axes.unit('', USER, per=MOTOR)}"


# What a static map goes along, by the names inside: an angle, or the steady states of a dynamometer's table.
ALONG_A_MAP = ("motor_position_rad", "user_position_rad", "motor_speed_rad_s", "load_torque_Nm", "motor_torque_Nm")


def along_map(measurement: Measurement) -> Measurement:
    """A map of steady states with its rows by speed, or else by torque; one along an angle stays as it is.

    Only in order do neighbours tell the noise, and a dynamometer's table goes up and down, or lists points anyhow.
    """
    varies = [name for name in ALONG_A_MAP if name in measurement and np.ptp(measurement[name]) > 0.0]
    if not measurement.is_map or not varies or SIGNALS[varies[0]].kind == "position":
        return measurement
    order = np.argsort(measurement[varies[0]], kind="stable")
    if np.array_equal(order, np.arange(order.size)):
        return measurement
    signals = {name: values[order] for name, values in measurement.signals.items() if name != "time_s"}
    return replace(measurement, signals={"time_s": np.arange(float(order.size)), **signals})


# --- signals of one run on a common time base -------------------------------------------------------------------------

Default = TypeVar("Default")

_OF_A_CURVE = 4  # samples, below which no curve is drawn through them
_MOST_SAMPLES = 100_000_000
_SELDOM = 0.01  # of all steps, up to which long ones are gaps
_JITTER = 1e-3  # of the period, from which on the samples count as off the grid


@dataclass(frozen=True, eq=False, repr=False)
class Measurement(InWords):
    """Signals of one run on a common time base, in SI units under canonical names (`ema_model.recordings.SIGNALS`).

    `signals` are float64 arrays of one length that cannot be written to; they include `time_s`.  Time
    increases, but for the starts of new runs, where the `segment` signal changes.  Raises InputError if the
    time is missing or the lengths differ.
    """

    signals: dict[str, Array]
    name: str = ""  # file stem or title
    notes: tuple[str, ...] = ()  # what reading found and did, in plain words
    side: SideFile = field(
        default_factory=SideFile
    )  # what else is known: the actuator's file, the sensors' accuracy, the kind
    reading: Reading = field(default_factory=Reading)  # which columns of its file it was read from, and what was made
    axes: Axes | None = None  # whose names inside the signals have; None: the names that files and people use
    of_other_axes: tuple[str, ...] = ()  # names of signals that those axes do not have, and so this has not

    def __post_init__(self) -> None:
        object.__setattr__(self, "signals", {name: _frozen(values) for name, values in self.signals.items()})
        self.require("time_s")
        for name, values in self.signals.items():
            if values.shape != (self.time_s.size,):
                raise InputError(f"{name} has the shape {values.shape}, but time_s has {self.time_s.size} samples")

    def __getitem__(self, name: str) -> Array:
        return self.signals[name]

    def __contains__(self, name: object) -> bool:
        return name in self.signals

    def __iter__(self) -> Iterator[str]:
        return iter(self.signals)

    @overload
    def get(self, name: str) -> Array | None: ...
    @overload
    def get(self, name: str, default: Default) -> Array | Default: ...
    def get(self, name: str, default: object = None) -> object:
        """The signal, or `default` where it was not recorded."""
        return self.signals.get(name, default)

    @property
    def time_s(self) -> Array:
        """Time, s, increasing within each run."""
        return self.signals["time_s"]

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.time_s.size

    @property
    def segments(self) -> list[slice]:
        """The samples of each run by its number: all of them, or those between changes of the `segment` signal."""
        changes = np.flatnonzero(np.diff(self.signals["segment"])) + 1 if "segment" in self else np.zeros(0, int)
        return self._cut(changes)

    @cached_property
    def runs(self) -> list[slice]:
        """The samples of each run: those of a segment, cut at its gaps, in which nobody knows what happened."""
        steps = np.diff(self.time_s)
        starts = np.array([one.start for one in self.segments[1:]], int)
        within = np.delete(steps, starts - 1)
        gaps = np.flatnonzero(steps > GAP * np.median(within)) + 1 if within.size else starts
        if self.is_map or gaps.size > _SELDOM * steps.size:  # samples that come when they like have no gaps
            gaps = starts
        return self._cut(np.union1d(starts, gaps))

    def _cut(self, starts: NDArray[np.intp]) -> list[slice]:
        edges = [0, *starts.tolist(), self.samples]
        return [slice(start, stop) for start, stop in pairwise(edges) if start < stop]

    @property
    def duration_s(self) -> float:
        """From the first sample to the last, s, summed over the runs."""
        return float(sum(self.time_s[run][-1] - self.time_s[run][0] for run in self.runs))

    @property
    def sample_period_s(self) -> float:
        """Median time between samples of a run, s; NaN where no run has two samples."""
        steps = np.diff(self.time_s)
        if "segment" in self:
            steps = steps[np.diff(self.signals["segment"]) == 0.0]
        return float(np.median(steps)) if steps.size else float("nan")

    @property
    def jitter(self) -> float:
        """How far samples lie off the regular grid of their run, and its period off the median, per period."""
        period, worst = self.sample_period_s, 0.0
        for run in self.runs:
            time = self.time_s[run]
            if time.size > 1:
                grid = np.linspace(time[0], time[-1], time.size)
                mean = (time[-1] - time[0]) / (time.size - 1)
                worst = max(worst, float(np.max(np.abs(time - grid))) / period, abs(mean / period - 1.0))
        return worst

    @property
    def is_uniform(self) -> bool:
        """Whether no sample is off a regular grid by a thousandth of the period or more."""
        return self.jitter < _JITTER

    def with_signals(self, **arrays: ArrayLike) -> Measurement:
        """A copy in which these signals are added or take the place of the old ones."""
        return replace(self, signals={**self.signals, **{name: _frozen(values) for name, values in arrays.items()}})

    @property
    def is_map(self) -> bool:
        """Whether it is a static map, current or torque against `ALONG_A_MAP`; its time only counts the samples."""
        return self.side.kind == "map"

    def with_notes(self, *notes: str) -> Measurement:
        """A copy with these notes added."""
        return replace(self, notes=(*self.notes, *notes))

    def selected(
        self, window_s: tuple[float, float] | None = None, segments: Sequence[int] | None = None
    ) -> Measurement:
        """The samples from one time to another, both included, and of these segments; the rest is cut off.

        Raises InputError if nothing is left, or there are no segments.
        """
        keep = np.ones(self.samples, bool)
        if segments is not None:
            self.require("segment")
            keep &= np.isin(self["segment"], np.asarray(segments, float))
        if window_s is not None:
            keep &= (self.time_s >= window_s[0]) & (self.time_s <= window_s[1])
        if not keep.any():
            where = f"{shown(self.name, 100)}: " if self.name else ""
            raise InputError(f"{where}no sample lies in the chosen window and segments; widen them")
        cut = {name: values[keep] for name, values in self.signals.items()}
        note = f"{keep.sum()} of {keep.size} samples are in the chosen window and segments; the others are left aside"
        return replace(self, signals=cut, notes=self.notes if keep.all() else (*self.notes, note))

    def shown(self, name: str) -> str:
        """The name in files of a signal, by its name here."""
        return name if self.axes is None else self.axes.signal(name)

    def require(self, *names: str, without: str = "") -> None:
        """Raises InputError if any of these signals is missing; it names them and those present.

        without: what else can be done, for the end of the line.
        """
        missing = [name for name in names if name not in self.signals]
        if missing:
            where = shown(self.name, 100) or "the recording"
            needed = f"{where}: column {', '.join(map(self.shown, missing))} is needed"
            for name in missing:
                if self.axes is not None and (wrong := self.axes.mismatch(name, self.of_other_axes)):
                    raise InputError(f"{needed}; {wrong}")
            present = listed([self.shown(name) for name in self.signals])
            raise InputError(f"{needed}; add it (present: {present}){without and '; '}{without}")

    def resampled(self, period_s: float) -> Measurement:
        """The signals on a grid of equal steps that starts with the first sample (of each run).

        Between samples signals are linear, positions smooth, a command is as it is simulated, and states are held;
        nothing is filtered, so a grid much coarser than the samples folds fast contents down.  Raises InputError for a
        period that gives no usable grid.
        """
        if not (np.isfinite(period_s) and period_s > 0.0):
            raise InputError(f"the sample period must be a time above 0 s, not {period_s:g}")
        if not self.duration_s < _MOST_SAMPLES * period_s:
            raise InputError(f"a sample period of {period_s:g} s gives over {_MOST_SAMPLES} samples; take a longer one")
        parts = [self._on_grid(run, period_s) for run in self.runs]
        signals = {name: np.concatenate([self[name][:0], *(part[name] for part in parts)]) for name in self}
        note = f"resampled from {self.sample_period_s:.6g} s (median) to {period_s:.6g} s by linear interpolation"
        return replace(self, signals=signals, notes=(*self.notes, note))

    def _on_grid(self, run: slice, period_s: float) -> dict[str, Array]:
        time = self.time_s[run]
        # Rounding must cost neither the last sample nor a held state its first one.
        slack = 1e-6
        grid = time[0] + period_s * np.arange(int((time[-1] - time[0]) / period_s + slack) + 1)
        held = np.searchsorted(time, grid + slack * period_s, side="right") - 1
        resampled = {}
        for name, values in self.signals.items():
            state = name in SIGNALS and SIGNALS[name].kind == "state"
            if name == "command_rad":  # it is known exactly, and a chord would leave it where it bends
                resampled[name] = samples_between(grid, time, values[run])
            elif name in SIGNALS and SIGNALS[name].kind == "position" and time.size > _OF_A_CURVE:
                resampled[name] = _curved(grid, time, values[run])
            else:
                resampled[name] = values[run][held] if state else np.interp(grid, time, values[run])
        return {**resampled, "time_s": grid}


def _curved(at_s: Array, time_s: Array, position: Array) -> Array:
    """A position (n,) at other times within its own, on Akima's curve.

    Where a sample was lost, a chord leaves a motor that speeds up by 5,000 rad/s² by 0.6 mrad in a gap of 1 ms.
    """
    from scipy.interpolate import Akima1DInterpolator  # takes a third of a second to import

    return Akima1DInterpolator(time_s, position)(np.clip(at_s, time_s[0], time_s[-1]))


def _frozen(values: ArrayLike) -> Array:
    """The values as float64 that cannot be written to; an array that is so already is shared, not copied."""
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and not values.flags.writeable:
        return values
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


# --- what sensors do to the signals: noise and quantisation, in the recording only (the loop does not see them) -------

_USER_STEP_RAD = 1e-6


@dataclass(frozen=True)
class Sensors:
    """Accuracy of a rig's sensors; zeros are perfect ones."""

    current_noise_A: float = 0.0  # rms, white at the sample rate
    encoder_bits: int = 0  # per motor turn

    def __post_init__(self) -> None:
        check_number(self.current_noise_A, "the current noise")
        check_number(self.encoder_bits, "the encoder's bits")
        if not 0.0 <= self.current_noise_A < 1e3:
            raise InputError(f"the current noise must lie between 0 and 1000 A rms, not {self.current_noise_A:g}")
        if not 0 <= self.encoder_bits <= 32:
            raise InputError(f"the encoder must have 0 (perfect) to 32 bits, not {self.encoder_bits}")

    def record(self, measurement: Measurement, seed: int) -> Measurement:
        """The measurement as these sensors would record it; reproducible by the seed.

        InputError for a seed that is no whole number.
        """
        check_seed(seed)
        random = np.random.default_rng(seed)
        changed = {}
        if self.current_noise_A:
            for name in ("current_A", "phase_a_current_A", "phase_b_current_A", "phase_c_current_A"):
                if name in measurement:
                    true = measurement[name]
                    changed[name] = true + self.current_noise_A * random.standard_normal(len(true))
        if self.encoder_bits:
            period = measurement.sample_period_s
            steps = {"motor_position_rad": 2.0 * np.pi / 2**self.encoder_bits, "user_position_rad": _USER_STEP_RAD}
            for name, step in steps.items():
                if name in measurement:
                    changed[name] = np.round(measurement[name] / step) * step
            if {"motor_position_rad", "motor_speed_rad_s"} <= measurement.signals.keys():
                # a rig's speed is the encoder's difference
                difference = np.diff(changed["motor_position_rad"], prepend=0.0) / period
                difference[0] = measurement["motor_speed_rad_s"][0]
                changed["motor_speed_rad_s"] = difference
        return measurement.with_signals(**changed)


# --- angles that a sensor gives within one turn (0 … 360°, ±π, one turn of counts), with their turns counted again ----
# A wrapped angle jumps by a turn, less the step of a sample, where it passes the end of its range; with the turn put
# back the step is like its neighbours'. Up to half a turn a sample the step itself says how often the range was passed,
# beyond it only a recorded speed does.

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
