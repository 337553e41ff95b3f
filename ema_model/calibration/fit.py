"""Fits the actuator's parameters to recordings: least squares with the tolerances as a prior.

Unknowns are measured in their own σ: x = (value − file's value)/σ, bounded to ±3.  The residual holds every
compared signal of every recording over its floor, and x itself (the prior).  Derivatives are differences,
one lane each, so that a Jacobian is one call of the population kernel per recording.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from ema_model.actuator import Actuator
from ema_model.calibration.floor import Floor
from ema_model.errors import InputError
from ema_model.faults import HEALTHY, NAMES
from ema_model.identification.objective import Objective

Array = NDArray[np.float64]

BOUND = 3.0  # σ
_STEP = 0.02  # σ, of the differences
_CORRELATED_S = 0.025  # one independent error of the sensors' accuracy per this time
_Z90 = 1.645
_K_SIGMA = 0.29
_LONGEST = 40  # evaluations of a start
_UNITS = (
    ("_Nms_rad", "N·m·s/rad"),
    ("_Nm_rad", "N·m/rad"),
    ("_Nm_A", "N·m/A"),
    ("_Nm", "N·m"),
    ("_kgm2", "kg·m²"),
    ("_rad_s", "rad/s"),
    ("_rad", "rad"),
    ("_1_s", "1/s"),
    ("_Ohm", "Ω"),
    ("_H", "H"),
    ("_V", "V"),
    ("_A", "A"),
    ("_s", "s"),
)


@dataclass(frozen=True)
class Unknown:
    """One number that the calibration moves."""

    name: str
    nominal: float
    sigma: float
    unit: str


@dataclass(frozen=True)
class Calibrated:
    """What it was found to be."""

    value: float
    interval90: tuple[float, float]
    unit: str
    z: float  # σ from the file's value
    at_bound: bool


@dataclass(frozen=True)
class Calibration:
    """The fit and what it leaves."""

    converged: bool
    parameters: dict[str, Calibrated]
    actuator: Actuator  # with the fitted values
    k: Array  # (8,)
    chi2_per_value: float  # of the signals over their floor; 1 is the floor
    signals: list[dict[str, Array]]  # the fitted model's, per recording, (blocks,) each
    before: list[dict[str, Array]]  # the file's own model's
    evaluations: int
    confounded: tuple[tuple[str, str], ...]  # pairs that trade against each other


class Problem:
    """Residuals and Jacobian of an objective for chosen unknowns."""

    def __init__(
        self, objective: Objective, floors: Sequence[Floor], free: Sequence[str], k: ArrayLike, signals: Sequence[str]
    ) -> None:
        self.objective = objective
        self.floors = floors
        self.k = np.asarray(k, dtype=float)
        self.signals = signals
        self.unknowns = [*(_unknown(objective.actuator, name) for name in free), *_starts(objective)]

    def simulate(self, x: Array) -> list[dict[str, Array]]:
        """Signals of a population of unknowns x (n, unknowns), per recording: (n, blocks) each."""
        k, actuator, starts = self._apply(np.atleast_2d(x))
        return [
            self.objective.signals(window, k, actuator, starts[f"turned {i}"], starts[f"play {i}"])
            for i, window in enumerate(self.objective.windows)
        ]

    def residual(self, x: Array) -> Array:
        """(values + unknowns,)"""
        return self._residuals(x[None, :])[0]

    def jacobian(self, x: Array) -> Array:
        """∂residual/∂x, (values + unknowns, unknowns), by central differences in one population."""
        n = len(x)
        points = np.repeat(x[None, :], 2 * n, axis=0)
        low, high = np.clip(x - _STEP, -BOUND, BOUND), np.clip(x + _STEP, -BOUND, BOUND)
        points[np.arange(n), np.arange(n)] = low
        points[n + np.arange(n), np.arange(n)] = high
        residuals = self._residuals(points)
        return ((residuals[n:] - residuals[:n]) / (high - low)[:, None]).T

    def actuator(self, x: Array) -> tuple[Actuator, Array]:
        """The actuator and k at one x."""
        k, _, _ = self._apply(x[None, :])
        named = {u.name: u.nominal + u.sigma * v for u, v in zip(self.unknowns, x, strict=True)}
        return self.objective.actuator.with_values({n: v for n, v in named.items() if "." in n}), k[0]

    def _residuals(self, x: Array) -> Array:
        parts = []
        for window, floor, simulated in zip(self.objective.windows, self.floors, self.simulate(x), strict=True):
            # blocks nearer than 25 ms share their sensors' error: each counts as its share of one
            share = np.sqrt(min(1.0, window.block_s / _CORRELATED_S))
            for name in self.signals:
                if name in window.measured:
                    sigma = np.hypot(floor.sigma(name), 0.0)
                    weight = np.where(floor.model[name] > floor.noise[name], share, 1.0) / sigma
                    parts.append((simulated[name] - window.measured[name]) * weight)
        parts.append(x)
        return np.concatenate(parts, axis=1)

    def _apply(self, x: Array) -> tuple[Array, Actuator, dict[str, Array]]:
        k = np.repeat(self.k[None, :], len(x), axis=0)
        varied: Any = self.objective.actuator
        starts: dict[str, Array] = {}
        for column, unknown in enumerate(self.unknowns):
            values = unknown.nominal + unknown.sigma * x[:, column]
            if unknown.name in NAMES:
                k[:, NAMES.index(unknown.name)] = np.clip(values, 0.0, 1.0)
            elif "." in unknown.name:
                section, name = unknown.name.split(".")
                varied = replace(varied, **{section: replace(getattr(varied, section), **{name: values})})
            else:
                starts[unknown.name] = values
        return k, varied, starts


def calibrate(
    objective: Objective,
    floors: Sequence[Floor],
    *,
    free: Sequence[str] | None = None,
    k: ArrayLike = HEALTHY,
    signals: Sequence[str] = ("current_A", "motor_position_rad", "user_position_rad"),
    on_progress: Callable[[int], None] | None = None,
) -> Calibration:
    """Fits the free parameters ("section.name", or k1…k8), and each recording's start, to the recordings.

    free: what may move; without it, every parameter that the actuator's file leaves free.
    Two starts; the better is kept, and the fit has converged when it ended before its limit and both agree.
    Raises InputError for a parameter that does not exist or has no tolerance.
    """
    chosen = default_free(objective.actuator) if free is None else tuple(free)
    problem = Problem(objective, floors, chosen, k, signals)
    count = len(problem.unknowns)
    evaluations = 0

    def residual(x: Array) -> Array:
        nonlocal evaluations
        evaluations += 1
        if on_progress is not None:
            on_progress(evaluations)
        return problem.residual(x)

    random = np.random.default_rng(0)
    fits = []
    for start in (np.zeros(count), np.clip(0.7 * random.standard_normal(count), -2.0, 2.0)):
        fits.append(
            least_squares(
                residual,
                start,
                jac=problem.jacobian,  # pyright: ignore[reportArgumentType]
                bounds=(-BOUND, BOUND),
                max_nfev=_LONGEST,
                xtol=1e-6,
                ftol=1e-8,
                tr_solver="lsmr",  # the default's singular values of the long Jacobian cost more than all simulations
            )
        )
    best = min(fits, key=lambda fit: fit.cost)
    agree = max(fit.cost for fit in fits) < best.cost * 1.02 + 2.0
    x = best.x
    covariance = np.linalg.inv(best.jac.T @ best.jac)
    values = len(best.fun) - count
    chi2 = 2.0 * best.cost - float(x @ x)
    covariance *= max(1.0, chi2 / max(values - count, 1))
    actuator, fitted_k = problem.actuator(x)
    after, before = problem.simulate(x), problem.simulate(np.zeros(count))
    return Calibration(
        converged=bool(best.status > 0 and agree),
        parameters={u.name: _calibrated(u, x[i], np.sqrt(covariance[i, i])) for i, u in enumerate(problem.unknowns)},
        actuator=actuator,
        k=fitted_k,
        chi2_per_value=chi2 / values,
        signals=[{name: values[0] for name, values in one.items()} for one in after],
        before=[{name: values[0] for name, values in one.items()} for one in before],
        evaluations=evaluations,
        confounded=_confounded(problem.unknowns, covariance),
    )


def default_free(actuator: Actuator) -> tuple[str, ...]:
    """What the actuator's file leaves free to calibrate."""
    return tuple(path for path, tolerance in actuator.tolerances.items() if tolerance.free)


def _unknown(actuator: Actuator, name: str) -> Unknown:
    if name in NAMES:
        return Unknown(name, float(HEALTHY[NAMES.index(name)]), _K_SIGMA, "")
    if name not in actuator.tolerances:
        raise InputError(f"{name} cannot be calibrated: the actuator's file gives it no tolerance")
    return Unknown(name, actuator.value(name), actuator.tolerances[name].sigma, unit_of(name))


def _starts(objective: Objective) -> list[Unknown]:
    """Where each recording began: beyond what its first sample says."""
    play = 0.5 * objective.actuator.transmission.backlash_rad / objective.actuator.transmission.gear_ratio
    return [
        unknown
        for i in range(len(objective.windows))
        for unknown in (Unknown(f"turned {i}", 0.0, 2e-3, "rad"), Unknown(f"play {i}", 0.0, play, "rad"))
    ]


def _calibrated(unknown: Unknown, x: float, sigma: float) -> Calibrated:
    value = unknown.nominal + unknown.sigma * x
    half = _Z90 * unknown.sigma * float(sigma)
    return Calibrated(value, (value - half, value + half), unknown.unit, float(x), bool(abs(x) > BOUND - 0.01))


def _confounded(unknowns: Sequence[Unknown], covariance: Array) -> tuple[tuple[str, str], ...]:
    scale = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance / np.outer(scale, scale))
    pairs = [(i, j) for i in range(len(unknowns)) for j in range(i) if correlation[i, j] > 0.95]
    return tuple((unknowns[j].name, unknowns[i].name) for i, j in pairs)


def unit_of(path: str) -> str:
    """The unit that a parameter's name ends with, as it is written."""
    name = path.split(".")[-1]
    return next((shown for ending, shown in _UNITS if name.endswith(ending)), "")
