"""BAM's friction models M1 … M6 of a position servo with an arm, fitted as their authors fit them: peers of discovery.

Equations, bounds, time step and objective are those of Rhoban/bam at commit af22604 (bam/model.py, simulate.py, fit.py,
xl330/actuator.py; Apache-2.0) and of Duclusaud, Passault, Padois, Ly, *Extended Friction Models for the Physics
Simulation of Servo Actuators*, ICRA 2025, programmed anew.  The objective is the mean absolute position error of a
simulation from the goal alone, over steps and logs; it is searched by CMA-ES.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.physics.jit import recursion
from ema_model.recordings import Measurement

Array = NDArray[np.float64]

STEP_S = 5e-3  # to which logs are interpolated, and by which the model steps (bam/process.py)
GRAVITY_M_S2 = 9.80665
_GONE = 40.0  # exp(−40) is nothing
_FASTEST_RAD_S = 100.0  # at which BAM's simulation cuts the speed off

# Bounds of every parameter, in the order of the kernel; those that a model lacks are zero.
BOUNDS: dict[str, tuple[float, float]] = {
    "torque_constant_Nm_A": (0.3, 3.0),
    "resistance_Ohm": (0.5, 5.0),
    "armature_kgm2": (1e-4, 0.05),
    "offset_rad": (-0.1, 0.1),
    "coulomb_Nm": (0.0, 0.2),  # K_c
    "viscous_Nms_rad": (0.0, 1.0),  # K_v
    "stribeck_Nm": (0.0, 0.2),  # K_cs
    "stribeck_speed_rad_s": (0.01, 3.0),
    "stribeck_exponent": (0.5, 3.0),
    "load": (0.0, 0.5),  # K_l
    "load_stribeck": (0.0, 1.0),  # K_ls
    "load_motor": (0.0, 0.5),  # K_m
    "load_external": (0.0, 0.5),  # K_e
    "load_motor_stribeck": (0.0, 1.0),  # K_ms
    "load_external_stribeck": (0.0, 1.0),  # K_es
    "load_motor_quadratic_1_Nm": (0.0, 0.01),  # K_mq
    "load_external_quadratic_1_Nm": (0.0, 0.01),  # K_eq
}
_PLACE = {name: place for place, name in enumerate(BOUNDS)}
_BASE = tuple(BOUNDS)[:6]
_STRIBECK = ("stribeck_Nm", "stribeck_speed_rad_s", "stribeck_exponent")
_DIRECTIONAL = ("load_motor", "load_external", "load_motor_stribeck", "load_external_stribeck")
_QUADRATIC = ("load_motor_quadratic_1_Nm", "load_external_quadratic_1_Nm")
MODELS: dict[str, tuple[str, ...]] = {  # the parameters of each
    "m1": _BASE,
    "m2": (*_BASE, *_STRIBECK),
    "m3": (*_BASE, "load"),
    "m4": (*_BASE, *_STRIBECK, "load", "load_stribeck"),
    "m5": (*_BASE, *_STRIBECK, *_DIRECTIONAL),
    "m6": (*_BASE, *_STRIBECK, *_DIRECTIONAL, *_QUADRATIC),
}


@dataclass(frozen=True)
class Bench:
    """The arm and the supply, which BAM takes as known."""

    mass_kg: float = 0.49
    length_m: float = 0.1
    supply_V: float = 7.4


@dataclass(frozen=True, eq=False)
class Logs:
    """Recordings on BAM's grid, one after another."""

    goal_rad: Array  # (steps,)
    measured_rad: Array  # (steps,)
    enabled: Array  # (steps,), 0 or 1
    ends: NDArray[np.int64]  # (logs,), where each log ends
    gain_1_rad: Array  # (logs,), duty per position error
    speed_rad_s: Array  # (logs,), at the start

    @classmethod
    def of(cls, recordings: Sequence[Measurement], actuator: Actuator) -> Logs:
        """The logs, with the gain that the actuator's file has for each."""
        parts, gains, speeds = [], [], []
        for one in recordings:
            time = one.time_s
            grid = np.arange(0.0, time[-1], STEP_S)
            logged = np.clip(grid, time[0], None)  # what comes before the first sample is it
            on = one.signals.get("drive_enabled", np.ones(one.samples))
            rows = (one["command_rad"], one["user_position_rad"], on)
            parts.append([np.interp(logged, time, row) for row in rows])
            gains.append(float(actuator.for_recording(one.name).controller.gain_1_rad))
            speeds.append(float(one["motor_speed_rad_s"][0]) if "motor_speed_rad_s" in one else 0.0)
        goal, measured, on = (np.concatenate(rows) for rows in zip(*parts))
        ends = np.cumsum([part[0].size for part in parts])
        return cls(goal, measured, (on > 0.5).astype(float), ends, np.array(gains), np.array(speeds))

    def errors_rad(self, parameters: Mapping[str, float], bench: Bench) -> Array:
        """The mean absolute error of each log, (logs,)."""
        row = np.zeros(len(BOUNDS))
        for name, value in parameters.items():
            row[_PLACE[name]] = value
        shown = self.simulated(row, bench)
        return np.array([float(np.mean(one)) for one in np.split(np.abs(shown - self.measured_rad), self.ends[:-1])])

    def simulated(self, row: Array, bench: Bench) -> Array:
        """The positions from each log's first one on, (steps,)."""
        arm = np.array(
            [bench.mass_kg * bench.length_m**2, bench.mass_kg * GRAVITY_M_S2 * bench.length_m, bench.supply_V]
        )
        return _simulated(
            row, arm, self.goal_rad, self.measured_rad, self.enabled, self.ends, self.gain_1_rad, self.speed_rad_s
        )


@recursion
def _simulated(row, arm, goal, measured, enabled, ends, gains, speeds):
    """J q̈ = τ_m + τ_e − clip(τ_stop, ± τ_f), by Euler's steps; τ_stop would halt the motor within one."""
    k, resistance, armature, offset, coulomb, viscous = row[0], row[1], row[2], row[3], row[4], row[5]
    stribeck, slow, exponent = row[6], row[7], row[8]
    load, load_stribeck = row[9], row[10]
    motor, external, motor_stribeck, external_stribeck, motor_quadratic, external_quadratic = row[11:17]
    inertia, moment, supply = arm[0] + armature, arm[1], arm[2]
    slides = slow * _GONE ** (1.0 / exponent) if slow > 0.0 else 0.0  # from there on no Stribeck friction is left
    shown = np.empty(goal.size)
    first = 0
    for log in range(ends.size):
        q, dq = measured[first], speeds[log]
        for i in range(first, ends[log]):
            shown[i] = q
            duty = min(1.0, max(-1.0, (goal[i] - q) * gains[log]))
            driving = k / resistance * (supply * duty - k * dq) * enabled[i]
            pulling = -moment * np.sin(q + offset)
            friction = coulomb + load * abs(pulling - driving) + abs(pulling * external - driving * motor)
            if abs(dq) < slides:
                more = stribeck + load_stribeck * abs(pulling - driving)
                more += abs(pulling * external_stribeck - driving * motor_stribeck)
                if np.sign(pulling) != np.sign(driving):
                    if abs(pulling) < abs(driving):
                        more += external_quadratic * pulling**2
                    elif abs(pulling) > abs(driving):
                        more += motor_quadratic * driving**2
                friction += more * (np.exp(-(abs(dq / slow) ** exponent)) if dq != 0.0 else 1.0)
            net = driving + pulling
            halting = inertia / STEP_S * dq + net
            net -= np.sign(halting) * min(abs(halting), friction + viscous * abs(dq))
            faster = net / inertia
            dq = min(_FASTEST_RAD_S, max(-_FASTEST_RAD_S, dq + faster * STEP_S))
            q += dq * STEP_S + 0.5 * faster * STEP_S**2
        first = ends[log]
    return shown


@dataclass(frozen=True)
class Fitted:
    """A model of BAM's as fitted."""

    parameters: dict[str, float]
    error_rad: float  # the objective


def fit(name: str, logs: Logs, bench: Bench, seed: int, *, starts: int = 3, evaluations: int = 8000) -> Fitted:
    """The best of so many searches of so many evaluations each, every one with twice the population of the last."""
    names = MODELS[name]
    low, high = np.array([BOUNDS[one] for one in names]).T

    def objective(unit: Array) -> float:
        error = float(np.mean(logs.errors_rad(dict(zip(names, low + unit * (high - low))), bench)))
        return error if np.isfinite(error) else np.inf

    random = np.random.default_rng(seed)
    found = [minimised(objective, len(names), random, evaluations, 2 ** (start + 1)) for start in range(starts)]
    error, unit = min(found, key=lambda one: one[0])
    values = low + unit * (high - low)
    return Fitted({one: float(value) for one, value in zip(names, values)}, error)


# --- CMA-ES (Hansen, The CMA Evolution Strategy: A Tutorial, arXiv 1604.00772), in the unit cube ----------------------

_FIRST_SIGMA = 0.25
_LEAST_SIGMA = 1e-9
_LEAST_RANGE = 1e-6  # of the best objectives of the last generations, below which nothing more is found
_OUTSIDE = 10.0  # times the squared distance from the cube, that is added to a point's objective


def minimised(
    objective: Callable[[Array], float], dimensions: int, random: np.random.Generator, evaluations: int, times: int = 1
) -> tuple[float, Array]:
    """The least objective found in [0, 1]^dimensions, and where; points outside count as the nearest inside, and more.

    times: how much larger the population is than the usual one; larger ones see farther.
    """
    population = times * (4 + int(3.0 * np.log(dimensions)))
    parents = population // 2
    weights = np.log(parents + 0.5) - np.log(np.arange(1, parents + 1))
    weights /= weights.sum()
    mass = 1.0 / float(np.sum(weights**2))
    n = dimensions
    c_sigma, c_path = (mass + 2.0) / (n + mass + 5.0), (4.0 + mass / n) / (n + 4.0 + 2.0 * mass / n)
    damping = 1.0 + 2.0 * max(0.0, np.sqrt((mass - 1.0) / (n + 1.0)) - 1.0) + c_sigma
    c_one = 2.0 / ((n + 1.3) ** 2 + mass)
    c_rank = min(1.0 - c_one, 2.0 * (mass - 2.0 + 1.0 / mass) / ((n + 2.0) ** 2 + mass))
    usual = np.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n**2))  # length of a normal vector
    mean, sigma, covariance = random.uniform(0.2, 0.8, n), _FIRST_SIGMA, np.eye(n)
    path_sigma, path = np.zeros(n), np.zeros(n)
    best, best_at = np.inf, np.clip(mean, 0.0, 1.0)
    lately: list[float] = []  # the best of each generation
    looked_back = 10 + int(30.0 * n / population)
    for generation in range(1, evaluations // population + 1):
        values, axes = np.linalg.eigh(covariance)
        lengths = np.sqrt(np.maximum(values, 1e-20))
        steps = (random.standard_normal((population, n)) * lengths) @ axes.T
        points = mean + sigma * steps
        inside = np.clip(points, 0.0, 1.0)
        objectives = np.array([objective(point) for point in inside])
        if objectives.min() < best:
            best, best_at = float(objectives.min()), inside[int(np.argmin(objectives))]
        order = np.argsort(objectives * (1.0 + _OUTSIDE * np.sum((points - inside) ** 2, axis=1)))[:parents]
        step = weights @ steps[order]
        mean = mean + sigma * step
        path_sigma = (1.0 - c_sigma) * path_sigma + np.sqrt(c_sigma * (2.0 - c_sigma) * mass) * (
            axes @ ((axes.T @ step) / lengths)
        )
        length = float(np.linalg.norm(path_sigma))
        is_short = length / np.sqrt(1.0 - (1.0 - c_sigma) ** (2 * generation)) < (1.4 + 2.0 / (n + 1.0)) * usual
        path = (1.0 - c_path) * path + is_short * np.sqrt(c_path * (2.0 - c_path) * mass) * step
        ranked = (steps[order].T * weights) @ steps[order]
        kept = 1.0 - c_one - c_rank + (1.0 - is_short) * c_one * c_path * (2.0 - c_path)
        covariance = kept * covariance + c_one * np.outer(path, path) + c_rank * ranked
        sigma *= float(np.exp(min(1.0, (c_sigma / damping) * (length / usual - 1.0))))
        lately = [*lately, float(objectives.min())][-looked_back:]
        if sigma * lengths.max() < _LEAST_SIGMA:
            break
        if len(lately) == looked_back and max(lately) - min(lately) < _LEAST_RANGE:
            break
    return best, best_at
