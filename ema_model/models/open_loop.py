"""Runs in open loop: a recorded current, torque, force, voltage or duty in, the motion out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.models.closed_loop import ClosedLoop
from ema_model.models.loop_window import LoopWindow
from ema_model.models.measured_motion import on_even_grid
from ema_model.models.model import Signals
from ema_model.recordings import Measurement
from ema_model.side_by_side import windows

Array = NDArray[np.float64]

_MOTION = ("motor_speed_rad_s", "motor_position_rad", "user_position_rad")


def simulate_open_loop(
    recorded: Measurement,
    actuator: Actuator,
    k: ArrayLike | None = None,
    effects: Mapping[str, Mapping[str, float]] | None = None,
) -> Measurement:
    """The motion that a recording's current, or else its motor torque, brings about; names are those inside.

    With a voltage drive (`Actuator.in_open_loop`) it is the recording's voltage or duty, and the current comes out too.

    Each run of the recording starts from its first sample: at the motor's and the user's position where they were
    recorded, else at zero, and at rest.  What was put in, the load and the run's number stand beside the motion, on
    the recording's time, or an even grid of its own period.  Faults are of k; a recording without such a signal
    raises InputError, FloatingPointError one with which the model diverges.
    """
    if not any(name in recorded for name in _MOTION):
        recorded = recorded.with_signals(user_position_rad=np.zeros(recorded.samples))
    model = ClosedLoop([recorded], actuator.in_open_loop(recorded.signals), effects=effects, block_s=0.0)
    shown_too = ("current_A",) if model.actuator.takes_voltage else ()
    source = model.measurements[0]
    parts: list[dict[str, Array]] = []
    for place, window in enumerate(model.windows):
        shown = model.signals(place, k=k)
        begins = window.first
        start = window.user_rad / actuator.transmission.gear_ratio
        first = dict(zip(_MOTION, (window.speed_rad_s, start, window.user_rad)))
        first["user_position_rad"] += window.play_rad * actuator.transmission.gear_ratio
        kept = ("time_s", window.input, "bus_voltage_V", "load_torque_Nm", "segment")
        rows = slice(begins, begins + window.blocks + 1)
        part = {name: source[name][rows] for name in kept if name in source}
        part |= {name: np.concatenate([[first[name]], shown[name][0]]) for name in _MOTION}
        part |= {name: shown[name][0][np.r_[0, : window.blocks]] for name in shown_too}
        parts.append(part)
    signals = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    for name in _MOTION:
        if not np.all(np.isfinite(signals[name])):
            at = signals["time_s"][int(np.argmin(np.isfinite(signals[name])))]
            raise FloatingPointError(f"the model diverged from {at:g} s on; check the settings")
    return replace(Measurement(signals), name="open loop")


# --- the motion of whole recordings, of an actuator whose controller is not known -------------------------------------

_START_FILTERS = 2.0  # half widths of the motion's filter, over which the start is estimated
_LEAST_START = 10  # samples of it, at least
_LARGEST_OFFSET = 0.5  # of the rms of what is put in
_FINEST_OFFSET = 1e-5  # of the same, to which the offset is sought
_OFFSET_STEP_S = 2e-4  # of the model, at which it is sought
_MOST_STEPS = 6e6  # of the model for it, over all trials
_LEAST_TRIALS, _MOST_TRIALS = 8, 30
_DIVERGED = 1e9  # rad, that a position which diverges counts as


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """Runs of recordings in open loop, from their first state on, with nothing of the measured motion fed back."""

    windows: Sequence[LoopWindow]
    signals: Sequence[Signals]  # by window, (blocks,) each; not finite where the model diverges
    offsets: Sequence[float]  # by recording, that were added to what was put in, A or N·m
    beside: Sequence[Sequence[Signals]]  # as `signals`, with offsets a hundred-thousandth of the input less, and more


def free_motion(recordings: Sequence[Measurement], actuator: Actuator, offset: float | None = None) -> FreeMotion:
    """The motion that the recorded current, or torque, brings about in an actuator that was fitted by inverse dynamics.

    Position and speed at the start are those of a parabola through a run's first samples.  offset: what is added to the
    recorded current (A), or torque (N·m), all along; without it, in each recording the constant with which its position
    is met best: a sensor's zero that drifts by a thousandth adds up to as much as all else.
    The sensors' gain, bias and delay are taken off the recorded current, and the apparent inertia of a current loop
    stands beside the motor's own, as in `InverseDynamics`.  Raises InputError for recordings that cannot be simulated.
    """
    model, offsets = driven_freely(recordings, actuator, offset)
    sizes = [_size(model, recording) for recording in range(len(recordings))]
    less, more = (
        [offset + sign * _FINEST_OFFSET * size for offset, size in zip(offsets, sizes)] for sign in (-1.0, 1.0)
    )
    return FreeMotion(model.windows, _moved(model, offsets), offsets, [_moved(model, one) for one in (less, more)])


def driven_freely(
    recordings: Sequence[Measurement], actuator: Actuator, offset: float | None = None
) -> tuple[ClosedLoop, list[float]]:
    """The model of `free_motion` before its offsets are put in, and these, by recording."""
    even = [on_even_grid(one) for one in recordings]
    ratio = 1.0 + float(actuator.sensors.apparent_inertia)
    bare = actuator.varied({"motor.inertia_kgm2": actuator.motor.inertia_kgm2 * ratio}).in_open_loop()
    model = ClosedLoop([_as_put_in(one, actuator) for one in even], bare, block_s=0.0)
    model.windows = [_from_start(one, even[one.recording], actuator) for one in model.windows]
    offsets = [0.0 if offset is None else offset] * len(even)
    if offset is None:
        coarse = model.at_longer_steps(_OFFSET_STEP_S)
        offsets = [_best_offset(coarse, recording) for recording in range(len(even))]
    return model, offsets


def _as_put_in(measurement: Measurement, actuator: Actuator) -> Measurement:
    """With the current (or torque) that acted, from the one that was recorded."""
    rules = {path: value for rule in actuator.rules_for(measurement.name) for path, value in rule.values.items()}
    sensors, time = actuator.varied(rules).sensors, measurement.time_s
    changed = {}
    if "current_A" in measurement:
        changed["current_A"] = (measurement["current_A"] - sensors.current_bias_A) / sensors.current_gain
    elif "motor_torque_Nm" in measurement:
        changed["motor_torque_Nm"] = measurement["motor_torque_Nm"].astype(float)
    if sensors.delay_s:  # it was recorded later than the motion
        for values in changed.values():
            for run in measurement.runs:
                values[run] = np.interp(time[run] + sensors.delay_s, time[run], values[run].copy())
    return measurement.with_signals(**changed)


def _from_start(window: LoopWindow, measurement: Measurement, actuator: Actuator) -> LoopWindow:
    """The window, begun at the estimated position and speed, rad and rad/s of the motor."""
    period = measurement.sample_period_s
    samples = max(_LEAST_START, round(_START_FILTERS * actuator.filter_s / period))
    first = measurement["motor_position_rad"][window.first : window.first + min(samples, window.blocks)]
    _, speed, position = np.polyfit(period * np.arange(first.size), first, 2)
    return replace(window, user_rad=float(position) * actuator.transmission.gear_ratio, speed_rad_s=float(speed))


def _moved(model: ClosedLoop, offsets: Sequence[float], recording: int | None = None) -> list[Signals]:
    """The signals of every window, or of one recording's, (blocks,) each; offsets: of what is put in, by recording."""
    chosen = [window for window in model.windows if recording in (None, window.recording)]

    def of_window(window: LoopWindow) -> Signals:
        moved = copy(model)
        moved.windows = [replace(window, command=window.command + offsets[window.recording])]
        with np.errstate(over="ignore", invalid="ignore"):  # of one that diverges
            return {name: values[0] for name, values in moved.signals(0).items()}

    return windows(of_window, chosen)


def _size(model: ClosedLoop, recording: int) -> float:
    """The rms of what is put in, A or N·m."""
    put_in = [window.command for window in model.windows if window.recording == recording]
    return float(np.sqrt(np.mean(np.concatenate(put_in) ** 2))) if put_in else 0.0


def _best_offset(model: ClosedLoop, recording: int) -> float:
    """The offset of what is put in with which the model meets the motor's position in a recording best."""
    from scipy.optimize import minimize_scalar  # takes a third of a second to import

    chosen = [window for window in model.windows if window.recording == recording]
    if not chosen:
        return 0.0
    size = _size(model, recording)
    trials = int(np.clip(_MOST_STEPS / sum(one.command.size for one in chosen), _LEAST_TRIALS, _MOST_TRIALS))
    if size == 0.0:
        return 0.0

    def missed(offset: float) -> float:
        squared = 0.0
        offsets = [offset] * len(model.measurements)
        for window, signals in zip(chosen, _moved(model, offsets, recording)):
            error = signals["motor_position_rad"] - window.measured["motor_position_rad"]
            squared += float(np.sum(np.clip(np.nan_to_num(error, nan=_DIVERGED), -_DIVERGED, _DIVERGED) ** 2))
        return squared

    found = minimize_scalar(
        missed,
        bounds=(-_LARGEST_OFFSET * size, _LARGEST_OFFSET * size),
        method="bounded",
        options={"maxiter": trials, "xatol": _FINEST_OFFSET * size},
    )
    return float(found.x) if found.fun < missed(0.0) else 0.0
