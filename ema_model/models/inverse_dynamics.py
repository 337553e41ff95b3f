"""Motion in, current or torque out: for recordings whose controller is not known, and for static maps.

The current that the measured motion needs is held against the measured one after both have passed the filter
of the motion (`ema_model.models.motion`).  In a static map (the current that holds the rotor, against its
angle) nothing moves: what the model has to say there is what effects pull at the shaft.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.effects import find
from ema_model.errors import InputError, quoted
from ema_model.models.loop_window import CONTEXT
from ema_model.models.model import Effects, Signals, Window
from ema_model.models.motion import Motion, motion_of
from ema_model.models.sampling import check_period, on_even_grid
from ema_model.physics.rows import LANES
from ema_model.recordings import Measurement
from ema_model.recordings.noise import sample_noise
from ema_model.simulation.one_stack import stack_at_hand
from ema_model.simulation.pack import monitor_rows
from ema_model.simulation.precompile import wait_for
from ema_model.stacks import exclusive

Array = NDArray[np.float64]

_BLOCKS_PER_FILTER = 6  # compared values in a half width of the motion's filter
_CHUNK = 100_000  # samples that are computed at once
_STILL_STEPS = 3.0  # of the encoder within the filter, under which the motor counts as standing


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch(Window):
    """A window with its motion; measured is current_A or motor_torque_Nm, filtered like the model's.

    Blocks at standstill are left out: friction holds any current up to its static limit there.
    """

    motion: Motion
    position: Array  # (samples,), motor, rad
    load: Array  # (samples,), N·m at the user
    still: float  # rad/s
    sensor_noise: dict[str, float]  # rms per block
    moving: NDArray[np.intp]  # (blocks,), which of the run's blocks these are


class InverseDynamics:
    """Recordings with the motor's position and its current or torque."""

    simulates_commands = False

    def __init__(
        self,
        measurements: Sequence[Measurement],
        actuator: Actuator,
        *,
        effects: Mapping[str, Mapping[str, float]] | None = None,
        stretches: Sequence[list[slice] | None] | None = None,
    ) -> None:
        if not measurements:
            raise InputError("one recording or more is needed")
        self.actuator = actuator
        self.effects = {
            name: find(name, actuator.axes).settings(dict(given)) for name, given in (effects or {}).items()
        }
        self.stack = stack_at_hand(actuator, self.effects, "reduced", "currents")
        self.recorded = list(measurements)  # before they were put on an even grid
        self.measurements = [m if m.is_map else on_even_grid(m) for m in measurements]
        chosen = stretches or [None] * len(self.measurements)
        self.windows = [
            stretch
            for i, (m, parts) in enumerate(zip(self.measurements, chosen))
            for stretch in _stretches(m, actuator, recording=i, parts=parts)
        ]

    def signals(
        self,
        place: int,
        actuator: Actuator | None = None,
        k: ArrayLike | None = None,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        effects: Effects | None = None,
        *,
        even: bool = False,
    ) -> Signals:
        """The current (A) or torque (N·m) that the motion needs, k (n, 8) → (n, blocks); friction's k1 alone counts.

        As in `Model`; a start means nothing here, and the load is the recorded one.
        """
        window = self.windows[place]
        actuator = (actuator or self.actuator).varied(window.values)
        k = np.atleast_2d(np.asarray(actuator.k if k is None else k, dtype=float))
        rows = monitor_rows(actuator, k, self.stack, self.effects if effects is None else effects)
        # Effects see the angle as it was read; the acceleration's own part has passed the filter already.
        static = self._currents(rows, len(k), window, np.zeros_like(window.position))
        moving = self._currents(rows, len(k), window, window.motion.acceleration)
        needed = window.motion.filtered(static) + moving - static
        size = window.samples_per_block
        whole = needed.shape[1] // size
        current = needed[:, : whole * size].reshape(len(k), whole, size).mean(axis=2)[:, window.moving]
        sensors = actuator.sensors
        return {
            "current_A": _each(sensors.current_gain) * current + _each(sensors.current_bias_A),
            "motor_torque_Nm": _each(actuator.motor.torque_constant_Nm_A) * current,
        }

    def twin(self, place: int, *args: object, **options: object) -> Signals:
        """None: the Reference Model follows commands."""
        return {}

    def noise(self, place: int, stated: Mapping[str, float]) -> dict[str, float]:
        """As in `Model`, of the sensors after the filter, whatever is stated of them before it."""
        return dict(self.windows[place].sensor_noise)

    def a_sample_late(self, place: int, k: ArrayLike | None = None) -> Signals:
        """Nothing: no command is simulated."""
        return {}

    def _currents(self, rows: Array, n: int, window: Stretch, acceleration: Array) -> Array:
        """(n, samples), A"""
        wait_for(self.stack, "currents")
        currents = np.empty((n, window.position.size))
        for first in range(0, window.position.size, _CHUNK):
            part = slice(first, min(first + _CHUNK, window.position.size))
            result = np.empty((len(rows), part.stop - part.start, LANES))
            exclusive(
                self.stack.inverse.currents,
                rows,
                window.position[part],
                window.motion.speed[part],
                acceleration[part],
                window.load[part],
                window.still,
                result,
            )
            currents[:, part] = result.transpose(0, 2, 1).reshape(len(rows) * LANES, -1)[:n]
        return currents


def _stretches(
    measurement: Measurement, actuator: Actuator, *, recording: int, parts: list[slice] | None
) -> list[Stretch]:
    measurement.require("motor_position_rad")
    target = next((name for name in ("current_A", "motor_torque_Nm") if name in measurement), None)
    if target is None:
        wanted = f"current_A or {measurement.shown('motor_torque_Nm')}"
        raise InputError(f"{quoted(measurement.name)}: nothing to compare; {wanted} is needed")
    values = {path: value for rule in actuator.rules_for(measurement.name) for path, value in rule.values.items()}
    period = measurement.sample_period_s
    if not measurement.is_map:
        check_period(measurement, actuator.filter_s)
    size = 1 if measurement.is_map else max(1, round(actuator.filter_s / _BLOCKS_PER_FILTER / period))
    found = []
    runs = [slice(0, measurement.samples)] if measurement.is_map else parts or measurement.runs
    for run in runs:
        position = measurement["motor_position_rad"][run]
        blocks = position.size // size
        if blocks < 10:
            continue
        motion = _standing(position) if measurement.is_map else motion_of(position, period, actuator.filter_s)
        still = max(1e-9, _STILL_STEPS * _step_of(position) / (motion.kernel.size * period))
        slowest = np.abs(motion.speed[: blocks * size]).reshape(blocks, size).min(axis=1)
        moving = np.arange(blocks) if measurement.is_map else np.flatnonzero(slowest > still)
        if moving.size < 10:
            continue
        load = measurement.get("load_torque_Nm")

        def means(values: Array, blocks: int = blocks, moving: NDArray[np.intp] = moving) -> Array:
            return values[: blocks * size].reshape(blocks, size).mean(axis=1)[moving]

        raw = measurement[target][run]
        context = {
            "motor_position_rad": means(position),
            "motor_speed_rad_s": means(motion.speed),
            "acceleration_rad_s2": means(motion.acceleration),
            **{name: means(measurement[name][run]) for name in CONTEXT if name in measurement},
        }
        found.append(
            Stretch(
                name=measurement.name,
                recording=recording,
                first=run.start,
                time_s=means(measurement.time_s[run]),
                motion=motion,
                position=position,
                load=np.zeros_like(position) if load is None else load[run],
                still=still,
                command=None,
                measured={target: means(motion.filtered(raw))},
                context=context,
                sensor_noise={target: _noise(raw, target, motion.kernel, size)},
                moving=moving,
                samples_per_block=size,
                block_s=size * period,
                values=values,
            )
        )
    if not found:
        raise InputError(
            f"{quoted(measurement.name)}: too little motion to compare; {10 * size} samples in motion are needed"
        )
    return found


def _standing(position: Array) -> Motion:
    zero = np.zeros_like(position)
    return Motion(position, zero, zero, np.ones(1))


def _step_of(position: Array) -> float:
    """The smallest step between samples, rad: the encoder's resolution where it is seen."""
    steps = np.abs(np.diff(position))
    steps = steps[steps > 1e-9]
    return float(np.quantile(steps, 0.01)) if steps.size else 0.0


def _noise(raw: Array, signal: str, kernel: Array, size: int) -> float:
    """White noise of the raw signal after the filter and the mean over a block, rms."""
    return sample_noise(raw, signal) * float(np.sqrt(np.sum(np.convolve(kernel, np.full(size, 1.0 / size)) ** 2)))


def _each(value: ArrayLike) -> Array:
    """One number, or one for each individual, as a column."""
    return np.atleast_1d(np.asarray(value, dtype=float))[:, None]
