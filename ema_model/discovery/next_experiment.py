"""The next experiment: of the commands that the actuator can follow, the one that tells two rivals apart best.

One rival's model plays the actuator, the other's is fitted to it: the χ² that is left, with all parameters free as
far as the recordings at hand allow, is what the experiment is expected to tell.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.commands import command
from ema_model.discovery.refit import Trial
from ema_model.discovery.result import Experiment
from ema_model.estimation.calibrate import problem_of
from ema_model.estimation.model_fit import Data, Fit
from ema_model.estimation.noise import Floor, floor
from ema_model.estimation.problem import SIGNALS, Problem
from ema_model.faults import NAMES
from ema_model.models import ClosedLoop, Model
from ema_model.simulation.plant import can_be_explored
from ema_model.simulation.run import Run, simulate_monitor

Array = NDArray[np.float64]

_TELLS = 25.0  # χ² from which on an experiment tells two models apart
_LOAD = 0.2  # of the stall torque
_TURNS = 2.0  # of the motor, so that what is periodic shows
_DURATION_S = (0.3, 3.0)
_SAMPLES = 10_000  # of a run, about


def next_experiment(data: Data, one: Trial, other: Trial) -> Experiment | None:
    """The allowed command and load, and if need be a further signal, that tell two rivals apart best.

    Both models may hold an effect of the file, one of them at its values.

    None where no allowed experiment does, or where the actuator cannot be simulated.
    """
    first, second, rivals = one.fit, other.fit, (one.candidate.name, other.candidate.name)
    if not (first.plant.simulates_commands and can_be_explored(first.calibration.actuator)):
        return None
    further = [name for name in SIGNALS[2:] if name not in data.signals or not _is_measured(first, name)]
    for signals in (dict(data.signals), {**data.signals, **dict.fromkeys(further, 1.0)}):
        found = []
        for name, settings, seconds in allowed(data, first):
            for load in (0.0, _load(first.calibration.actuator)):
                expected = expected_chi2(data, first, second, (name, settings, seconds, load), signals)
                found.append(Experiment(name, settings, seconds, load, None, rivals, expected))
        best = max(found, key=lambda one: one.expected_chi2)
        if best.expected_chi2 >= _TELLS:
            return best if signals == data.signals else replace(best, add_signal=", ".join(further))
        if not further:
            break
    return None


def allowed(data: Data, found: Fit) -> list[tuple[str, dict[str, float], float]]:
    """Commands within the range and speed of the recordings: name, settings, duration in s."""
    actuator = found.calibration.actuator
    spans = [float(np.ptp(window.command)) for window in found.plant.windows if window.command is not None]
    reach = 0.5 * max([*spans, 1e-9])
    turns = _TURNS * 2.0 * math.pi * actuator.transmission.gear_ratio
    speeds = [
        np.quantile(np.abs(np.gradient(signals["user_position_rad"], window.block_s)), 0.99)
        for window, signals in zip(found.plant.windows, found.calibration.signals)
        if "user_position_rad" in signals
    ]
    fastest = float(max([*speeds, 1e-9]))
    slow = fastest / (2.0 * math.pi)  # a sine of amplitude a and this over a reaches the fastest speed
    wide = max(reach, turns)
    planned = [
        ("step", {"final_rad": reach}, 0.0),
        ("step", {"final_rad": 0.1 * reach}, 0.0),
        ("sine", {"amplitude_rad": wide, "frequency_Hz": 0.7 * slow / wide}, 0.7 * slow / wide),
        ("sine", {"amplitude_rad": reach, "frequency_Hz": 0.15 * slow / reach}, 0.15 * slow / reach),
        ("sine", {"amplitude_rad": 0.1 * reach, "frequency_Hz": 5.0 * slow / reach}, 5.0 * slow / reach),
        ("staircase", {"step_rad": 0.2 * reach, "dwell_s": 0.05 / max(0.05, slow / reach)}, 0.2 * slow / reach),
        (
            "chirp",
            {
                "amplitude_rad": 0.1 * reach,
                "start_Hz": 0.5 * slow / reach,
                "end_Hz": 8.0 * slow / reach,
                "end_time_s": 1.0,
            },
            1.0,
        ),
    ]
    shortest, longest = _DURATION_S
    return [
        (
            name,
            {key: float(f"{value:.3g}") for key, value in settings.items()},
            float(f"{np.clip(2.0 / frequency if frequency else shortest, shortest, longest):.2g}"),
        )
        for name, settings, frequency in planned
    ]


def expected_chi2(
    data: Data,
    first: Fit,
    second: Fit,
    experiment: tuple[str, dict[str, float], float, float],
    signals: dict[str, float],
) -> float:
    """What is left when `second` is fitted to `first`'s model under a command, both over the recordings' noise."""
    name, settings, seconds, load = experiment
    rate = float(np.clip(_SAMPLES / seconds, 1000.0, 10_000.0))
    run = Run(command(name, settings), seconds, rate, load)
    try:
        recording = simulate_monitor(run, first.calibration.actuator, first.calibration.k)
        plants = [ClosedLoop([recording], rival.actuator) for rival in (first, second)]
        floors = [_floor(data, plants[0], place) for place in range(len(plants[0].windows))]
        played, problem = (
            problem_of(
                plant,
                floors,
                free=(*(path for path in rival.calibration.free if path not in NAMES), *_own_faults(rival, other)),
                k=rival.calibration.k,
                signals=signals,
            )
            for plant, rival, other in zip(plants, (first, second), (second, first))
        )
        # Both models go the same way from the command to the blocks, so that the rivals alone make the difference.
        [as_played] = played.residuals(_fitted(first, played)[None, :])
        [residual], [jacobian] = problem.jacobians(_fitted(second, problem)[None, :])
    except FloatingPointError:  # a command that this actuator does not stand
        return 0.0
    values = problem.values
    residual, jacobian = residual[:values] - as_played[:values], jacobian[:values]
    prior = _information(second, [unknown.name for unknown in problem.unknowns])
    moved = np.linalg.solve(jacobian.T @ jacobian + prior, -(jacobian.T @ residual))
    return float(np.sum((residual + jacobian @ moved) ** 2) + moved @ prior @ moved)


def _fitted(found: Fit, problem: Problem) -> Array:
    """A fit's parameters as the unknowns of another problem, whose runs start where they should."""
    known = {name: value for name, value in found.starts.items() if "." in name or name in NAMES}
    return np.array([known.get(unknown.name, 0.0) for unknown in problem.unknowns])


def _information(found: Fit, names: Sequence[str]) -> Array:
    """What the recordings say of these parameters, inverse covariance; starts of runs are only what they were."""
    columns = found.calibration.weighted_jacobian
    all_names = list(found.starts)
    covariance = np.linalg.inv(columns.T @ columns + np.eye(columns.shape[1]))
    known = [i for i, name in enumerate(names) if "." in name or name in NAMES]
    at = [all_names.index(names[i]) for i in known]
    information = np.eye(len(names))
    information[np.ix_(known, known)] = np.linalg.inv(covariance[np.ix_(at, at)])
    return information


def _own_faults(found: Fit, other: Fit) -> list[str]:
    """Faults that one of two models has and the other has not: they may move, as a rival effect's parameters do."""
    return [name for name in found.faults if name not in other.faults]


def _floor(data: Data, plant: Model, place: int) -> Floor:
    """The floor of a run to come: noise as recorded, the model's floor at least at its usual height."""
    window = plant.windows[place]
    noise, model = {}, {}
    for name in window.measured:
        known = [one for one in data.floors if name in one.noise]
        per_root_s = [one.noise[name] * math.sqrt(one.block_s) for one in known]
        # Not measured so far: a sensor as good as a thousandth of the motion.
        usual = float(np.median(per_root_s)) if known else 1e-3 * float(np.ptp(window.measured[name])) * 0.01
        noise[name] = {"noise": usual / math.sqrt(window.block_s / window.samples_per_block)}
        height = max((float(np.median(one.model[name])) for one in known), default=0.0)
        model[name] = np.full(window.blocks, height)
    found = floor(plant, place, stated=noise)
    return found.beside(replace(found, model=model))


def _is_measured(found: Fit, name: str) -> bool:
    return all(name in window.measured for window in found.plant.windows)


def _load(actuator: Actuator) -> float:
    """A load at the user that the motor can well hold, N·m."""
    motor, inverter = actuator.motor, actuator.inverter
    current = min(inverter.current_limit_A, actuator.controller.current_limit_A)
    if inverter.kind == "voltage":
        current = min(current, inverter.bus_voltage_V / motor.resistance_Ohm)
    torque = min(motor.torque_limit_Nm, motor.torque_constant_Nm_A * current)
    return float(f"{_LOAD * torque / actuator.transmission.gear_ratio:.2g}") if torque < 1e6 else 0.0
