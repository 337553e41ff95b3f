"""A residual that no effect of the library explains, made a torque over the variable that explains it best.

The curve starts as the residual itself, read as the torque that the model lacks; its knots are then free, so that a
fit finds them together with the parameters that had taken up a part of what was missing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, Tolerance
from ema_model.comparison.explain import HIGHEST_ORDER, Explanation, modulator_of, used_blocks
from ema_model.comparison.residuals import Residuals
from ema_model.comparison.verdict import ORDER_OF_PRIMARY
from ema_model.discovery.refit import Trial
from ema_model.discovery.remaining import residuals_left
from ema_model.discovery.result import Candidate
from ema_model.effects.user import UserEffect, torque_curve
from ema_model.effects.user.torque import MOST_KNOTS, OF_VARIABLE
from ema_model.errors import InputError
from ema_model.estimation.model_fit import Data, Fit, fit

Array = NDArray[np.float64]

_BLOCKS_PER_KNOT = 20
_LEAST_KNOTS = 4
_SMOOTH = 1e-3  # of the mean knot's weight, on second differences: it bridges knots that no data reach
_FINER = 0.02  # of χ², that another modulator or a shorter period must be better by
_TURN = 2.0 * np.pi
_TEETH = 4  # periods in a turn from which on a torque is one of teeth or poles


@dataclass(frozen=True, eq=False)
class _Curve:
    """A curve through the residual: knots at even distances, its modulator, and the χ² it leaves."""

    low: float
    high: float
    modulator: str
    periodic: bool
    knots: Array  # in the residual signal's unit
    chi2: float


def curve_trial(data: Data, current: Fit, explanation: Explanation | None, tell: Callable[[str], None]) -> Trial | None:
    """The model with the residual's own curve as a torque, refitted; None where what explains it is no torque."""
    if explanation is None or not is_torque(explanation, current.actuator):
        return None
    tell(f"trying a curve over the {explanation.variable.replace('_', ' ')}")
    actuator, name = with_curve(data, current, explanation)
    found = fit(data, actuator, current.starts, tell, current.faults)
    settings = dict(actuator.effects[name])
    return Trial(Candidate(name, 0.0, settings), {name: settings}, found, current.chi2 - found.chi2)


def is_a_shape(orders: Sequence[float]) -> bool:
    """Whether several low orders together are no teeth, but one shape within the turn, which no order is."""
    return len(orders) > 1 and max(orders) < _TEETH


def with_curve(data: Data, found: Fit, explanation: Explanation) -> tuple[Actuator, str]:
    """The actuator of a fit with a `torque_curve` along an explanation of its residual, and that effect's name.

    Its knots' values are what the residual asks for, and free: fit the actuator to find them for good.
    Raises InputError where the explanation is no torque over a variable of the shaft; `is_torque` tells before.
    """
    if not is_torque(explanation, found.actuator):
        raise InputError(
            f"a residual of {explanation.signal} over {explanation.variable} cannot be made a torque curve; "
            f"variables are {', '.join(OF_VARIABLE)}"
        )
    effect = curve_of(residuals_left(data, found), explanation, found.calibration.actuator)
    knots = {parameter.name: parameter.default for parameter in effect.parameters}
    size = float(np.sqrt(np.mean(np.square(list(knots.values())))))
    tolerances = {
        f"effects.{effect.name}.{name}": Tolerance(max(abs(value), size), True) for name, value in knots.items()
    }
    actuator = replace(
        found.actuator,
        effects={**found.actuator.effects, effect.name: knots},
        tolerances={**found.actuator.tolerances, **tolerances},
    )
    return actuator, effect.name


def is_torque(explanation: Explanation, actuator: Actuator) -> bool:
    """Whether a torque at the shaft can stand for what an explanation has found."""
    return (
        explanation.variable in OF_VARIABLE and _torque_per_unit(_inside(explanation, actuator), actuator) is not None
    )


def curve_of(residuals: Residuals, explanation: Explanation, actuator: Actuator) -> UserEffect:
    """The curve of an explanation as an effect, from the residuals that it explains."""
    signal = _inside(explanation, actuator)
    factor = _torque_per_unit(signal, actuator)
    used = used_blocks(residuals, signal)
    assert factor is not None
    if used is None:
        raise InputError("too few values of the residual can be judged for a curve")
    x = residuals.variables[explanation.variable][used.chosen]
    modulators = [explanation.modulator]
    if (explanation.variable, explanation.modulator) == ("motor_speed", "1"):
        modulators.append("sign_speed")  # friction turns over with the direction, in a jump that knots cannot follow
    curves = []
    for name in modulators:
        whole = modulator_of(residuals, name)
        if whole is None:
            continue
        scale, y = whole[used.chosen] * used.weight, used.values * used.weight
        if explanation.variable == "motor_angle" and residuals.turns >= 1.0:
            curves += [_fitted(x, y, scale, name, 0.0, _TURN / p, True) for p in range(1, HIGHEST_ORDER // 2 + 1)]
        else:
            curves.append(_fitted(x, y, scale, name, _short(x.min()), _short(x.max()), False))
    best = min(curves, key=lambda one: one.chi2)
    if best.chi2 > (1.0 - _FINER) * curves[0].chi2:
        best = curves[0]  # the simplest
    return torque_curve(factor * best.knots, best.low, best.high, OF_VARIABLE[explanation.variable], best.modulator)


def _inside(explanation: Explanation, actuator: Actuator) -> str:
    """The name inside of the signal that is explained."""
    return next(name for name in ORDER_OF_PRIMARY if actuator.axes.signal(name) == explanation.signal)


def _torque_per_unit(signal: str, actuator: Actuator) -> float | None:
    """Torque that the model lacks, N·m, for a residual (measured less model) of 1; None where it cannot be told.

    Where the motor has to give more than the model says, something holds the shaft: the sign turns over.  A position
    that goes further than the model's is pushed, against the stiffness of the position loop.
    """
    controller, motor = actuator.controller, actuator.motor
    if signal == "current_A":
        return -motor.torque_constant_Nm_A
    if signal == "motor_torque_Nm":
        return -1.0
    if controller.kind == "cascade":
        stiffness = controller.speed_gain_Nms_rad * controller.position_gain_1_s
    elif controller.kind == "position":
        inverter = actuator.inverter
        full = inverter.bus_voltage_V / motor.resistance_Ohm if inverter.kind == "voltage" else inverter.current_limit_A
        stiffness = controller.gain_1_rad * controller.output_limit * full * motor.torque_constant_Nm_A
    else:
        return None
    if signal == "user_position_rad":
        return stiffness
    if signal == "motor_position_rad":
        return stiffness * actuator.transmission.gear_ratio
    return controller.speed_gain_Nms_rad if controller.kind == "cascade" else None


def _fitted(x: Array, y: Array, scale: Array, modulator: str, low: float, high: float, periodic: bool) -> _Curve:
    """The least-squares curve through y (n,), over the floor, of x (n,) times scale (n,)."""
    count = int(np.clip(len(x) // _BLOCKS_PER_KNOT, _LEAST_KNOTS, MOST_KNOTS))
    columns = _hats(x, low, high, count, periodic) * scale[:, None]
    gram = columns.T @ columns
    bend = np.diff(np.eye(count), 2, axis=0)
    smooth = _SMOOTH * float(np.trace(gram)) / count * (bend.T @ bend) + 1e-12 * np.trace(gram) * np.eye(count)
    knots = np.linalg.solve(gram + smooth, columns.T @ y)
    left = y - columns @ knots
    return _Curve(low, high, modulator, periodic, knots, float(left @ left))


def _hats(x: Array, low: float, high: float, count: int, periodic: bool) -> Array:
    """What each knot of a `torque_curve` counts for at x: (n, knots)."""
    at = (x - low) / (high - low) * (count if periodic else count - 1)
    if periodic:
        away = np.abs(np.mod(at[:, None] - np.arange(count) + 0.5 * count, count) - 0.5 * count)
    else:
        away = np.abs(np.clip(at, 0.0, count - 1.0)[:, None] - np.arange(count))
    return np.clip(1.0 - away, 0.0, 1.0)


def _short(value: float) -> float:
    """A limit as one would write it."""
    return float(f"{value:.3g}")
