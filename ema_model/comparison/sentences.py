"""Findings in plain words, with numbers and units."""

from __future__ import annotations

import math

from ema_model.quantities.axes import Axes
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import SIGNALS

_PREFIXES = ((1e-6, "µ"), (1e-3, "m"), (1.0, ""), (1e3, "k"))
_SCALED = ("N·m", "rad", "A", "m", "N", "V", "rad/s", "m/s")
_EXPLAINED = {
    "motor_angle": "repeats with the motor's angle",
    "user_position": "goes with the user's position",
    "motor_speed": "goes with the motor's speed",
    "acceleration": "goes with the acceleration",
    "current": "goes with the motor's current",
    "load": "goes with the load",
    "time": "drifts with time",
    "temperature": "goes with the temperature",
}
_MODULATED = {"1": "", "sign_speed": ", with the direction of motion", "current": ", in proportion to the current"}


def amount(value: float, unit: str, digits: int = 2) -> str:
    """A size with its unit, prefixed so that it reads well: 0.0352 N·m → 35 mN·m."""
    if not math.isfinite(value):
        return f"? {unit}"
    size = abs(value)
    scale, prefix = 1.0, ""
    if unit in _SCALED and size > 0.0:
        scale, prefix = max((pair for pair in _PREFIXES if size >= 0.9995 * pair[0]), default=_PREFIXES[0])
        if scale == 1e3 and size < 1e4:
            scale, prefix = 1.0, ""
    number = value / scale
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(number)))) if number else 0
    rounded = round(number, digits - 1 - math.floor(math.log10(abs(number)))) if number else 0.0
    text = f"{rounded:.{decimals}f}".replace("-", "−")
    return f"{text} {prefix}{unit}".rstrip()


def goes_with(variable: str, modulator: str) -> str:
    """'goes with the load, with the direction of motion'."""
    return f"{_EXPLAINED[variable]}{_MODULATED[modulator]}"


def explanation_sentence(signal: str, variable: str, modulator: str, r2: float) -> str:
    """One line on what explains a residual, and how much of it."""
    title = in_sentence(SIGNALS[signal].title)
    share = f"{100.0 * max(0.0, r2):.0f} % of what is left"
    return f"The {title}'s error {goes_with(variable, modulator)} ({share})."


def order_sentence(order: int, amplitude: float, unit: str) -> str:
    """One line on an order of the residual."""
    times = "once" if order == 1 else f"{order} times"
    return f"What is missing repeats {times} a turn with an amplitude of {amount(amplitude, unit)}."


def region_sentence(
    signal: str,
    variable: str,
    low: float,
    high: float,
    typical: float,
    mean: float,
    direction: int,
    *,
    torque_constant: float | None,
    axes: Axes,
    duration_s: float,
    slow: bool,
) -> str:
    """One line on a region: what the motor needs more or less there, or how far a position is off.

    mean: of measurement − model; direction: ±1 where all of the region moves one way, else 0; typical: the
    variable's mean there; slow: the region is that of reversals.
    """
    where = _where(variable, low, high, typical, axes, duration_s, slow)
    moving = ""
    if direction and variable != "motor_speed":
        moving = " when it moves forward" if direction > 0 else " when it moves back"
    if SIGNALS[signal].kind in ("current", "torque", "force"):
        size, unit = abs(mean), SIGNALS[signal].unit
        if signal == "current_A" and torque_constant is not None:
            size, unit = size * torque_constant, "N" if axes.motor == "linear" else "N·m"
        if direction:
            more = "more" if mean * direction > 0.0 else "less"
            return f"The motor needs {amount(size, unit)} {more} {where}{moving} than the model."
        way = "forward" if mean > 0.0 else "backward"
        what = {"N": "force", "A": "current"}.get(unit, "torque")
        return f"The motor needs {amount(size, unit)} more {what} {way} {where} than the model."
    title, unit = in_sentence(SIGNALS[signal].title), SIGNALS[signal].unit
    if SIGNALS[signal].kind == "position":
        behind = direction and mean * direction < 0.0
        side = ("behind" if behind else "ahead of") if direction else ("above" if mean > 0.0 else "below")
        return f"The {title} is {amount(abs(mean), unit)} {side} the model {where}{moving}."
    return f"The {title} is {amount(abs(mean), unit)} {'above' if mean > 0 else 'below'} the model {where}{moving}."


def _where(variable: str, low: float, high: float, typical: float, axes: Axes, duration_s: float, slow: bool) -> str:
    unit = axes.variable_unit(variable)
    if variable == "motor_angle" and axes.motor == "rotary":
        return f"between {math.degrees(low):.0f}° and {math.degrees(high):.0f}° of the motor's turn"
    if variable == "motor_speed":
        return "at reversals and standstill" if slow else f"at {amount(typical, unit)}"
    if variable == "time":
        part = ""
        if duration_s > 0.0:
            part = " (the start)" if high < 0.2 * duration_s else " (the end)" if low > 0.8 * duration_s else ""
        return f"from {amount(low, unit, 3)} to {amount(high, unit, 3)}{part}"
    if variable == "load":
        return f"under a load of {amount(typical, unit)}"
    names = {"user_position": "a user position of ", "acceleration": "an acceleration of ", "temperature": ""}
    return f"at {names.get(variable, '')}{amount(typical, unit)}"
