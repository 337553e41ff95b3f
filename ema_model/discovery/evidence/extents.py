"""How far a fitted model's recordings go: greatest values, the top speed, the travel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.model_fit import Fit

Array = NDArray[np.float64]
Ranges = Mapping[str, tuple[float, float]]  # by variable

_BACKWARD = 0.05  # of the top speed, that both directions must reach for motion to count as both ways


def greatest(found: Fit, signal: str) -> float:
    """The greatest size of a signal; 0 where it is not known."""
    shown = [signals[signal] for signals in found.calibration.signals if signal in signals]
    return float(max((np.max(np.abs(one)) for one in shown), default=0.0))


def travel(found: Fit) -> float:
    """What the motor turns, rad; infinite where it is not known."""
    shown = [signals["motor_position_rad"] for signals in found.calibration.signals if "motor_position_rad" in signals]
    return float(max((np.ptp(one) for one in shown), default=np.inf))


def top_speed(found: Fit) -> float:
    """The motor's top speed, rad/s; 0 where it is not known."""
    return float(max((np.max(np.abs(one)) for one in _speeds(found)), default=0.0))


def moves_both_ways(found: Fit) -> bool:
    """Whether the motor goes forward and backward; also where its speed is not known."""
    speeds = _speeds(found)
    if not speeds:
        return True
    fastest = top_speed(found)
    return all(max(float(np.max(side * one)) for one in speeds) > _BACKWARD * fastest for side in (1.0, -1.0))


def ranges_of(found: Fit) -> Ranges:
    """What the user's position goes through, and how fast the motor turns from standstill on, where it is known."""
    user, tau = [], found.actuator.transmission.gear_ratio
    top = top_speed(found)
    ranges = {"motor_speed": (0.0, top)} if top > 0.0 else {}
    for window, signals in zip(found.plant.windows, found.calibration.signals):
        motor = signals.get("motor_position_rad", window.context.get("motor_position_rad"))
        shown = signals.get("user_position_rad", None if motor is None else tau * motor)
        user += [] if shown is None else [np.min(shown), np.max(shown)]
    return ranges | ({"user_position": (float(min(user)), float(max(user)))} if user else {})


def _speeds(found: Fit) -> list[Array]:
    """The motor's speed in each window where it is known, (blocks,)."""
    windows = zip(found.plant.windows, found.calibration.signals)
    shown = [window.context.get("motor_speed_rad_s", signals.get("motor_speed_rad_s")) for window, signals in windows]
    return [one for one in shown if one is not None]
