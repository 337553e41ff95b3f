"""How far the Monitor Model is from recordings: the fitness that the optimisers minimise (T 5.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.effects import find
from ema_model.errors import InputError
from ema_model.kernel_rows import initial_state, monitor_rows
from ema_model.measurement import Measurement
from ema_model.physics.rows import LANES
from ema_model.simulation import Run, simulate_reference, steps_per_sample
from ema_model.stacks import exclusive, find_stack

Array = NDArray[np.float64]

FITNESSES = ("filtered", "raw")
FILTER_S = 0.5e-3
_DEFAULT_RATE_HZ = {"filtered": 10_000.0, "raw": 100_000.0}


COMPARED = ("current_A", "motor_speed_rad_s", "motor_position_rad", "user_position_rad")


@dataclass(frozen=True)
class Window:
    """One recording, ready for the kernels: a demand and a load per step, targets per compared block."""

    name: str
    command: Array  # (steps,), rad
    load: Array  # (steps,), N·m at the user
    target: Array  # (blocks,), A, means of the equivalent current, the sensor's gain and bias taken off
    measured: dict[str, Array]  # (blocks,) each, means of the signals of `COMPARED` as recorded
    samples_per_block: int
    steps_per_sample: int
    step_s: float
    user_rad: float
    speed_rad_s: float
    play_rad: float

    @property
    def steps_per_block(self) -> int:
        """Model steps between compared values."""
        return self.samples_per_block * self.steps_per_sample

    @property
    def block_s(self) -> float:
        """Time between compared values, s."""
        return self.steps_per_block * self.step_s


class Objective:
    """Root-mean-square error of I_3eq, A, for a population of k, over one recording or several.

    `filtered` compares means over 0.5 ms, which removes the chopping ripple that no low-fidelity model
    can follow; `raw` compares every sample, as the thesis does.
    """

    def __init__(
        self,
        measurements: Sequence[Measurement],
        actuator: Actuator,
        *,
        effects: Mapping[str, Mapping[str, float]] | None = None,
        circuit: str = "reduced",
        fitness: str = "filtered",
    ) -> None:
        if fitness not in FITNESSES:
            raise InputError(f"no fitness {fitness!r}; fitnesses are {', '.join(FITNESSES)}")
        if not measurements:
            raise InputError("one recording or more is needed")
        self.actuator = actuator
        self.fitness = fitness
        self.effects = {name: find(name).settings(dict(given)) for name, given in (effects or {}).items()}
        self.stack = find_stack(circuit, self.effects)
        self.windows = [_window(m, actuator, fitness) for m in measurements]
        self.blocks = sum(len(window.target) for window in self.windows)
        self._groups = [_Group(windows) for windows in _alike(self.windows)]

    def __call__(self, k: ArrayLike) -> Array:
        """RMSE, A, of each individual: k (n, 8) → (n,); infinite where the model diverges."""
        k = np.atleast_2d(np.asarray(k, dtype=float))
        rows = monitor_rows(self.actuator, k, self.stack, self.effects)
        total = np.zeros(len(rows) * LANES)
        for group in self._groups:
            states = np.stack([self._state(window, len(rows)) for window in group.windows])
            result = np.empty((len(group.windows), len(rows), LANES))
            exclusive(
                self.stack.monitor.squared_errors,
                states,
                rows,
                group.command,
                group.load,
                group.first_step,
                group.target,
                np.ones_like(group.target),
                group.first_block,
                group.steps_per_block,
                group.step_s,
                result,
            )
            total += result.sum(axis=0).ravel()
        rmse = np.sqrt(total[: len(k)] / self.blocks)
        # comparisons take a NaN for "not larger": a lane can come back to finite numbers, but is no answer
        sound = np.isfinite(rmse) & np.isfinite(k).all(axis=1)
        return np.where(sound, rmse, np.inf)

    def currents(self, k: ArrayLike, actuator: Actuator | None = None) -> Array:
        """What `__call__` compares with `target`, A: k (n, 8) → (n, blocks), the recordings one after another.

        The parameters of `actuator` may be arrays (n,), one value for each individual.
        """
        k = np.atleast_2d(np.asarray(k, dtype=float))
        rows = monitor_rows(actuator or self.actuator, k, self.stack, self.effects)
        parts = []
        for window in self.windows:
            result = np.empty((len(rows), len(window.target), 4, LANES))
            exclusive(
                self.stack.monitor.traces,
                self._state(window, len(rows)),
                rows,
                window.command,
                window.load,
                window.steps_per_block,
                1,
                window.step_s,
                result,
            )
            parts.append(result[:, :, 0, :].transpose(0, 2, 1).reshape(len(rows) * LANES, -1)[: len(k)])
        return np.concatenate(parts, axis=1)

    def signals(
        self,
        window: Window,
        k: ArrayLike,
        actuator: Actuator | None = None,
        turned_rad: ArrayLike = 0.0,
        play_rad: ArrayLike = 0.0,
    ) -> dict[str, Array]:
        """All of `COMPARED` for one recording, as its sensors would show them: k (n, 8) → (n, blocks) each.

        The parameters of `actuator`, turned_rad (the motor's angle at the start, rad, beyond the measured
        one) and play_rad (the same for its place in the play) may be arrays (n,).
        """
        k = np.atleast_2d(np.asarray(k, dtype=float))
        actuator = actuator or self.actuator
        rows = monitor_rows(actuator, k, self.stack, self.effects)
        tau = actuator.transmission.gear_ratio
        result = np.empty((len(rows), len(window.target), 4, LANES))
        start = initial_state(
            actuator,
            len(rows),
            window.user_rad + np.asarray(turned_rad) * tau,
            window.speed_rad_s,
            window.play_rad + np.asarray(play_rad),
        )
        exclusive(
            self.stack.monitor.traces,
            start,
            rows,
            window.command,
            window.load,
            window.steps_per_sample,
            window.samples_per_block,
            window.step_s,
            result,
        )
        lanes = result.transpose(2, 0, 3, 1).reshape(4, len(rows) * LANES, -1)[:, : len(k)]
        sensors = actuator.sensors
        current = _each(sensors.current_gain) * lanes[0] + _each(sensors.current_bias_A)
        shown = {
            "current_A": current,
            "motor_speed_rad_s": lanes[1],
            "motor_position_rad": lanes[2],
            "user_position_rad": _each(tau) * lanes[3],
        }
        late = _each(sensors.delay_s) - self.actuator.sensors.delay_s  # beyond what the window's command has
        if not np.any(late):
            return shown
        return {name: y - late * np.gradient(y, window.block_s, axis=1) for name, y in shown.items()}

    @property
    def target(self) -> Array:
        """The recordings' compared values, A, (blocks,), one recording after another."""
        return np.concatenate([window.target for window in self.windows])

    def _state(self, window: Window, blocks: int) -> Array:
        return initial_state(self.actuator, blocks, window.user_rad, window.speed_rad_s, window.play_rad)


def simulated(
    run: Run, actuator: Actuator, k: ArrayLike, fitness: str = "filtered", effects: Mapping | None = None
) -> Measurement:
    """A recording of the Reference Model for identification, sampled at the fitness's own rate (10 or 100 kHz)."""
    if fitness not in FITNESSES:
        raise InputError(f"no fitness {fitness!r}; fitnesses are {', '.join(FITNESSES)}")
    run = Run(run.command, run.duration_s, _DEFAULT_RATE_HZ[fitness], run.load_torque_Nm)
    return simulate_reference(run, actuator, k, effects)


def _window(measurement: Measurement, actuator: Actuator, fitness: str) -> Window:
    measurement.require("command_rad", "current_A")
    if not measurement.is_uniform:
        measurement = measurement.resampled(measurement.sample_period_s)
    period = measurement.sample_period_s
    samples = max(1, round(FILTER_S / period)) if fitness == "filtered" else 1
    blocks = (measurement.samples - 1) // samples
    if blocks < 10:
        raise InputError(f"{measurement.name}: {measurement.duration_s:g} s are too short to compare; 5 ms are needed")
    steps = steps_per_sample(period)
    step_s = period / steps
    count = blocks * samples * steps
    time = measurement.time_s - measurement.time_s[0]
    at = np.arange(count) * step_s - actuator.sensors.delay_s
    measured = {
        name: measurement[name][1 : blocks * samples + 1].reshape(blocks, samples).mean(axis=1)
        for name in COMPARED
        if name in measurement
    }
    load = measurement.get("load_torque_Nm")
    user, speed, play = _start(measurement, actuator)
    return Window(
        name=measurement.name,
        command=np.interp(at, time, measurement["command_rad"]),
        load=np.zeros(count) if load is None else np.interp(at, time, load),
        target=(measured["current_A"] - actuator.sensors.current_bias_A) / actuator.sensors.current_gain,
        measured=measured,
        samples_per_block=samples,
        steps_per_sample=steps,
        step_s=step_s,
        user_rad=user,
        speed_rad_s=speed,
        play_rad=play,
    )


def _each(value: ArrayLike) -> Array:
    """One number, or one for each individual, as a column."""
    return np.atleast_1d(np.asarray(value, dtype=float))[:, None]


def _start(measurement: Measurement, actuator: Actuator) -> tuple[float, float, float]:
    """Where the actuator stands at the first sample: motor angle as a user's, motor speed, place in the play."""
    tau = actuator.transmission.gear_ratio
    user = measurement.get("user_position_rad")
    motor = measurement.get("motor_position_rad")
    speed = measurement.get("motor_speed_rad_s")
    at_user = float(measurement["command_rad"][0] if user is None else user[0])
    if motor is None:
        return at_user, 0.0 if speed is None else float(speed[0]), 0.0
    play = 0.0 if user is None else at_user / tau - float(motor[0])
    return float(motor[0]) * tau, 0.0 if speed is None else float(speed[0]), play


def _alike(windows: Sequence[Window]) -> list[list[Window]]:
    """Windows grouped by their sampling, so that one kernel call serves each group."""
    groups: dict[tuple[int, float], list[Window]] = {}
    for window in windows:
        groups.setdefault((window.steps_per_block, round(window.step_s, 12)), []).append(window)
    return list(groups.values())


class _Group:
    """Windows of one sampling, laid one after another."""

    def __init__(self, windows: list[Window]) -> None:
        self.windows = windows
        self.steps_per_block = windows[0].steps_per_block
        self.step_s = windows[0].step_s
        self.command = np.concatenate([window.command for window in windows])
        self.load = np.concatenate([window.load for window in windows])
        self.target = np.concatenate([window.target for window in windows])
        self.first_step = np.cumsum([0] + [len(window.command) for window in windows[:-1]])
        self.first_block = np.cumsum([0] + [len(window.target) for window in windows])
