"""What one more effect with given settings would change in a fitted model, before any refit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from ema_model.actuator import Actuator
from ema_model.estimation.model_fit import Data, Fit
from ema_model.models import Model

Array = NDArray[np.float64]

_LEAST = 1e-9  # σ, so that a parameter at its bound has some room


@dataclass(frozen=True, eq=False)
class Preview:
    """A fitted model with room for one effect; the first change with it is compiled."""

    data: Data
    found: Fit
    name: str
    plant: Model
    jacobian: Array  # ∂residual/∂x, (values, unknowns), above the prior's, (unknowns, unknowns)
    basis: Array  # its Q, (values + unknowns, unknowns)
    triangle: Array  # and R

    def change(self, settings: Mapping[str, float]) -> Array:
        """What the effect would take from measured − model, over the floor: (values,); NaN where it has no value.

        The calibrated parameters follow, as far as a straight line tells: some may have stood in for it.
        """
        calibration = self.found.calibration
        model = _with(calibration.actuator, self.name, settings)
        after = [
            self.plant.signals(i, model, calibration.k, *calibration.start_of(i))
            for i in range(len(self.plant.windows))
        ]
        whole = self.data.over_floor(self.plant, after)[0] - self.data.over_floor(self.found.plant, calibration.signals)
        return whole + self._followed(whole) if np.all(np.isfinite(whole)) else whole

    def _followed(self, change: Array) -> Array:
        """What the parameters change in turn, within their bounds and their prior: (values,)."""
        calibration = self.found.calibration
        wanted = -self.basis.T @ np.concatenate([calibration.residual + change, calibration.x])
        low, high = calibration.room
        room = np.minimum(low, -_LEAST), np.maximum(high, _LEAST)
        moved = lsq_linear(self.triangle, wanted, room, method="bvls").x
        return self.jacobian[: len(change)] @ moved


def preview(data: Data, found: Fit, name: str, settings: Mapping[str, float]) -> Preview:
    """Makes room for an effect beside those of a fit; its settings may change afterwards."""
    calibration = found.calibration
    jacobian = np.concatenate([calibration.weighted_jacobian, np.eye(len(calibration.x))])
    basis, triangle = np.linalg.qr(jacobian)
    plant = data.plant(_with(calibration.actuator, name, settings))
    return Preview(data, found, name, plant, jacobian, basis, triangle)


def _with(actuator: Actuator, name: str, settings: Mapping[str, float]) -> Actuator:
    return replace(actuator, effects={**actuator.effects, name: dict(settings)})
