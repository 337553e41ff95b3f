"""What an identification may move: k1…k8, and whatever else about the rig is not exactly known.

The eccentricity is moved as the vector k6·(cos φ, sin φ), φ = 2π(k7 − ½): its angle k7 has no ends, and none where
k6 = 0, so that a fit neither stops at k7 = 0 or 1 nor is caught by a k7 that was wrong while k6 was small.
Everything else is counted in σ of what is known about it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.estimation.floor import Floor
from ema_model.estimation.problem import unknown_of
from ema_model.models import ClosedLoop

Array = NDArray[np.float64]

FAULTS = 8  # numbers of x that are faults: k1…k5, eccentricity along 0 and along π/2, k8
ECCENTRICITY = (5, 6)
GAIN = 7
LOAD = "constant_load"  # the effect through which a load that was not recorded acts
_MOST = 3.0  # σ
_TURNED_RAD = 2e-3  # how well a rig's encoder tells where the motor starts
_UNRECORDED_LOAD = 0.05  # 1 σ of a load that was not recorded, of the motor's greatest torque


@dataclass(frozen=True)
class Nuisance:
    """One number beside k: nominal + σ·x, low ≤ x ≤ high; σ is also its prior."""

    name: str  # "section.parameter", "load 0", "turned 0", "play 0"
    nominal: float
    sigma: float
    low: float = -_MOST
    high: float = _MOST

    @property
    def is_base(self) -> bool:
        """Whether it is a parameter of the actuator's file, and none of an effect, a start or a load."""
        return "." in self.name and not self.name.startswith("effects.")


def to_x(k: ArrayLike) -> Array:
    """k (…, 8) → the faults' part of x (…, 8)."""
    k = np.asarray(k, dtype=float)
    phase = 2.0 * np.pi * (k[..., 6] - 0.5)
    x = k.copy()
    x[..., 5], x[..., 6] = k[..., 5] * np.cos(phase), k[..., 5] * np.sin(phase)
    return x


def to_k(x: ArrayLike) -> Array:
    """The inverse: x (…, 8 or more) → k (…, 8), k7 in [0, 1); a centred rotor has k7 = ½."""
    x = np.asarray(x, dtype=float)
    k = np.clip(x[..., :FAULTS], 0.0, 1.0)
    a, b = x[..., 5], x[..., 6]
    k[..., 5] = np.clip(np.hypot(a, b), 0.0, 1.0)
    k[..., 6] = np.mod(np.arctan2(b, a) / (2.0 * np.pi) + 0.5, 1.0)
    return k


def fault_bounds() -> tuple[Array, Array]:
    """Least and greatest of the faults' part of x; the eccentricity's disc lies in its square."""
    low, high = np.zeros(FAULTS), np.ones(FAULTS)
    low[list(ECCENTRICITY)] = -1.0
    return low, high


def nuisances(plant: ClosedLoop, floors: list[Floor], *, parameters_known: bool) -> list[Nuisance]:
    """What is not exactly known: the effects' parameters, the starts and, unless they are known, base and loads."""
    actuator = plant.actuator
    paths = [p for p in actuator.tolerances if p.startswith("effects.") or not parameters_known]
    found = [_of_actuator(actuator, path) for path in paths]
    if LOAD in plant.effects:
        motor, transmission = actuator.motor, actuator.transmission
        sigma = _UNRECORDED_LOAD * motor.torque_limit_Nm / transmission.gear_ratio
        found += [
            Nuisance(f"load {i}", 0.0, sigma, -1.0 / _UNRECORDED_LOAD, 1.0 / _UNRECORDED_LOAD)
            for i, measurement in enumerate(plant.measurements)
            if "load_torque_Nm" not in measurement
        ]
    return found + _starts(plant, floors, parameters_known)


def _of_actuator(actuator: Actuator, path: str) -> Nuisance:
    one = unknown_of(actuator, path)
    return Nuisance(path, one.nominal, one.sigma, one.low, one.high)


def _starts(plant: ClosedLoop, floors: list[Floor], parameters_known: bool) -> list[Nuisance]:
    """Where the motor and the play were at each window's first sample, beyond what it says."""
    tau = plant.actuator.transmission.gear_ratio
    half_play = 0.5 * plant.actuator.transmission.backlash_rad / tau
    found = []
    for i, (window, floor) in enumerate(zip(plant.windows, floors)):
        samples = np.sqrt(window.samples_per_block)
        motor = floor.noise.get("motor_position_rad", half_play) * samples
        user = floor.noise.get("user_position_rad", tau * 50.0 * half_play) * samples / tau
        rig = 0.0 if parameters_known else _TURNED_RAD
        turned, play = np.hypot(motor, rig), np.hypot(np.hypot(motor, user), 0.0 if parameters_known else half_play)
        if turned > 1e-6:
            found.append(Nuisance(f"turned {i}", 0.0, float(turned)))
        if play > 1e-6:
            found.append(Nuisance(f"play {i}", 0.0, float(play)))
    return found
