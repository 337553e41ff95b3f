"""A torque at the motor's shaft as a table over one variable, straight between its knots."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ema_model.effects import MOTOR, Parameter, register
from ema_model.effects.effect import PLACES
from ema_model.effects.user.module import generated_module
from ema_model.effects.user.torque import RANGE
from ema_model.effects.user.user_effect import UserEffect
from ema_model.errors import InputError, quoted
from ema_model.quantities import VARIABLES

MOST_KNOTS = 24
_ARGUMENTS = {"theta": "theta", "omega": "omega", "user": "user", "q": "current", "load": "load", "t": "time"}
OF_VARIABLE = {
    "motor_angle": "theta",
    "motor_speed": "omega",
    "user_position": "user",
    "current": "q",
    "load": "load",
    "time": "t",
}
_UNITS = {name: VARIABLES[variable].unit for variable, name in OF_VARIABLE.items()}
_SYMBOLS = {"theta": "θ", "omega": "ω", "user": "θ_user", "q": "q", "load": "T_load", "t": "t"}
_FACTORS = {"1": "", "sign_speed": " * sign_of(omega)", "current": " * current"}
_SHOWN = {"1": "", "sign_speed": " sgn ω", "current": " q"}


def torque_curve(
    values: ArrayLike, low: float, high: float, variable: str = "theta", modulator: str = "1"
) -> UserEffect:
    """The effect of a torque that follows a curve; it is registered, so that models find it by its name.

    values: (2 … 24,) N·m (N·m/A with the modulator "current"), at even distances from low to high in the variable's
    unit; they are the parameters' defaults.  Beyond the ends the curve stays level.  Only a curve over theta whose
    span is a turn or a whole fraction of it repeats: its last knot lies one distance before `high`, where the first
    comes again.  A curve on the same knots takes the place of the one before.
    Raises InputError for wrong knots, limits, variables and modulators.
    """
    knots = _knots(values)
    if variable not in _ARGUMENTS:
        raise InputError(f"no variable {quoted(variable)!r} for a torque curve; variables are {', '.join(_ARGUMENTS)}")
    if modulator not in _FACTORS:
        raise InputError(f"no modulator {quoted(modulator)!r} for a torque curve; modulators are {', '.join(_FACTORS)}")
    if not (math.isfinite(low) and math.isfinite(high) and high - low > 1e-12 * max(abs(low), abs(high))):
        raise InputError(f"a torque curve must go from a number to a larger one, not from {low} to {high}")
    low, high = float(low), float(high)
    periodic = variable == "theta" and is_period(high - low)
    name, module = generated_module("torque_curve", kernel(len(knots), low, high, variable, modulator, periodic))
    distance = (high - low) / (len(knots) if periodic else len(knots) - 1)
    unit = "N·m/A" if modulator == "current" else "N·m"
    symbol = _SYMBOLS[variable]
    return register(
        UserEffect(
            title="Torque curve",
            equation=f"T = f({symbol}){_SHOWN[modulator]}, {symbol} = {low:g} … {high:g} {_UNITS[variable]}",
            source="a curve measured by the residual",
            explanation=(
                "A torque that no effect of the library explains, as a table: straight lines between knots at even "
                "distances. Its knots are fitted like the parameters of any effect."
            ),
            parameters=tuple(
                Parameter(
                    f"knot_{j:02d}",
                    f"{unit} at {symbol} = {low + j * distance:.4g} {_UNITS[variable]}",
                    value,
                    *RANGE,
                    side=MOTOR,
                    unit=unit,
                )
                for j, value in enumerate(knots)
            ),
            severities=(0.5 * knots[0], knots[0], 2.0 * knots[0]),
            places=(module.shaft_torque,),
            shows=f"against {symbol}",
            mistaken_for="",
            family="mechanics",
            name=name,
            kind="torque_curve",
            definition={"variable": variable, "modulator": modulator, "low": low, "high": high},
        )
    )


def is_period(span: float) -> bool:
    """Whether a span, rad, is a turn or a whole fraction of it."""
    parts = 2.0 * math.pi / span
    return parts > 0.5 and abs(parts - round(parts)) < 1e-6 * parts


def _knots(values: ArrayLike) -> list[float]:
    try:
        knots = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError("the knots of a torque curve must be numbers") from None
    if knots.ndim != 1 or not 2 <= knots.size <= MOST_KNOTS:
        raise InputError(f"a torque curve needs a row of 2 to {MOST_KNOTS} knots, not shape {knots.shape}")
    for j, value in enumerate(knots):
        if not RANGE[0] <= value <= RANGE[1]:
            raise InputError(f"knot {j} of the torque curve is {value:g}; it must lie in {RANGE[0]:g} … {RANGE[1]:g}")
    return knots.tolist()


def kernel(count: int, low: float, high: float, variable: str, modulator: str, periodic: bool) -> str:
    """Source of the effect's function: a sum of hats, one over each knot, without a branch or an index."""
    own = [f"k{j}" for j in range(count)]
    scale = (count if periodic else count - 1) / (high - low)
    lines = [f"    x = ({_ARGUMENTS[variable]} - {low!r}) * {scale!r}"]
    hats = [(float(j), knot) for j, knot in enumerate(own)]
    if periodic:
        lines.append(f"    x = x - {float(count)!r} * np.floor(x * {1.0 / count!r})")
        hats.append((float(count), own[0]))
    else:
        lines.append(f"    x = clamp(x, 0.0, {float(count - 1)!r})")
    lines.append("    value = 0.0")
    lines += [f"    value += {knot} * clamp(1.0 - abs(x - {at!r}), 0.0, 1.0)" for at, knot in hats]
    return "\n".join(
        [
            "@scalar",
            f"def shaft_torque({', '.join([*PLACES['shaft_torque'], *own])}):",
            *lines,
            f"    return torque + value{_FACTORS[modulator]}",
            "",
        ]
    )
