"""Motion in, current or torque out: for recordings whose controller is not known, and for static maps.

The current that the measured motion needs is held against the measured one after both have passed the filter
of the motion (`ema_model.models.measured_motion`).  In a static map (the current that holds the rotor, against its
angle) nothing moves: what the model has to say there is what effects pull at the shaft.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.effects import find
from ema_model.errors import InputError
from ema_model.models.measured_motion import Stretch, later, on_even_grid, stretches_of
from ema_model.models.model import Effects, ModelParts, Signals
from ema_model.physics.rows import LANES
from ema_model.recordings import Measurement
from ema_model.recordings.signals import least_noise
from ema_model.simulation.pack import monitor_rows, stack_at_hand
from ema_model.simulation.run import needed_currents
from ema_model.stacks import Stack

Array = NDArray[np.float64]

_NO_MOTION = 1e-300  # rad²/s⁴
_CHUNK = 100_000  # samples that are computed at once
# Times what filtering a speed once more changes, that it is off by where the motor turns round and may stand a while:
# clean plants of another simulator (`tests/benchmarks/mujoco_plants.py`) leave 0.9 to 1.1 floors with it, 1.0 to 1.6
# without.
_ROUNDED = 3.0


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
        at_once: bool = True,
    ) -> None:
        """at_once: as of `ClosedLoop`."""
        if not measurements:
            raise InputError("one recording or more is needed")
        self.actuator = actuator
        self.effects = {
            name: find(name, actuator.axes).settings(dict(given)) for name, given in (effects or {}).items()
        }
        self.recorded = list(measurements)  # before they were put on an even grid
        self._stretches = stretches
        if at_once:
            _ = self.stack, self.windows

    def made_of(self) -> ModelParts:
        """As in `Model`."""
        return ModelParts(self.recorded, self.actuator, self.effects, self._stretches, "reduced", 0.0)

    @cached_property
    def stack(self) -> Stack:
        """As in `Model`."""
        return stack_at_hand(self.actuator, self.effects, "reduced", "currents")

    @cached_property
    def measurements(self) -> list[Measurement]:
        """As in `Model`."""
        return [m if m.is_map else on_even_grid(m) for m in self.recorded]

    @cached_property
    def windows(self) -> list[Stretch]:
        """As in `Model`."""
        chosen = self._stretches or [None] * len(self.measurements)
        return [
            stretch
            for i, (m, parts) in enumerate(zip(self.measurements, chosen))
            for stretch in stretches_of(self.recorded[i], m, self.actuator, recording=i, parts=parts)
        ]

    def signals(
        self,
        place: int,
        actuator: Actuator | None = None,
        k: ArrayLike | None = None,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
        faster_rad_s: ArrayLike = 0.0,
        pull_Nm: ArrayLike = 0.0,
        effects: Effects | None = None,
        *,
        even: bool = False,
    ) -> Signals:
        """The current (A) or torque (N·m) that the motion needs, k (n, 8) → (n, blocks); friction's k1 alone counts.

        As in `Model`; a start means nothing here, and the load is the recorded one.  The sensors' delay is what
        the current (or torque) comes later by than the motion.  A drive's command exceeds its current by what its
        current loop leaves of the back-EMF's rate, an apparent inertia of k_t²/(R ω_c) (PI loop of bandwidth ω_c).
        """
        window = self.windows[place]
        actuator = (actuator or self.actuator).varied(window.values)
        k = np.atleast_2d(np.asarray(actuator.k if k is None else k, dtype=float))
        rows = monitor_rows(actuator, k, self.stack, self.effects if effects is None else effects)
        # Effects see the angle as it was read. What goes with the acceleration alone has passed the filter already;
        # what of it changes as fast as an angle's ripple, or with the direction, has not.
        acceleration = window.motion.acceleration
        static = self._currents(rows, len(k), window, np.zeros_like(acceleration))
        moving = self._currents(rows, len(k), window, acceleration)
        squared = max(float(np.sum(acceleration**2)), _NO_MOTION)
        even = np.sum((moving - static) * acceleration, axis=1, keepdims=True) / squared * acceleration
        needed = window.motion.filtered(moving - even) + even + _of_loop(actuator) * acceleration
        needed = later(needed, _each(actuator.sensors.delay_s), window.period_s, smooth=True)
        current = _by_block(needed, window)
        sensors = actuator.sensors
        return {
            "current_A": _each(sensors.current_gain) * current + _each(sensors.current_bias_A),
            "motor_torque_Nm": _each(actuator.motor.torque_constant_Nm_A) * current,
        }

    def at_longer_steps(self, most_s: float) -> InverseDynamics:
        """Itself, which has no steps."""
        return self

    def twins(self, place: int, *args: object, **options: object) -> Signals:
        """None: the Reference Model follows commands."""
        return {}

    def noise(self, place: int, stated: Mapping[str, float]) -> dict[str, float]:
        """As in `Model`, of the sensors after the filter."""
        window = self.windows[place]
        return {
            name: max(stated[name], least_noise(name)) * window.passed if name in stated else own
            for name, own in window.sensor_noise.items()
        }

    def a_sample_late(self, place: int, k: ArrayLike | None = None) -> Signals:
        """Nothing: no command is simulated."""
        return {}

    def between_samples(self, place: int, k: ArrayLike | None = None) -> Signals:
        """Nothing: no command is simulated."""
        return {}

    def turning(self, place: int, k: ArrayLike | None = None) -> Signals:
        """As in `Model`: the filter rounds off the moment of a reversal, and where the motor stood.

        Half of what the current differs by between two speeds, as far on either side of the filtered one as that is
        off: by what filtering it once more changes.
        """
        window, actuator = self.windows[place], self.actuator.varied(self.windows[place].values)
        rows = monitor_rows(actuator, np.atleast_2d(actuator.k if k is None else k), self.stack, self.effects)
        rounded = window.motion.filtered(window.motion.speed) - window.motion.speed
        off = _ROUNDED * np.sqrt(np.maximum(window.motion.filtered(rounded**2), 0.0))
        resting = np.zeros_like(window.position)
        either = [self._currents(rows, 1, replace(window, speed=window.speed + s * off), resting) for s in (1.0, -1.0)]
        [current] = _by_block(0.5 * np.abs(window.motion.filtered(either[0] - either[1])), window)
        return {"current_A": current, "motor_torque_Nm": actuator.motor.torque_constant_Nm_A * current}

    def _currents(self, rows: Array, n: int, window: Stretch, acceleration: Array) -> Array:
        """(n, samples), A"""
        currents = np.empty((n, window.position.size))
        for first in range(0, window.position.size, _CHUNK):
            part = slice(first, min(first + _CHUNK, window.position.size))
            given = window.position, window.speed, acceleration, window.load, window.since_s
            position, speed, faster, load, since_s = (one[part] for one in given)
            result = needed_currents(self.stack, rows, (position, speed, faster, load, since_s), window.still)
            currents[:, part] = result.transpose(0, 2, 1).reshape(len(rows) * LANES, -1)[:n]
        return currents


def _by_block(values: Array, window: Stretch) -> Array:
    """Means (n, blocks) of values (n, samples), of the blocks in motion."""
    size = window.samples_per_block
    whole = values.shape[1] // size
    return values[:, : whole * size].reshape(len(values), whole, size).mean(axis=2)[:, window.moving]


def _of_loop(actuator: Actuator) -> Array:
    """Current per acceleration that a current loop lets its command rise above the current by, A s²/rad."""
    motor = actuator.motor
    return _each(actuator.sensors.apparent_inertia * motor.inertia_kgm2 / motor.torque_constant_Nm_A)


def _each(value: ArrayLike) -> Array:
    """One number, or one for each individual, as a column."""
    return np.atleast_1d(np.asarray(value, dtype=float))[:, None]
