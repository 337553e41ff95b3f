"""Whether a closed loop can be simulated at all: two models that hardly differ must behave alike.

A limit cycle of backlash, or a motor that sticks now here, now there, makes them drift apart; a comparison in time
means nothing then, and what the motor needed (inverse dynamics) is compared instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ema_model.actuator import Actuator
from ema_model.estimation.floor import CORRELATED_S
from ema_model.estimation.model_fit import Data, Fit
from ema_model.recordings import Measurement

Array = NDArray[np.float64]

_APART = 5e-4  # of the inertia
_IN_PROPORTION = 2.0 * _APART  # of a signal: what any loop's may change by
_LOST = 0.5  # of the blocks, from which on a recording cannot be compared in time


def with_divergence(data: Data, found: Fit) -> tuple[Data, float]:
    """The data with what such neighbours differ by in the model's floor, and the share of blocks that are lost.

    A block is lost where the neighbours' currents (or positions) differ by more than the noise, and by more than in
    proportion: a recording without noise would show any change.
    """
    plant = found.plant
    if not plant.simulates_commands:
        return data, 0.0
    fitted = found.calibration.actuator
    inertia = fitted.value("motor.inertia_kgm2")
    neighbour = fitted.varied({"motor.inertia_kgm2": inertia * np.array([1.0, 1.0 + _APART])})
    k = np.tile(found.calibration.k, (2, 1))
    floors, lost = [], []
    for i, (window, one) in enumerate(zip(plant.windows, data.floors)):
        shown = plant.signals(i, neighbour, k, *found.calibration.start_of(i))
        width = max(3, round(CORRELATED_S / window.block_s) | 1)
        apart = {
            name: np.sqrt(np.maximum(uniform_filter1d((shown[name][1] - shown[name][0]) ** 2, width), 0.0))
            for name in one.model
        }
        floors.append(one.beside(replace(one, model=apart)))
        name = next(iter(data.fitted(apart)), None)
        if name is not None:
            size = float(np.sqrt(np.mean(window.measured[name] ** 2)))
            lost.append(apart[name] > max(one.noise[name], _IN_PROPORTION * size))
    return replace(data, floors=floors), float(np.mean(np.concatenate(lost)) if lost else 0.0)


def is_lost(share: float) -> bool:
    """Whether too little is left to compare in time."""
    return share > _LOST


def by_inverse_dynamics(measurements: Sequence[Measurement], actuator: Actuator) -> Actuator | None:
    """The actuator without its controller, where the recordings tell what the motor needed; None where they do not."""
    if all("motor_position_rad" in one and ("current_A" in one or "motor_torque_Nm" in one) for one in measurements):
        return actuator.without_controller()
    return None
