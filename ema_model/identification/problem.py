"""The least-squares problem of an identification: residuals and derivatives of many candidates in one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.floor import Floor
from ema_model.faults import HEALTHY, NAMES
from ema_model.identification.unknowns import ECCENTRICITY, FAULTS, LOAD, Nuisance, fault_bounds, to_k, to_x
from ema_model.models import ClosedLoop

Array = NDArray[np.float64]

SIGNALS = ("current_A", "motor_position_rad", "user_position_rad")
_K_STEP = 5e-3  # of the differences: beyond the roughness that stick and slip give
_K_SIGMA = 0.5  # a k that the recordings do not tell is healthy rather than anything; what they tell outweighs it
_STEP = 0.1  # the same of what is counted in σ


@dataclass(frozen=True, eq=False)
class Weights:
    """A window's floor, and which signals' model error does not last from block to block while the motor moves."""

    floor: Floor
    white: frozenset[str] = frozenset()

    @property
    def noise(self) -> dict[str, float]:
        """White noise by signal, in its unit."""
        return self.floor.noise

    def sigma(self, name: str) -> Array:
        """What to weight a fit by, (blocks,): an error that lasts counts as often as it repeats."""
        if name not in self.white:
            return self.floor.fit_sigma(name)
        repeats = self.floor.repeats
        lasting = np.where(repeats > np.min(repeats), repeats, 1.0)
        return np.hypot(self.noise[name], np.sqrt(lasting) * self.floor.model[name])


class Problem:
    """x (…, 8 + nuisances) → residuals over their σ, then x over its prior's σ.

    `added` is what the model is known to lack, by window and signal, (blocks,).
    """

    def __init__(
        self,
        plant: ClosedLoop,
        weights: Sequence[Weights],
        nuisances: Sequence[Nuisance],
        added: Sequence[Mapping[str, Array]] = (),
    ) -> None:
        self.plant = plant
        self.nuisances = list(nuisances)
        self.count = FAULTS + len(self.nuisances)
        low, high = fault_bounds()
        self.low = np.concatenate([low, [n.low for n in self.nuisances]])
        self.high = np.concatenate([high, [n.high for n in self.nuisances]])
        self.names = [*NAMES[:5], "eccentricity", "eccentricity", NAMES[7], *(n.name for n in self.nuisances)]
        self.base = np.array([False] * FAULTS + [n.is_base for n in nuisances])
        self.prior = np.array([1.0 / _K_SIGMA] * FAULTS + [1.0] * len(self.nuisances))  # 1/σ of the prior
        self.middle = np.concatenate([to_x(HEALTHY), np.zeros(len(self.nuisances))])  # and where it stands
        self._step = np.array([_K_STEP] * FAULTS + [_STEP] * len(self.nuisances))
        self.reweighted(weights, added)

    def reweighted(self, weights: Sequence[Weights], added: Sequence[Mapping[str, Array]] = ()) -> None:
        """Sets other weights, and what is added to the model."""
        self.weights = list(weights)
        windows = self.plant.windows
        self.signals = [[name for name in SIGNALS if name in window.measured] for window in windows]
        self._inverse = [
            {name: 1.0 / one.sigma(name) for name in names} for one, names in zip(self.weights, self.signals)
        ]
        self.added = list(added)
        self.values = sum(window.blocks * len(names) for window, names in zip(windows, self.signals))

    def believe(self, spread: float) -> None:
        """Takes the base parameters to be within `spread` of their tolerances."""
        self.prior[self.base] = 1.0 / spread

    def residuals(self, x: Array) -> Array:
        """(n, unknowns) → (n, values + unknowns): model − measurement, and the prior."""
        parts = []
        for i, window in enumerate(self.plant.windows):
            simulated = self.simulate(i, x)
            for name in self.signals[i]:
                error = simulated[name] - window.measured[name]
                if self.added:
                    error += self.added[i][name]
                parts.append(error * self._inverse[i][name])
        # A run that diverges is a very bad one, but a number.
        return np.nan_to_num(
            np.concatenate([*parts, (x - self.middle) * self.prior], axis=1), nan=1e6, posinf=1e6, neginf=-1e6
        )

    def jacobians(self, x: Array) -> tuple[Array, Array]:
        """Residuals (n, m) and their derivatives (n, m, unknowns) by central differences, all in one population."""
        n, count = x.shape
        low, high = np.repeat(x[:, None, :], count, axis=1), np.repeat(x[:, None, :], count, axis=1)
        at = np.arange(count)
        low[:, at, at] = np.maximum(x - self._step, self.low)
        high[:, at, at] = np.minimum(x + self._step, self.high)
        points = np.concatenate([x[:, None, :], low, high], axis=1).reshape(-1, count)
        all_ = self.residuals(points).reshape(n, 2 * count + 1, -1)
        width = (high[:, at, at] - low[:, at, at])[:, :, None]
        slopes = (all_[:, 1 + count :] - all_[:, 1 : 1 + count]) / width
        return all_[:, 0], np.swapaxes(slopes, 1, 2)

    def parts(self) -> list[tuple[int, str, slice]]:
        """Where the residuals of each window's signals stand: window, signal, rows."""
        found, first = [], 0
        for i, (window, names) in enumerate(zip(self.plant.windows, self.signals)):
            for name in names:
                found.append((i, name, slice(first, first + window.blocks)))
                first += window.blocks
        return found

    def over_sigma(self, window: int, name: str, values: Array) -> Array:
        """Values (…, blocks) of a window's signal as residuals are: over σ."""
        return values * self._inverse[window][name]

    def clip(self, x: Array) -> Array:
        """x inside its bounds, the eccentricity inside its disc."""
        x = np.clip(x, self.low, self.high)
        a, b = ECCENTRICITY
        size = np.maximum(1.0, np.hypot(x[..., a], x[..., b]))
        x[..., a] /= size
        x[..., b] /= size
        return x

    def simulate(self, window: int, x: Array, **inputs: Array) -> dict[str, Array]:
        """Signals of one window (by its place) for x (n, unknowns): (n, blocks) each; inputs replace the window's."""
        one = self.plant.windows[window]
        varied, start, load = self._apply(x, window)
        effects: dict[str, Mapping[str, Any]] = dict(self.plant.effects)
        if LOAD in effects:
            effects[LOAD] = {"torque_Nm": load}
        return self.plant.signals(
            replace(one, **inputs) if inputs else one,
            self.plant.actuator.varied(varied),
            to_k(x),
            start["turned"],
            start["play"],
            effects,
        )

    def rig(self, x: Array, window: int) -> tuple[dict[str, float], dict[str, float], float]:
        """At one x (unknowns,): the actuator's values, where the window starts ("turned", "play"), its load, N·m."""
        varied, start, load = self._apply(x[None, :], window)
        return (
            {path: float(values[0]) for path, values in varied.items()},
            {name: float(values[0]) for name, values in start.items()},
            float(load[0]),
        )

    def _apply(self, x: Array, window: int) -> tuple[dict[str, Array], dict[str, Array], Array]:
        recording = self.plant.windows[window].recording
        varied: dict[str, Array] = {}
        start = {"turned": np.zeros(len(x)), "play": np.zeros(len(x))}
        load = np.zeros(len(x))
        for column, one in enumerate(self.nuisances, FAULTS):
            values = one.nominal + one.sigma * x[:, column]
            kind, _, place = one.name.partition(" ")
            if not place:
                varied[one.name] = values
            elif kind == "load":
                load = values if int(place) == recording else load
            elif int(place) == window:
                start[kind] = values
        return varied, start, load
