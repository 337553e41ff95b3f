"""A window for the closed loop, ready for the kernels: inputs per step of the model, block means to compare with."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import CURRENT_INPUTS, VOLTAGE_INPUTS, coarsest_step
from ema_model.commands.command import between
from ema_model.errors import InputError, quoted
from ema_model.models.model import Window
from ema_model.recordings import SIGNALS, Measurement
from ema_model.recordings.column_mapping import MOST_DUTY
from ema_model.recordings.read import WITHOUT_COMMAND
from ema_model.recordings.signals import beating, held, is_of_grid
from ema_model.remembered import remembered
from ema_model.simulation.pack import integral_at_start
from ema_model.simulation.run import steps_per_sample

Array = NDArray[np.float64]

_BESIDE = 20  # samples behind a time, that tell how a command goes there
_FOLLOWED_S = 0.5  # before a start in mid-run: what a drive's goal still remembers
COMPARED = ("current_A", "motor_speed_rad_s", "motor_position_rad", "user_position_rad")
_SURELY = 4.0  # standard errors of a slope, from which on it moves
_OF_A_LINE = 4  # samples, that tell a slope and its error
_STEADY = 0.75  # of the speed in the second half of a time, that it is in the first: from rest it is a third
_SLOPE_SAMPLES = 10  # on either side of a start in mid-run, over which the speed is found
_COARSE_S = 0.01  # the same of the user's encoder, which is coarse beside a motor's
CONTEXT = ("load_torque_Nm", "temperature_C")
BLOCK_S = 0.5e-3  # means over it take the chopping ripple away, which no low-fidelity model follows (MODEL §2)


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopWindow(Window):
    """A window with its inputs, (steps,), and its start; measured are block means of `COMPARED`, as recorded."""

    command: Array  # rad; in an open loop A, N·m, V or a share of the bus voltage
    before: Array  # the same up to the window's start, (earlier steps,): what its drive has followed
    input: str  # the signal that it is of, by its name inside
    load: Array  # N·m at the user
    supply: Array  # bus voltage over nominal, or in an open loop in V; 0 where the drive is off
    steps_per_sample: int
    step_s: float
    user_rad: float  # where it starts: the motor's angle as a user's, rad
    speed_rad_s: float
    play_rad: float  # place in the play, rad at the motor
    current_A: float  # that the drive wanted
    begins_s: float  # since the recording's start

    def integral_Nm(
        self,
        actuator: Actuator,
        k: ArrayLike,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        pull_Nm: ArrayLike = 0.0,
    ) -> Array:
        """The integral action of the speed loop at the start, for k (n, 8) or (8,): `integral_at_start`.

        turned_rad, play_rad, pull_Nm: the start beyond what was measured of it, rad and torque at the motor.
        """
        away = (np.asarray(turned_rad) + self.play_rad + np.asarray(play_rad)) * actuator.transmission.gear_ratio
        start = float(self.command[0]), self.user_rad + away, self.speed_rad_s, self.current_A
        return integral_at_start(actuator, k, *start) + np.asarray(pull_Nm)

    def at_longer_steps(self, most_s: float) -> LoopWindow:
        """The same at the longest steps up to most_s, s, of which a sample holds a whole number."""
        steps = self.steps_per_sample
        times = max(n for n in range(1, steps + 1) if steps % n == 0 and (n == 1 or n * self.step_s <= most_s + 1e-12))
        # in one piece, as at the own step: a kernel is compiled anew for an array that is not
        inputs = {
            name: np.ascontiguousarray(getattr(self, name)[::times]) for name in ("before", "command", "load", "supply")
        }
        return replace(self, **inputs, steps_per_sample=steps // times, step_s=self.step_s * times)

    @property
    def steps_per_block(self) -> int:
        """Model steps between compared values."""
        return self.samples_per_block * self.steps_per_sample


def cut(
    measurement: Measurement,
    actuator: Actuator,
    *,
    recording: int = 0,
    block_s: float = BLOCK_S,
    stretches: list[slice] | None = None,
) -> list[LoopWindow]:
    """Windows of a recording on an even grid: its runs, or the given stretches of samples.

    block_s: 0 compares every sample.  Raises InputError if nothing can be compared.
    """
    put_in = input_of(measurement, actuator)
    known = [name for name in COMPARED if name != "current_A" or put_in not in CURRENT_INPUTS]
    if not any(name in measurement for name in known):
        wanted = ", ".join(measurement.shown(name) for name in known)
        raise InputError(f"{quoted(measurement.name)}: nothing to compare; one of {wanted} is needed")
    period = measurement.sample_period_s
    samples = max(1, round(block_s / period))
    steps = steps_per_sample(period, min(actuator.step_s, coarsest_step(period)))
    step_s = period / steps
    values = {path: value for rule in actuator.rules_for(measurement.name) for path, value in rule.values.items()}
    if put_in == "motor_voltage_V" or (put_in == "duty" and "bus_voltage_V" in measurement):
        values["inverter.bus_voltage_V"] = 1.0  # what is put in, or the supply beside it, is in V already
    windows = []
    for run in stretches or measurement.runs:
        blocks = (run.stop - run.start - 1) // samples
        if blocks < 10:
            continue
        compared = slice(run.start + 1, run.start + 1 + blocks * samples)

        def means(name: str, compared: slice = compared, blocks: int = blocks) -> Array:
            return measurement[name][compared].reshape(blocks, samples).mean(axis=1)

        inputs = _inputs(measurement, actuator, put_in, run, blocks * samples * steps, step_s)
        user, speed, play = _start(measurement, actuator, run.start)
        current = _current(measurement, actuator, run.start, speed)
        windows.append(
            LoopWindow(
                name=measurement.name,
                recording=recording,
                first=run.start,
                time_s=means("time_s"),
                command=inputs[0],
                before=_before(measurement, actuator, run, steps, step_s),
                input=put_in,
                load=inputs[1],
                supply=inputs[2],
                measured={name: means(name) for name in known if name in measurement},
                context={name: means(name) for name in CONTEXT if name in measurement},
                samples_per_block=samples,
                block_s=samples * steps * step_s,
                steps_per_sample=steps,
                step_s=step_s,
                user_rad=user,
                speed_rad_s=speed,
                play_rad=play,
                current_A=current,
                begins_s=float(measurement.time_s[run.start] - measurement.time_s[0]),
                values=values,
                beating={
                    name: beating(measurement[name][compared], samples)
                    for name in known
                    if name in measurement and SIGNALS[name].kind == "position"
                },
                held_s={
                    name: held(measurement[name][compared], samples) * period for name in known if name in measurement
                },
                on_grid=frozenset(
                    name for name in known if name in measurement and is_of_grid(measurement[name][compared])
                ),
            )
        )
    if not windows:
        short = f"{measurement.duration_s:g} s are too short to compare; {10 * samples * period:g} s are needed"
        raise InputError(f"{quoted(measurement.name)}: {short}; check the unit of time_s")
    return windows


def input_of(measurement: Measurement, actuator: Actuator) -> str:
    """The signal that is put in: the command, in an open loop the current or torque, or the voltage or duty.

    InputError without one, and for a duty of a supply that is not known.
    """
    if actuator.controller.kind != "open":
        has_input = "current_A" in measurement or "motor_torque_Nm" in measurement
        measurement.require("command_rad", without=WITHOUT_COMMAND if has_input else "")
        return "command_rad"
    inputs = VOLTAGE_INPUTS if actuator.takes_voltage else CURRENT_INPUTS
    found = [name for name in inputs if name in measurement]
    if not found:
        measurement.require(inputs[0], without=f"or {inputs[1]}")
    if found[0] == "duty" and (most := float(np.max(np.abs(measurement["duty"])))) > MOST_DUTY:
        raise InputError(
            f"{quoted(measurement.name)}: its duty goes to {most:g}, and a share of the bus voltage is within ±1; say "
            "what full is by --map, as duty=COLUMN[/255] or duty=COLUMN[%]"
        )
    if found[0] == "duty" and "bus_voltage_V" not in measurement and actuator.inverter.bus_voltage_V == 0.0:
        raise InputError(
            f"{quoted(measurement.name)}: a duty is a share of the bus voltage, which is not known; say it in the "
            "actuator's file, [inverter] bus_voltage_V, or map a column to bus_voltage_V"
        )
    return found[0]


def _inputs(
    measurement: Measurement, actuator: Actuator, put_in: str, run: slice, steps: int, step_s: float
) -> tuple[Array, ...]:
    """Command, load and supply at every step; linear between samples, but for jumps and the drive's switch."""
    time = measurement.time_s[run] - measurement.time_s[run.start]
    at = np.arange(steps) * step_s - actuator.sensors.delay_s
    command = _put_in(measurement, put_in, run.start, run.stop, steps, step_s, actuator.sensors.delay_s)
    load = measurement.get("load_torque_Nm")
    loads = np.zeros(steps) if load is None else np.interp(at, time, load[run])
    bus = measurement.get("bus_voltage_V")
    supply = np.ones(steps)
    if bus is not None and actuator.inverter.kind == "voltage" and put_in != "motor_voltage_V":
        nominal = 1.0 if put_in == "duty" else actuator.inverter.bus_voltage_V
        supply = np.interp(at, time, bus[run]) / nominal
    enabled = measurement.get("drive_enabled")
    if enabled is not None:
        held = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 1)
        supply = np.where(enabled[run][held] > 0.5, supply, 0.0)
    return command, loads, supply


def _before(measurement: Measurement, actuator: Actuator, run: slice, steps: int, step_s: float) -> Array:
    """What a drive that follows its command was told before a stretch, at every step."""
    if actuator.controller.kind == "open":
        return np.zeros(0)
    whole = next(one for one in measurement.runs if one.start <= run.start < one.stop)
    first = max(whole.start, run.start - round(_FOLLOWED_S / measurement.sample_period_s))
    if first == run.start:
        return np.zeros(0)
    lead, last = (run.start - first) * steps, min(whole.stop, run.start + _BESIDE)
    return _put_in(measurement, "command_rad", first, last, lead, step_s, actuator.sensors.delay_s)


@remembered(
    of=0
)  # the measurement: every model of a discovery is put beside the same windows, and what came before each
def _put_in(
    measurement: Measurement, name: str, first: int, last: int, steps: int, step_s: float, delay_s: float
) -> Array:
    """What is put in at every step of a run, (steps,): shared by all windows of it, which only read it."""
    run = slice(first, last)
    time = measurement.time_s[run] - measurement.time_s[first]
    at = np.arange(steps) * step_s - delay_s
    if name in CURRENT_INPUTS and measurement.side.sampling != "instantaneous":  # of each period its own mean
        held = np.clip(np.floor(at / measurement.sample_period_s + 1e-6).astype(int) + 1, 0, time.size - 1)
        return np.asarray(measurement[name][run][held].astype(float))
    return between(at, time, measurement[name][run], moving=True).astype(float)


def _start(measurement: Measurement, actuator: Actuator, at: int) -> tuple[float, float, float]:
    """Where the actuator stands at a sample: motor angle as a user's, motor speed, place in the play."""
    tau = actuator.transmission.gear_ratio
    user = measurement.get("user_position_rad")
    motor = measurement.get("motor_position_rad")
    speed = measurement.get("motor_speed_rad_s")
    asked = measurement.get("command_rad") if user is None else user
    at_user = 0.0 if asked is None else float(asked[at])
    if motor is None:
        moving = 0.0 if user is None else _slope(measurement, user, at, _COARSE_S) / tau
        return at_user, moving if speed is None else float(speed[at]), 0.0
    play = 0.0 if user is None else at_user / tau - float(motor[at])
    return float(motor[at]) * tau, _slope(measurement, motor, at), play


def _slope(measurement: Measurement, position: Array, at: int, least_s: float = 0.0) -> float:
    """The speed of a position about a sample; a rig's own is often the encoder's difference, far too coarse for one.

    least_s: on either side, over which it is found at least.  Where a recording begins, it is 0 unless it begins in
    mid motion: from rest, the second half of a time is run through at three times the first one's speed, if that time
    is no longer than the start takes, and so it is halved as long as the speed is seen.
    """
    samples = max(_SLOPE_SAMPLES, round(least_s / measurement.sample_period_s))
    time = measurement.time_s
    if at > 0:
        near = _near(at, samples)
        return _line(time[near], position[near])[0]
    moving = 0.0
    while samples >= _OF_A_LINE:
        halves = slice(samples), slice(samples, 2 * samples)
        (early, error), (late, other) = (_line(time[half], position[half]) for half in halves)
        if abs(early) <= _SURELY * error:
            break
        is_steady = late != 0.0 and _STEADY < early / late < 1.0 / _STEADY
        if not is_steady and (not moving or abs(early - late) > _SURELY * math.hypot(error, other)):
            return 0.0
        moving = moving or 1.5 * early - 0.5 * late
        samples //= 2
    return moving


def _line(time_s: Array, position: Array) -> tuple[float, float]:
    """The slope of a position, and its standard error; 0 of too few samples."""
    if len(time_s) < _OF_A_LINE:
        return 0.0, math.inf
    (slope, _), covariance = np.polyfit(time_s, position, 1, cov=True)
    return float(slope), math.sqrt(covariance[0, 0])


def _current(measurement: Measurement, actuator: Actuator, at: int, speed: float) -> float:
    """The current at a sample, A, as measured; else what load, drag and friction take at that speed."""
    current = measurement.get("current_A")
    if current is not None:
        near = slice(0, 1) if at == 0 else _near(at)  # nothing is known of what was before a recording
        return float((current[near].mean() - actuator.sensors.current_bias_A) / actuator.sensors.current_gain)
    load = measurement.get("load_torque_Nm")
    pull = 0.0 if load is None else actuator.transmission.gear_ratio * float(load[at])
    motor = actuator.motor
    drag = motor.viscous_friction_Nms_rad * speed + motor.dynamic_friction_Nm * np.sign(speed)
    return float(pull + drag) / motor.torque_constant_Nm_A


def _near(at: int, samples: int = _SLOPE_SAMPLES) -> slice:
    return slice(max(0, at - samples), at + samples)
