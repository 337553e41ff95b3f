"""Discovery beside the field's own methods, on the same recordings and held to one measure, in its own numbers."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.campaign.task import NUMBER, NUMBERS, TEXT, TEXTS, Kind, TaskInputs
from ema_model.comparison.free_simulation import in_open_loop
from ema_model.discovery import discover
from ema_model.errors import InputError, quoted
from ema_model.models import ClosedLoop, InverseDynamics
from ema_model.models.measured_motion import Stretch
from ema_model.physics.jit import recursion
from ema_model.recordings import Measurement, prepared

Array = NDArray[np.float64]
Errors = tuple[list[float], list[float]]  # by recording: fitted, held out

# --- the measures, each of any method's model -------------------------------------------------------------------------
# following: the position that the recorded command makes of the model, mean absolute error of each log, mrad
# simulation: the position that the recorded current or force makes of it in open loop, rms, mm or mrad; nothing of what
#     was held out is used but its first state
# torque: the current or torque that the recorded motion needs, rms of the error in % of the measured rms

MEASURES = {"following": "mrad", "simulation": "mm", "torque": "%"}
_MILLI = 1e3


def followed(recordings: Sequence[Measurement], actuator: Actuator) -> list[float]:
    """Mean absolute error of the user's position in each recording, mrad: from its first sample on, by its command."""
    model = ClosedLoop([prepared(one, actuator) for one in recordings], actuator)
    errors: list[list[Array]] = [[] for _ in recordings]
    for place, window in enumerate(model.windows):
        shown = model.signals(place)["user_position_rad"][0]
        errors[window.recording].append(np.abs(shown - window.measured["user_position_rad"]))
    return [_MILLI * float(np.mean(np.concatenate(one))) for one in errors]


def simulated(inputs: TaskInputs, actuator: Actuator) -> tuple[Errors, float]:
    """The rms error of the motor's position in open loop, mrad or mm; held-out ones with the fitted ones' offset.

    And of these with the constant offset of what is put in that suits them best, which a test must not know.
    """
    fitted, held = ([prepared(one, actuator) for one in every] for every in _both(inputs))
    found = in_open_loop(fitted, held, actuator)["motor_position_rad"]
    unseen = found.at_fitted_offset
    if unseen is None or found.fitted.reason or unseen.reason:
        raise FloatingPointError(found.fitted.reason or (unseen.reason if unseen else "nothing is held out"))
    own = math.nan if found.holdout is None else found.holdout.rmse
    return ([_MILLI * found.fitted.rmse], [_MILLI * unseen.rmse]), _MILLI * own


def needed(recordings: Sequence[Measurement], actuator: Actuator) -> list[float]:
    """Of each recording the rms error of the current or torque that its motion needs, in % of the measured rms."""
    model = InverseDynamics([prepared(one, actuator) for one in recordings], actuator)
    shown = [model.signals(place) for place in range(len(model.windows))]
    return _shares(model, [{name: values[0] for name, values in one.items()} for one in shown])


def _shares(model: InverseDynamics, shown: Sequence[Mapping[str, Array]]) -> list[float]:
    found = []
    for recording in range(len(model.recorded)):
        own = [(w, s) for w, s in zip(model.windows, shown) if w.recording == recording]
        (name,) = own[0][0].measured
        measured = np.concatenate([window.measured[name] for window, _ in own])
        error = np.concatenate([window.measured[name] - one[name] for window, one in own])
        found.append(100.0 * float(np.sqrt(np.mean(error**2) / np.mean(measured**2))))
    return found


# --- the usual regression of a joint: least squares with inertia, friction and gravity --------------------------------


def columns_of(window: Stretch, linear: bool) -> dict[str, Array]:
    """What the measured torque or current is a sum of, (blocks,) each, through the same filter as it.

    Inertia, viscous and Coulomb friction, an offset; where the axis turns, gravity as sin and cos of its angle.
    Gautier, *Dynamic identification of robots with power model*, ICRA 1997; Janot's scripts of EMPS have no gravity.
    """
    motion, size = window.motion, window.samples_per_block
    raw = {"viscous": window.speed, "coulomb": np.sign(window.speed), "offset": np.ones_like(window.speed)}
    if not linear:
        raw |= {"sin": np.sin(window.position), "cos": np.cos(window.position)}
    signals = {"inertia": motion.acceleration, **{name: motion.filtered(values) for name, values in raw.items()}}
    blocks = motion.acceleration.size // size
    return {
        name: values[: blocks * size].reshape(blocks, size).mean(axis=1)[window.moving]
        for name, values in signals.items()
    }


def regressed(inputs: TaskInputs) -> tuple[dict[str, float], Errors]:
    """Coefficients, and the errors in % of the measured rms."""
    actuator, linear = inputs.actuator, inputs.actuator.axes.motor == "linear"
    models = [InverseDynamics([prepared(one, actuator) for one in every], actuator) for every in _both(inputs)]
    columns = [[columns_of(window, linear) for window in model.windows] for model in models]
    names = list(columns[0][0])
    matrix = np.concatenate([np.column_stack([one[name] for name in names]) for one in columns[0]])
    target = np.concatenate([next(iter(window.measured.values())) for window in models[0].windows])
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    scale[scale == 0.0] = 1.0
    coefficients = np.linalg.lstsq(matrix / scale, target, rcond=1e-10)[0] / scale
    errors = []
    for model, every in zip(models, columns):
        shown = [
            {next(iter(window.measured)): np.column_stack([one[name] for name in names]) @ coefficients}
            for window, one in zip(model.windows, every)
        ]
        errors.append(_shares(model, shown))
    return dict(zip(names, coefficients.tolist())), (errors[0], errors[1])


def _as_actuator(actuator: Actuator, found: Mapping[str, float], in_torque: bool) -> Actuator:
    """The actuator with what a regression found, in open loop: what an offset is, is put in."""
    constant = 1.0 if in_torque else actuator.motor.torque_constant_Nm_A
    dry = constant * max(0.0, found["coulomb"])
    offset = {} if in_torque else {"sensors.current_bias_A": found["offset"]}
    return actuator.varied(
        {
            **offset,
            "motor.inertia_kgm2": constant * found["inertia"],
            "motor.viscous_friction_Nms_rad": constant * found["viscous"],
            "motor.dynamic_friction_Nm": dry,
            "motor.static_friction_Nm": dry,
        }
    )


def regressed_servo(inputs: TaskInputs) -> tuple[dict[str, float], Errors]:
    """The same of a position servo of which goal and position alone are known: its position error is what drives it.

    Coefficients per rad of that error; the errors are of a simulation from the goal, mrad.
    """
    actuator = replace(inputs.actuator.without_controller(), leaves_out_reversals=False)
    fitted, held = ([_driven_by_its_error(prepared(one, inputs.actuator)) for one in every] for every in _both(inputs))
    found, _ = regressed(TaskInputs(actuator, fitted, held))
    if not found["inertia"] > 0.0:
        raise FloatingPointError("the regression finds no inertia, so that nothing can be simulated")
    row = np.array([found[name] for name in ("inertia", "viscous", "coulomb", "sin", "cos", "offset")])
    errors = []
    for every in _both(inputs):
        errors.append([])
        for one in every:
            goal, position, time = one["command_rad"], one["user_position_rad"], one.time_s
            shown = [_servo(row, goal[run], position[run], time[run]) for run in one.runs]
            measured = np.concatenate([position[run] for run in one.runs])
            errors[-1].append(_MILLI * float(np.mean(np.abs(np.concatenate(shown) - measured))))
    return found, (errors[0], errors[1])


def _both(inputs: TaskInputs) -> tuple[list[Measurement], list[Measurement]]:
    return inputs.fitted, inputs.held


def _driven_by_its_error(one: Measurement) -> Measurement:
    """Its position error in the current's place."""
    signals = {name: one[name] for name in ("time_s", "segment") if name in one}
    position = one["user_position_rad"]
    driven = {"motor_position_rad": position, "current_A": one["command_rad"] - position}
    return replace(Measurement({**signals, **driven}), name=one.name)


@recursion
def _servo(row, goal, measured, time):
    """The position from the first sample on, at rest; the goal holds until the next sample."""
    inertia, viscous, coulomb, sine, cosine, offset = row
    shown = np.empty(goal.size)
    q, dq = measured[0], 0.0
    for i in range(goal.size):
        shown[i] = q
        if i + 1 == goal.size:
            break
        step = (time[i + 1] - time[i]) / _SERVO_STEPS
        for _ in range(_SERVO_STEPS):
            net = goal[i] - q - viscous * dq - sine * np.sin(q) - cosine * np.cos(q) - offset
            halting = inertia / step * dq + net
            net -= np.sign(halting) * min(abs(halting), max(0.0, coulomb))
            dq += net / inertia * step
            q += dq * step
    return shown


_SERVO_STEPS = 40  # of the simulation in a sample


# --- BAM's friction models M1 … M6 of a position servo with an arm, fitted as their authors fit them ------------------
# Equations, bounds, time step and objective are those of Rhoban/bam at commit af22604 (bam/model.py, simulate.py,
# fit.py, xl330/actuator.py; Apache-2.0) and of Duclusaud, Passault, Padois, Ly, *Extended Friction Models for the
# Physics Simulation of Servo Actuators*, ICRA 2025, programmed anew. The objective is the mean absolute position error
# of a simulation from the goal alone, over steps and logs; it is searched by CMA-ES.

STEP_S = 5e-3  # to which logs are interpolated, and by which the model steps (bam/process.py)
GRAVITY_M_S2 = 9.80665
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
        errors = np.split(np.abs(shown - self.measured_rad), self.ends[:-1])
        return np.array([float(np.mean(one)) for one in errors], dtype=np.float64)

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
            if slow > 0.0:
                more = stribeck + load_stribeck * abs(pulling - driving)
                more += abs(pulling * external_stribeck - driving * motor_stribeck)
                if np.sign(pulling) != np.sign(driving):
                    if abs(pulling) < abs(driving):
                        more += external_quadratic * pulling**2
                    elif abs(pulling) > abs(driving):
                        more += motor_quadratic * driving**2
                friction += more * np.exp(-(abs(dq / slow) ** exponent))
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
        if sigma * lengths.max() < _LEAST_SIGMA:
            break
    return best, best_at


# --- one task: a method on recordings ---------------------------------------------------------------------------------

_OURS, _REGRESSION = "discover", "least_squares"
METHODS = (_OURS, *(f"bam_{name}" for name in MODELS), _REGRESSION)


@dataclass(frozen=True)
class Settings:
    """The method and what it is held to; the rest is BAM's, which knows its arm and its supply."""

    method: str = _OURS
    measure: str = "following"
    mass_kg: float = 0.49
    length_m: float = 0.1
    supply_V: float = 7.4
    starts: int = 3
    evaluations: int = 8000

    def __post_init__(self) -> None:
        for name, known in (("method", METHODS), ("measure", MEASURES)):
            if getattr(self, name) not in known:
                raise InputError(f"no {name} {quoted(getattr(self, name))!r}; there are {', '.join(known)}")
        if self.method.startswith("bam_") and self.measure != "following":
            raise InputError('BAM\'s models follow a command: measure is "following"')


def _run(inputs: TaskInputs, settings: Settings, seed: int) -> dict[str, Any]:
    if not inputs.held:
        raise InputError("a benchmark needs recordings that are held out")
    began, own_offset = time.perf_counter(), None
    if settings.method == _OURS:
        answer, model = _discovered(inputs, settings)
        answer["answer_s"] = time.perf_counter() - began
        if settings.measure == "following":
            errors = followed(inputs.fitted, model), followed(inputs.held, model)
        elif settings.measure == "torque":
            errors = needed(inputs.fitted, model), needed(inputs.held, model)
        else:
            errors, own_offset = simulated(inputs, model)
    elif settings.method == _REGRESSION:
        found, errors = (regressed_servo if settings.measure == "following" else regressed)(inputs)
        answer = {"parameters": json.dumps(found), "answer_s": time.perf_counter() - began}
        if settings.measure == "simulation":
            in_torque = "current_A" not in inputs.fitted[0]
            errors, own_offset = simulated(inputs, _as_actuator(inputs.actuator, found, in_torque))
    else:
        bench = Bench(settings.mass_kg, settings.length_m, settings.supply_V)
        fitted, held = (
            Logs.of([prepared(one, inputs.actuator) for one in every], inputs.actuator) for every in _both(inputs)
        )
        name = settings.method.removeprefix("bam_")
        found = fit(name, fitted, bench, seed, starts=settings.starts, evaluations=settings.evaluations)
        answer = {"parameters": json.dumps(found.parameters), "answer_s": time.perf_counter() - began}
        errors = tuple((_MILLI * logs.errors_rad(found.parameters, bench)).tolist() for logs in (fitted, held))
    fitted, held = errors
    return answer | {
        "method": settings.method,
        "measure": settings.measure,
        "unit": MEASURES[settings.measure],
        "fitted_error": float(np.mean(fitted)),
        "held_out_error": float(np.mean(held)),
        "held_out_errors": held,
        "own_offset_error": own_offset,
    }


def _discovered(inputs: TaskInputs, settings: Settings) -> tuple[dict[str, Any], Actuator]:
    """By `discover` alone, which never sees what is held out: given to it, that would weigh models as well."""
    found = discover(inputs.fitted, inputs.actuator)
    told = found.to_dict()
    parameters = {
        **{name: _short(one) for name, one in told["calibration"]["parameters"].items()},
        **{f"{one['name']}.{name}": _short(p) for one in told["effects"] for name, p in one["parameters"].items()},
    }
    answer = {
        "verdict": told["verdict"],
        "effects": [one["name"] for one in told["effects"]],
        "parameters": json.dumps(parameters),
    }
    return answer, found.actuator


def _short(one: Mapping[str, Any]) -> list[Any]:
    """Value, interval, unit."""
    return [one["value"], *(one["interval90"] or (None, None)), one["unit"]]


# --- what rows say together -------------------------------------------------------------------------------------------


def chosen(rows: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Of a group: ours; of the others the one that its training error chooses, and the best in hindsight."""
    found = {row["method"]: row for row in rows}
    ours = found.pop(_OURS, None)
    others = list(found.values())
    told: dict[str, Mapping[str, Any]] = {} if ours is None else {"ours": ours}
    if others:
        told["by training error"] = min(others, key=lambda row: row["fitted_error"])
        told["in hindsight"] = min(others, key=lambda row: row["held_out_error"])
    return told


def behind_first(groups: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, float]:
    """Of each group our held-out error over that of the method which its training error chooses, the largest first."""
    picked = {group: chosen(rows) for group, rows in groups.items()}
    both = {group: one for group, one in picked.items() if {"ours", "by training error"} <= one.keys()}
    ratios = {
        group: one["ours"]["held_out_error"] / one["by training error"]["held_out_error"] for group, one in both.items()
    }
    return dict(sorted(ratios.items(), key=lambda one: -one[1]))


def means(groups: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, float]:
    """The mean held-out error over groups of each method, of the one that is chosen in each, and of the best in each.

    Nothing where groups are held to different measures, or a method is not in all of them.
    """
    if len({row["measure"] for rows in groups.values() for row in rows}) != 1:
        return {}
    tables = [{row["method"]: row["held_out_error"] for row in rows} for rows in groups.values()]
    shared = [name for name in tables[0] if all(name in one for one in tables)]
    found = {name: float(np.mean([one[name] for one in tables])) for name in shared}
    picked = [chosen(rows) for rows in groups.values()]
    for name in ("by training error", "in hindsight"):
        if all(name in one for one in picked):
            found[name] = float(np.mean([one[name]["held_out_error"] for one in picked]))
    return found


def _told(rows: list[dict[str, Any]]) -> dict[str, Any]:
    if len(rows) == 1:
        (row,) = rows
        named = ", ".join(row["effects"] or []) or ("–" if row["verdict"] is None else row["verdict"])
        numbers = {"fitted": row["fitted_error"], "held out": row["held_out_error"]}
        if row["own_offset_error"] is not None:
            numbers["at its own offset"] = row["own_offset_error"]
        return {**{name: f"{value:.3g} {row['unit']}" for name, value in numbers.items()}, "names": named}
    picked = chosen(rows) if len({row["method"] for row in rows}) == len(rows) else {}
    return {
        f"held out: {name}": f"{row['held_out_error']:.3g} {row['unit']} ({row['method']})"
        for name, row in picked.items()
    }


BENCHMARK = Kind(
    title="Benchmark",
    settings=Settings,
    columns=pa.schema(
        [
            ("method", TEXT),
            ("measure", TEXT),
            ("unit", TEXT),  # of the errors; mrad in place of mm where the axis turns
            ("fitted_error", NUMBER),  # mean over recordings
            ("held_out_error", NUMBER),
            ("held_out_errors", NUMBERS),  # by recording
            ("own_offset_error", NUMBER),  # of a simulation in open loop, with the held-out recordings' own offset
            ("verdict", TEXT),  # of discovery, as what follows
            ("effects", TEXTS),
            ("parameters", TEXT),  # of the model as JSON: the number, or value, 90 % interval and unit
        ]
    ),
    run=_run,
    seconds=lambda settings: (
        60.0 if settings.method == _OURS else 1.0 + 1.5e-3 * settings.starts * settings.evaluations
    ),
    told=_told,
)
