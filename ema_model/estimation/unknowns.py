"""What a fit may move: parameters of the actuator and of effects, faults, starts, loads that were not recorded.

Each is counted in σ of what is known about it beforehand, its prior.  The eccentricity is moved as the vector
k6·(cos φ, sin φ), φ = 2π(k7 − ½), whose parts stand in the places of k6 and k7: its angle has no ends, and none
where k6 = 0, so that a fit neither stops at k7 = 0 or 1 nor is caught by a k7 that was wrong while k6 was small.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.naming import on_axes
from ema_model.actuator.parameters import low_limit
from ema_model.effects import find
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.estimation.floor import POSITIONS, SPEED, Floor
from ema_model.faults import NAMES
from ema_model.models import Model, Window
from ema_model.models.closed_loop import LOAD

Array = NDArray[np.float64]

BOUND = 3.0  # σ
# 1 σ of each k, and of each part of the eccentricity, about the actuator's own.  A k may be anywhere in [0, 1], so the
# prior is wide: what recordings do not tell is as the file says rather than anything, what they tell outweighs it.
K_SIGMA = 0.5
ECCENTRICITY = (5, 6)  # places of its parts among the faults
_STEP = 0.1  # σ, of the differences: beyond the roughness that stick and slip give
_STEP_OF_K = 0.01  # of a k's, which spans far more
_TURNED_RAD = 2e-3  # how well a rig's encoder tells where the motor starts
_WIDEST_PLAY = 50.0  # half plays, of a worn actuator
_LEAST_START_RAD = 1e-6
_UNRECORDED_LOAD = 0.05  # 1 σ of a load that was not recorded, of the motor's greatest torque


@dataclass(frozen=True)
class Unknown:
    """One number that a fit moves: nominal + σ·x, low ≤ x ≤ high; σ is its prior."""

    name: str  # "section.parameter", "effects.name.parameter", k1…k8; or kind and place: "turned 0", "lag 0"
    nominal: float
    sigma: float
    low: float = -BOUND
    high: float = BOUND
    kind: Literal["parameter", "fault", "turned", "play", "faster", "load", "lag"] = "parameter"
    place: int = 0  # of a fault: which; of a start: its window; of a load and of a lag: its recording
    step: float = _STEP  # of the difference that a derivative is taken by

    @property
    def is_base(self) -> bool:
        """Whether it is a parameter of the actuator's file, and none of an effect."""
        return self.kind == "parameter" and not self.name.startswith("effects.")

    @property
    def is_scale(self) -> bool:
        """Whether it is a positive quantity, which acts by its ratios: a resistance, an inertia, a gain."""
        return self.kind == "parameter" and self.nominal > 0.0 and self.nominal + self.sigma * self.low > 0.0


def to_vector(k: ArrayLike) -> Array:
    """k (…, 8) → the same with the eccentricity's vector in place of k6 and k7."""
    vector = np.array(k, dtype=float)
    phase = 2.0 * np.pi * (vector[..., 6] - 0.5)
    vector[..., 5], vector[..., 6] = vector[..., 5] * np.cos(phase), vector[..., 5] * np.sin(phase)
    return vector


def to_k(vector: ArrayLike) -> Array:
    """The inverse, (…, 8), inside its bounds, k7 in [0, 1); a centred rotor has k7 = ½."""
    vector = np.asarray(vector, dtype=float)
    k = np.clip(vector, 0.0, 1.0)
    a, b = vector[..., 5], vector[..., 6]
    k[..., 5] = np.clip(np.hypot(a, b), 0.0, 1.0)
    k[..., 6] = np.mod(np.arctan2(b, a) / (2.0 * np.pi) + 0.5, 1.0)
    return k


def polar(vector: Array, covariance: Array) -> tuple[float, float, float]:
    """σ along and across the eccentricity's vector (2,), with its covariance (2, 2), and its length."""
    length = float(np.hypot(*vector))
    if length < 1e-9:
        both = float(np.sqrt(np.trace(covariance) / 2.0))
        return both, both, length
    along = vector / length
    across = np.array([-along[1], along[0]])
    return float(np.sqrt(along @ covariance @ along)), float(np.sqrt(across @ covariance @ across)), length


def unknowns_of(actuator: Actuator, names: Iterable[str]) -> list[Unknown]:
    """The unknowns for "section.parameter", "effects.name.parameter" or k1…k8; k6 and k7 move together.

    Raises InputError for one without a tolerance, since nothing says how far it may go.
    """
    both = NAMES[ECCENTRICITY[0]], NAMES[ECCENTRICITY[1]]
    wanted = dict.fromkeys(one for name in names for one in (both if name in both else (name,)))
    return [_fault(actuator, NAMES.index(one)) if one in NAMES else _parameter(actuator, one) for one in wanted]


def _fault(actuator: Actuator, place: int) -> Unknown:
    nominal = float(to_vector(actuator.k)[place])
    least = -1.0 if place in ECCENTRICITY else 0.0
    low, high = (least - nominal) / K_SIGMA, (1.0 - nominal) / K_SIGMA
    return Unknown(NAMES[place], nominal, K_SIGMA, low, high, "fault", place, _STEP_OF_K)


def _parameter(actuator: Actuator, name: str) -> Unknown:
    if name not in actuator.tolerances:
        known = [on_axes(path, actuator.axes).path for path in actuator.tolerances]
        raise InputError(
            f"{quoted(name)} cannot be calibrated: the actuator's file gives it no tolerance; "
            f"free may be {', '.join(known)}{did_you_mean(name, [*NAMES, *known])}"
        )
    nominal, sigma = actuator.value(name), actuator.tolerances[name].sigma
    low, high = physical_limits(name, actuator)
    # Zero itself is no inertia.
    low = low + 1e-3 * abs(nominal) if low == 0.0 else low
    below, above = (_room(limit, nominal) / sigma for limit in (low, high))
    return Unknown(name, nominal, sigma, max(-BOUND, -below), min(BOUND, above))


def physical_limits(name: str, actuator: Actuator) -> tuple[float, float]:
    """Between which "section.parameter", "effects.name.parameter" or k1…k8 has a meaning, in its unit."""
    if name in NAMES:
        return (-math.inf, math.inf) if NAMES.index(name) in ECCENTRICITY else (0.0, 1.0)
    if name.startswith("effects."):
        _, effect, parameter = name.split(".")
        return next((p.low, p.high) for p in find(effect, actuator.axes).parameters if p.name == parameter)
    return (low_limit(name, actuator.controller.kind), math.inf) if "." in name else (-math.inf, math.inf)


def _room(limit: float, nominal: float) -> float:
    """How far a value may go from nominal to a limit, so that no rounding brings it beyond."""
    rounding = 4.0 * math.ulp(max(abs(limit), abs(nominal))) if math.isfinite(limit) else 0.0
    return max(0.0, abs(limit - nominal) - rounding)


def starts_of(model: Model, floors: Sequence[Floor], *, worn: bool, exact: bool = False) -> list[Unknown]:
    """Where the motor and the play were at each window's first sample, beyond what it says.

    Of a motor that a voltage is put in, its speed as well: such recordings begin anywhere in a motion, and no loop
    brings it back.

    worn: the play may be far wider than the file says.  exact: the recordings are a simulation's, whose sensors are
    known but for their noise.
    """
    if not model.simulates_commands:
        return []
    transmission = model.actuator.transmission
    tau = transmission.gear_ratio
    half_play = 0.5 * transmission.backlash_rad / tau
    widest = half_play * (_WIDEST_PLAY if worn else 1.0)
    found = []
    for i, (window, floor) in enumerate(zip(model.windows, floors)):
        samples = math.sqrt(window.samples_per_block)
        if model.actuator.takes_voltage:
            found.append(Unknown(f"faster {i}", 0.0, _speed_at_start(window, floor), kind="faster", place=i))
            if not any(name in window.measured for name in POSITIONS):
                continue
        motor = floor.noise.get("motor_position_rad", half_play) * samples
        user = floor.noise.get("user_position_rad", tau * widest) * samples / tau
        turned = math.hypot(motor, 0.0 if exact else _TURNED_RAD)
        play = math.hypot(motor, user, 0.0 if exact else half_play)
        found += [Unknown(f"turned {i}", 0.0, turned, kind="turned", place=i)] if turned > _LEAST_START_RAD else []
        found += [Unknown(f"play {i}", 0.0, play, kind="play", place=i)] if play > _LEAST_START_RAD else []
    return found


def _speed_at_start(window: Window, floor: Floor) -> float:
    """1 σ of the motor's speed at a window's start, rad/s, beyond the measured one or the measured position's slope."""
    if SPEED in floor.noise:
        return floor.noise[SPEED] * math.sqrt(window.samples_per_block)
    position = next(window.measured[name] for name in POSITIONS if name in window.measured)
    return float(np.max(np.abs(np.diff(position)))) / window.block_s


def loads_of(model: Model) -> list[Unknown]:
    """The load of each recording that has none, where it acts through the effect `LOAD` of the model."""
    if LOAD not in model.effects:
        return []
    motor, transmission = model.actuator.motor, model.actuator.transmission
    sigma = _UNRECORDED_LOAD * motor.torque_limit_Nm / transmission.gear_ratio
    most, usual = 1.0 / _UNRECORDED_LOAD, model.effects[LOAD]["torque_Nm"]
    return [
        Unknown(f"load {i}", usual, sigma, -most, most, "load", i)
        for i, measurement in enumerate(model.measurements)
        if "load_torque_Nm" not in measurement
    ]


def lags_of(model: Model) -> list[Unknown]:
    """By how long the current of each recording comes after its positions: a logger may well take it a sample apart.

    Without it, what the current leads or trails by is taken for friction and inertia that are off.
    """
    return [
        Unknown(f"lag {i}", 0.0, measurement.sample_period_s, kind="lag", place=i)
        for i, measurement in enumerate(model.measurements)
        if "current_A" in measurement and any(position in measurement for position in POSITIONS)
    ]
