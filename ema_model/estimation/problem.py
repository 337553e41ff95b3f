"""The least-squares problem of a calibration: unknowns in their own σ, residuals over their floor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.naming import on_axes
from ema_model.actuator.parameters import low_limit
from ema_model.effects import find
from ema_model.errors import InputError
from ema_model.estimation.floor import Floor
from ema_model.faults import NAMES, named
from ema_model.models import Plant

Array = NDArray[np.float64]

BOUND = 3.0  # σ
_STEP = 0.1  # σ, of the differences: beyond the roughness that stick and slip give
_STEP_OF_K = 0.03  # of a k's: it spans far more
_K_SIGMA = 0.29  # a k may be anywhere in [0, 1]
_TURNED_SIGMA_RAD = 2e-3  # how well an encoder tells where the motor starts


@dataclass(frozen=True)
class Unknown:
    """One number that the calibration moves: nominal + σ·x, low ≤ x ≤ high."""

    name: str
    nominal: float
    sigma: float
    low: float = -BOUND
    high: float = BOUND


class Problem:
    """Residuals and Jacobian of a plant for chosen unknowns.

    The residual holds every compared signal of every window over its floor, and x itself (the prior).
    Derivatives are differences, one lane each, so that a Jacobian is one call of the kernel per window.
    """

    def __init__(
        self, plant: Plant, floors: Sequence[Floor], free: Sequence[str], k: ArrayLike, signals: Mapping[str, float]
    ) -> None:
        self.plant = plant
        self.k = np.asarray(k, dtype=float)
        self.signals = [[name for name in signals if name in window.measured] for window in plant.windows]
        self.weights = [
            {name: signals[name] / one.fit_sigma(name) for name in names} for one, names in zip(floors, self.signals)
        ]
        self.unknowns = [*(unknown_of(plant.actuator, name) for name in free), *_starts(plant)]
        self.values = sum(window.blocks * len(names) for window, names in zip(plant.windows, self.signals))
        if not self.values:
            raise InputError(f"none of the recordings has a signal of {', '.join(signals)}")

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest x."""
        return np.array([u.low for u in self.unknowns]), np.array([u.high for u in self.unknowns])

    def simulate(self, x: Array) -> list[dict[str, Array]]:
        """Signals of a population of unknowns x (n, unknowns), per window: (n, blocks) each."""
        k, actuator, starts = self._apply(np.atleast_2d(x))
        signals: Any = self.plant.signals  # each plant knows its own windows
        return [
            signals(window, actuator, k, starts.get(f"turned {i}", 0.0), starts.get(f"play {i}", 0.0))
            for i, window in enumerate(self.plant.windows)
        ]

    def residual(self, x: Array) -> Array:
        """(values + unknowns,)"""
        return self._residuals(x[None, :])[0]

    def costs(self, x: Array) -> Array:
        """Half the squared residual of each of a population x (n, unknowns): (n,)."""
        return 0.5 * np.sum(self._residuals(x) ** 2, axis=1)

    def jacobian(self, x: Array) -> Array:
        """∂residual/∂x, (values + unknowns, unknowns), by central differences in one population."""
        return self.linearised(x)[1]

    def linearised(self, x: Array) -> tuple[Array, Array]:
        """Residual and Jacobian in one population: together they cost little more than the residual alone."""
        n = len(x)
        points = np.repeat(x[None, :], 2 * n + 1, axis=0)
        least, greatest = self.bounds
        step = np.array([_STEP_OF_K if unknown.name in NAMES else _STEP for unknown in self.unknowns])
        low, high = np.clip(x - step, least, greatest), np.clip(x + step, least, greatest)
        points[np.arange(n), np.arange(n)] = low
        points[n + np.arange(n), np.arange(n)] = high
        residuals = self._residuals(points)
        return residuals[2 * n], ((residuals[n : 2 * n] - residuals[:n]) / (high - low)[:, None]).T

    def split(self, jacobian: Array, *, weighted: bool = False) -> list[dict[str, Array]]:
        """A Jacobian per window and signal, in the signals' own units unless weighted: (blocks, unknowns) each."""
        parts, row = [], 0
        for window, weights in zip(self.plant.windows, self.weights):
            part = {}
            for name, weight in weights.items():
                rows = jacobian[row : row + window.blocks]
                part[name] = rows if weighted else rows / weight[:, None]
                row += window.blocks
            parts.append(part)
        return parts

    def actuator(self, x: Array) -> tuple[Actuator, Array]:
        """The actuator and k (8,) at one x."""
        k, _, _ = self._apply(x[None, :])
        values = {u.name: float(u.nominal + u.sigma * v) for u, v in zip(self.unknowns, x) if "." in u.name}
        return replace(self.plant.actuator.varied(values), faults=named(k[0])), k[0]

    def _residuals(self, x: Array) -> Array:
        parts = [
            (simulated[name] - window.measured[name]) * weights[name]
            for window, weights, simulated in zip(self.plant.windows, self.weights, self.simulate(x))
            for name in weights
        ]
        residuals = np.concatenate([*parts, x], axis=1)
        # A run that diverges is a very bad one, but a number.
        return np.nan_to_num(residuals, nan=1e6, posinf=1e6, neginf=-1e6)

    def _apply(self, x: Array) -> tuple[Array, Actuator, dict[str, Array]]:
        k = np.repeat(self.k[None, :], len(x), axis=0)
        varied: dict[str, Array] = {}
        starts: dict[str, Array] = {}
        for column, unknown in enumerate(self.unknowns):
            values = unknown.nominal + unknown.sigma * x[:, column]
            if unknown.name in NAMES:
                k[:, NAMES.index(unknown.name)] = values
            elif "." in unknown.name:
                varied[unknown.name] = values
            else:
                starts[unknown.name] = values
        return k, self.plant.actuator.varied(varied), starts


def unknown_of(actuator: Actuator, name: str) -> Unknown:
    """The unknown for "section.parameter", "effects.name.parameter" or k1…k8.

    Raises InputError for one without a tolerance, since nothing says how far it may go.
    """
    if name in NAMES:
        nominal = float(actuator.k[NAMES.index(name)])
        return Unknown(name, nominal, _K_SIGMA, -nominal / _K_SIGMA, (1.0 - nominal) / _K_SIGMA)
    if name not in actuator.tolerances:
        known = ", ".join(on_axes(path, actuator.axes).path for path in actuator.tolerances)
        raise InputError(f"{name} cannot be calibrated: the actuator's file gives it no tolerance; free may be {known}")
    nominal, sigma = actuator.value(name), actuator.tolerances[name].sigma
    low, high = low_limit(name), math.inf
    if name.startswith("effects."):
        _, effect, parameter = name.split(".")
        low, high = next((p.low, p.high) for p in find(effect, actuator.axes).parameters if p.name == parameter)
    # Zero itself is no inertia.
    low = low + 1e-3 * abs(nominal) if low == 0.0 else low
    return Unknown(name, nominal, sigma, max(-BOUND, (low - nominal) / sigma), min(BOUND, (high - nominal) / sigma))


def _starts(plant: Plant) -> list[Unknown]:
    """Where each window began: beyond what its first sample says."""
    if not plant.starts:
        return []
    transmission = plant.actuator.transmission
    play = 0.5 * transmission.backlash_rad / transmission.gear_ratio
    return [
        unknown
        for i in range(len(plant.windows))
        for unknown in (Unknown(f"turned {i}", 0.0, _TURNED_SIGMA_RAD), Unknown(f"play {i}", 0.0, play))
        if unknown.sigma > 0.0
    ]
