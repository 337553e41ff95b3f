"""The loop by itself, before any effect is tried: whose controller it is, if it repeats, if it can be simulated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.discovery.thresholds import GAIN_APART, LATE_SAMPLES, LAW_APART, LAW_HOLDS
from ema_model.estimation import Floor
from ema_model.estimation.model_fit import Data, Fit
from ema_model.estimation.noise import CORRELATED_S
from ema_model.models import Model
from ema_model.models.measured_motion import Motion, motion_of
from ema_model.models.model import Window
from ema_model.quantities import HALF_90
from ema_model.recordings import Measurement
from ema_model.result import NAME, NULL, as_named

# --- what a drive does with the measured motion: its current, held against the controller in the file -----------------
# Command and measured motion go into the speed loop's law, T 3.1; what comes out must be the current that flowed. No
# plant takes part in it, so that no missing physics can stand in for a controller that is not the drive's. The law is
# linear in its gains: least squares tells which ones the drive has, and after which delay it answers. An integral over
# a whole recording would drift with the last digit of an encoder: both sides lose what is slower than a window.

Array = NDArray[np.float64]

_HALF_S = 12e-3  # half width of the motion's filter
_WINDOW_S = 0.25  # beyond which what is slow is taken out: several times K_P/K_I of usual drives
_STEP = 3  # rows in such a half width
_LATEST_S = 6e-3  # that a drive may answer by, beyond the delay between the signals
_DELAYS = 25  # tried
_AT_LIMIT = 0.97  # of the current's limit, from which on it tells nothing of the gains
_BLOCKS = 8  # of time, by whose scatter the gains' uncertainty is told
_LEAST_ROWS = 60


@dataclass(frozen=True)
class Gain:
    """A gain of the controller, in the unit that ends its name."""

    path: str  # "controller.speed_gain_Nms_rad"
    file: Annotated[float, Meta(description="what the actuator's file says")]
    seen: Annotated[float, Meta(description="what the drive's current tells")]
    half: float  # of its 90 % interval

    @property
    def interval90(
        self,
    ) -> Annotated[tuple[float, float], Meta(description="the ends of the 90 % interval about seen")]:
        """Half of it to each side."""
        return self.seen - self.half, self.seen + self.half

    @property
    def differs(
        self,
    ) -> Annotated[bool, Meta(description="whether it is another than the file's, for sure and by much")]:
        """Whether it is another than the file's, for sure and by much."""
        away = abs(self.seen - self.file)
        return away > max(GAIN_APART * abs(self.file), 2.0 * self.half)


@dataclass(frozen=True)
class ControllerSeen:
    """The drive's controller, by its current, where it is not the file's."""

    gains: tuple[Gain, ...]
    delay_s: Annotated[  # beyond the delay between the signals
        float, Meta(description="s, by which it answers later than the file's controller")
    ]
    left_by_file: Annotated[float, Meta(description="share of the current's rms that the file's controller misses")]
    left: Annotated[float, Meta(description="the same with the gains and the delay that suit best")]
    sample_s: float  # of the recording

    @property
    def by_path(
        self,
    ) -> Annotated[dict[str, Gain], as_named("gains", "by their names in the actuator's file", **NAME)]:
        """The gains."""
        return {one.path: one for one in self.gains}

    @property
    def holds(
        self,
    ) -> Annotated[bool, as_named("same_form", "whether the law of the file's controller tells the current at all")]:
        """Whether the law tells the current at all, with gains of its own."""
        return self.left < LAW_HOLDS

    @property
    def late(self) -> bool:
        """Whether it answers later than the recording could hide."""
        return self.delay_s > LATE_SAMPLES * self.sample_s

    @property
    def differs(self) -> bool:
        """Whether the drive is not what the file says: it tells far less of the current than such a law could."""
        apart = self.left_by_file > LAW_APART * self.left and self.left_by_file - self.left > 0.01
        return apart and (self.late or not self.holds or any(gain.differs for gain in self.gains))


@dataclass(frozen=True, eq=False)
class _Run:
    """A run's rows: the torque that the drive asked for, and what its law makes it of; delay (s) → columns."""

    time_s: Array
    torque: Array  # (samples,), N·m
    error: Array  # ω_ref − ω, filtered
    integral: Array
    slope: Array
    rows: NDArray[np.intp]

    def columns(self, delay_s: float) -> Array:
        """(rows, 3)"""
        at = self.time_s[self.rows] - delay_s
        return np.column_stack([np.interp(at, self.time_s, one) for one in (self.error, self.integral, self.slope)])


def controller_seen(
    model: Model, actuator: Actuator, current_late_s: float = 0.0, measurements: Sequence[Measurement] | None = None
) -> ControllerSeen | None:
    """The controller that the recordings of a model show; None where they do not tell, or it is no cascade.

    current_late_s: what the recorded current comes later by than the recorded motion.
    """
    recorded = model.measurements if measurements is None else measurements
    if actuator.controller.kind != "cascade":
        return None
    runs = [run for one in recorded for run in _runs(one, actuator)]
    if sum(len(run.rows) for run in runs) < _LEAST_ROWS:
        return None
    controller = actuator.controller
    paths = ("speed_gain_Nms_rad", "integral_gain_Nm_rad", "derivative_gain_Nms2_rad")
    file = np.array([getattr(controller, name) for name in paths])
    free = np.array([True, True, file[2] != 0.0])
    delays = current_late_s + np.linspace(-0.25, 1.0, _DELAYS) * _LATEST_S
    fits = [_fitted(runs, delay, free) for delay in delays]
    best = int(np.argmin([left for _, left in fits]))
    gains, left = fits[best]
    half = _scatter(runs, float(delays[best]), free)
    size = float(np.sqrt(np.mean(np.concatenate([run.torque[run.rows] for run in runs]) ** 2)))
    by_file = _left(runs, current_late_s, file)
    seen = np.zeros(3)
    seen[free] = gains
    return ControllerSeen(
        gains=tuple(
            Gain(f"controller.{name}", float(file[i]), float(seen[i]), float(half[i]))
            for i, name in enumerate(paths)
            if free[i]
        ),
        delay_s=float(delays[best] - current_late_s),
        left_by_file=by_file / size,
        left=left / size,
        sample_s=max(one.sample_period_s for one in recorded),
    )


def _runs(measurement: Measurement, actuator: Actuator) -> Iterator[_Run]:
    recorded = None if measurement.is_map else _recorded(measurement, actuator)
    if recorded is None:
        return
    controller = actuator.controller
    period = measurement.sample_period_s
    gain = controller.position_gain_1_s * float(faults.physical(actuator.k).gain_factor)
    for run in measurement.runs:
        if run.stop - run.start < 10 * _HALF_S / period:
            continue
        command, user, motor, raw = (values[run] for values in recorded)
        motion = motion_of(motor, period, _HALF_S)
        omega = np.gradient(motor, period)
        behind = command - user
        wanted = np.clip(gain * behind, -controller.speed_limit_rad_s, controller.speed_limit_rad_s)
        error = wanted - omega
        limited = np.abs(raw) > _AT_LIMIT * actuator.current_limit_A
        held = limited
        if controller.integral_gain_Nm_rad > 0.0:  # without it nobody has set a window
            held = limited | (np.abs(behind) > controller.integrator_window_rad)
        integral = np.cumsum(np.where(held, 0.0, error)) * period
        width = min(round(_WINDOW_S / period), (run.stop - run.start) // 4)
        yield _Run(
            time_s=measurement.time_s[run],
            torque=controller.torque_constant_Nm_A * _quick(motion, raw, width),
            error=_quick(motion, error, width),
            integral=_quick(motion, integral, width),
            slope=_quick(motion, np.gradient(error, period), width),
            rows=_rows(held, motion.kernel.size + width // 2, max(1, round(_HALF_S / _STEP / period))),
        )


def _recorded(measurement: Measurement, actuator: Actuator) -> tuple[Array, Array, Array, Array] | None:
    """Command, the user's and the motor's position, and the current; None where the recording lacks one.

    A position that was not recorded follows from the other by the gear, where there is no play: a stiff loop makes a
    current of half a play, too.  A current follows from the motor's torque.
    """
    command, user = measurement.get("command_rad"), measurement.get("user_position_rad")
    motor, current = measurement.get("motor_position_rad"), measurement.get("current_A")
    torque, tau = measurement.get("motor_torque_Nm"), actuator.transmission.gear_ratio
    if current is not None:
        current = (current - actuator.sensors.current_bias_A) / actuator.sensors.current_gain
    elif torque is not None:
        current = torque / actuator.motor.torque_constant_Nm_A
    known = sum(one is not None for one in (user, motor))
    if command is None or current is None or known < (2 if actuator.transmission.backlash_rad else 1):
        return None
    at_user = tau * motor if user is None and motor is not None else user
    at_motor = user / tau if motor is None and user is not None else motor
    assert at_user is not None and at_motor is not None
    return command, at_user, at_motor, current


def _quick(motion: Motion, values: Array, width: int) -> Array:
    """Values (samples,) through the motion's filter, less their mean over `width` samples about each."""
    smooth = motion.filtered(values)
    return smooth - uniform_filter1d(smooth, width, mode="nearest")


def _rows(limited: NDArray[np.bool_], reach: int, step: int) -> NDArray[np.intp]:
    """Samples that no limit reaches through the filters."""
    near = limited.copy()
    near[[0, -1]] = True
    near = maximum_filter1d(near.astype(np.int8), 2 * reach + 1).astype(bool)
    return np.flatnonzero(~near)[::step]


def _centred(run: _Run, values: Array) -> Array:
    """Values (rows, …) less their mean: what the integral had come to at the start, and what limits did to it."""
    return values - values.mean(axis=0) if len(values) else values


def _fitted(runs: Sequence[_Run], delay_s: float, free: NDArray[np.bool_]) -> tuple[Array, float]:
    """The gains that suit best, and the rms torque that they leave, N·m."""
    columns = np.concatenate([_centred(run, run.columns(delay_s))[:, free] for run in runs])
    torque = np.concatenate([_centred(run, run.torque[run.rows]) for run in runs])
    scale = np.linalg.norm(columns, axis=0) + 1e-300
    gains = np.linalg.lstsq(columns / scale, torque, rcond=None)[0] / scale
    return gains, float(np.sqrt(np.mean((torque - columns @ gains) ** 2)))


def _left(runs: Sequence[_Run], delay_s: float, gains: Array) -> float:
    """The rms torque that known gains leave, N·m."""
    parts = [_centred(run, run.torque[run.rows] - run.columns(delay_s) @ gains) for run in runs]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _scatter(runs: Sequence[_Run], delay_s: float, free: NDArray[np.bool_]) -> Array:
    """Half of each gain's 90 % interval, from leaving out one block of time after the other (jackknife): (3,)."""
    columns = np.concatenate([_centred(run, run.columns(delay_s))[:, free] for run in runs])
    torque = np.concatenate([_centred(run, run.torque[run.rows]) for run in runs])
    scale = np.linalg.norm(columns, axis=0) + 1e-300
    blocks = np.array_split(np.arange(len(torque)), _BLOCKS)
    without = [np.setdiff1d(np.arange(len(torque)), block, assume_unique=True) for block in blocks]
    gains = np.array([np.linalg.lstsq(columns[at] / scale, torque[at], rcond=None)[0] / scale for at in without])
    half = np.zeros(3)
    half[free] = HALF_90 * np.sqrt((_BLOCKS - 1.0) / _BLOCKS * np.sum((gains - gains.mean(axis=0)) ** 2, axis=0))
    return half


# --- what can be repeated: how far two recordings of one command are apart --------------------------------------------
# No model can be nearer to both than they are to each other. Where that is far more than the floor, which is counted
# from the sensors' noise, the floor is not to be believed: the rig has a noise of its own.

_MOST = 2.0  # floors that two recordings of one command may be apart, for the floor to be believed
_SAME = 1e-3  # of a command's range, within which two are the same
_LENGTH = 0.02  # of their lengths, that they may differ by


@dataclass(frozen=True)
class Repeated:
    """The two recordings of one command that are furthest apart."""

    recordings: Annotated[tuple[str, str], Meta(description="their names")]
    apart: Annotated[float, as_named("over_floor", "rms of their difference over √2, in floors", **NULL)]
    signals: Annotated[dict[str, float], Meta(description="the same by signal, in its unit", extra={**NAME, **NULL})]

    @property
    def floor_believable(self) -> bool:
        """Whether they are as near to each other as the floor says."""
        return self.apart < _MOST


def repeated(data: Data, held: Data | None, actuator: Actuator) -> Repeated | None:
    """The two recordings of one command, fitted or held out, that are furthest apart; None where none was repeated."""
    known = [(one, part) for part in (data, held) if part is not None for one in part.measurements]
    pairs = [pair for pair in combinations(known, 2) if pair[0][0] is not pair[1][0]]
    twice = [pair for pair in pairs if _is_same(pair[0][0], pair[1][0])]
    cut = {id(part): _parts(part, actuator) for pair in twice for _, part in pair}
    found = [
        pair
        for (first, of_first), (second, of_second) in twice
        for one in cut[id(of_first)]
        for other in cut[id(of_second)]
        if one[0] is first and other[0] is second and (pair := _apart(one, other, data)) is not None
    ]
    return max(found, key=lambda pair: pair.apart, default=None)


_Part = tuple[Measurement, Window, Floor]


def _parts(data: Data, actuator: Actuator) -> Sequence[_Part]:
    windows = data.plant(actuator).windows
    return [(data.measurements[window.recording], window, floor) for window, floor in zip(windows, data.floors)]


def _apart(one: _Part, other: _Part, data: Data) -> Repeated | None:
    (first, its, floor), (second, theirs, _) = one, other
    if its.first != theirs.first:
        return None
    blocks = min(its.blocks, theirs.blocks)
    known = data.fitted(its.measured.keys() & theirs.measured.keys())
    if not known:
        return None
    ours, others = its.measured, theirs.measured
    differences = {name: (ours[name][:blocks] - others[name][:blocks]) / np.sqrt(2.0) for name in known}
    over_floor = [differences[name] / floor.sigma(name)[:blocks] for name in known]
    squared = [np.average(one**2, weights=floor.counts[:blocks]) for one in over_floor]
    return Repeated(
        (first.name, second.name),
        float(np.sqrt(np.mean(squared))),
        {name: float(np.sqrt(np.mean(value**2))) for name, value in differences.items()},
    )


def _is_same(first: Measurement, second: Measurement) -> bool:
    """Whether they are of one command, sample by sample."""
    if "command_rad" not in first or "command_rad" not in second:
        return False
    if not np.isclose(first.sample_period_s, second.sample_period_s, rtol=1e-3):
        return False
    length = min(first.samples, second.samples)
    if length < (1.0 - _LENGTH) * max(first.samples, second.samples):
        return False
    one, other = first["command_rad"][:length], second["command_rad"][:length]
    moved = float(np.ptp(one))
    return moved > 0.0 and bool(np.max(np.abs(one - other)) <= _SAME * moved)


# --- Whether a closed loop can be simulated at all: two models that hardly differ must behave alike -------------------
# A limit cycle of backlash, or a motor that sticks now here, now there, makes them drift apart; a comparison in time
# means nothing then, and what the motor needed (inverse dynamics) is compared instead.


_APART = 5e-4  # of the inertia
_IN_PROPORTION = 2.0 * _APART  # of a signal: what any loop's may change by
_LOST = 0.5  # of the blocks, from which on a recording cannot be compared in time


def with_divergence(data: Data, found: Fit) -> tuple[Data, float]:
    """The data with what such neighbours differ by in the model's floor, and the share of blocks that are lost.

    A block is lost where the neighbours' currents (or positions) differ by more than the noise, and by more than in
    proportion: a recording without noise would show any change.
    """
    plant = found.plant
    if not plant.simulates_commands:
        return data, 0.0
    fitted = found.calibration.actuator
    inertia = fitted.value("motor.inertia_kgm2")
    neighbour = fitted.varied({"motor.inertia_kgm2": inertia * np.array([1.0, 1.0 + _APART])})
    k = np.tile(found.calibration.k, (2, 1))
    floors, lost = [], []
    for i, (window, one) in enumerate(zip(plant.windows, data.floors)):
        shown = plant.signals(i, neighbour, k, *found.calibration.start_of(i))
        width = max(3, round(CORRELATED_S / window.block_s) | 1)
        apart = {
            name: np.sqrt(np.maximum(uniform_filter1d((shown[name][1] - shown[name][0]) ** 2, width), 0.0))
            for name in one.model
        }
        floors.append(one.beside(replace(one, model=apart)))
        name = next(iter(data.fitted(apart)), None)
        if name is not None:
            size = float(np.sqrt(np.mean(window.measured[name] ** 2)))
            lost.append(apart[name] > max(one.noise[name], _IN_PROPORTION * size))
    return replace(data, floors=floors), float(np.mean(np.concatenate(lost)) if lost else 0.0)


def is_lost(share: float) -> bool:
    """Whether too little is left to compare in time."""
    return share > _LOST


def by_inverse_dynamics(measurements: Sequence[Measurement], actuator: Actuator) -> Actuator | None:
    """The actuator without its controller, where the recordings tell what the motor needed; None where they do not."""
    if all("motor_position_rad" in one and ("current_A" in one or "motor_torque_Nm" in one) for one in measurements):
        return actuator.without_controller()
    return None
