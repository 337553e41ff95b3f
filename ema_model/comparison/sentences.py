"""Findings in plain words, with numbers and units."""

from __future__ import annotations

from ema_model.quantities.axes import Axes, of_residual
from ema_model.quantities.numbers import Quantity, number
from ema_model.quantities.titles import in_sentence
from ema_model.quantities.variables import MODULATORS, VARIABLES, is_turn, of_variable
from ema_model.recordings import SIGNALS

OPEN_LOOP = (
    "In open loop the noise of what is put in adds up in the motion, which the floor does not count: an error of some "
    "floors may be that alone, and a small effect is not told from it. Where the motor's position and current are "
    "recorded, discovery puts the motion in instead."
)


def dependence(variable: str, modulator: str) -> str:
    """'motor speed and direction'."""
    return f"{VARIABLES[variable].noun}{MODULATORS[modulator].noun}"


def explanation_sentence(signal: str, variable: str, modulator: str, r2: float) -> str:
    """One line on what explains a residual, and how much of it."""
    share = f"{100.0 * max(0.0, r2):.0f} % of the residual {in_sentence(SIGNALS[signal].title)} variance"
    return f"{share} is explained by {dependence(variable, modulator)} (cross-validated)."


def order_sentence(order: float, amplitude: float, of: Quantity) -> str:
    """One line on an order of the residual, with its amplitude in SI units."""
    times = "once" if order == 1 else f"{order:g} times"
    return f"What is missing repeats {times} a turn with an amplitude of {of.scaled(amplitude).text(amplitude)}."


def event_sentence(signal: str, axes: Axes, recording: str, time_s: float, change: float, by_direction: bool) -> str:
    """One line on a step of a signal at one moment of a recording; change: measured less model, after less before."""
    told = of_residual(signal, axes, None)
    size, title = told.scaled(change).text(abs(change)), in_sentence(SIGNALS[signal].title)
    when = f"From {number(time_s)} s of {recording or 'the recording'} on"
    higher = "higher" if change > 0.0 else "lower"
    if by_direction:
        return f"{when}, the {title} is {size} {higher} in the direction of motion than before: a change of friction."
    if SIGNALS[signal].kind in ("current", "torque", "force"):
        return (
            f"{when}, the {title} is {size} {higher} than before: a load that came on or off, or a sensor that jumped."
        )
    return f"{when}, the {title} is {size} {higher} than before: a position sensor that jumped."


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
    details: str = "",
) -> str:
    """One line on a region: what the motor needs more or less there, or how far a position is off.

    mean: of measurement − model; direction: ±1 where all of the region moves one way, else 0; typical: the
    variable's mean there; slow: the region is that of reversals; details: what else is said
    of the place.
    """
    where = _where(variable, low, high, typical, axes, duration_s, slow) + (f" ({details})" if details else "")
    moving = ""
    if direction and (slow or variable != "motor_speed"):  # a speed has the direction in its sign
        moving = " when it moves forward" if direction > 0 else " when it moves back"
    told = of_residual(signal, axes, torque_constant)
    size = told.scaled(mean).text(abs(mean))
    if SIGNALS[signal].kind in ("current", "torque", "force"):
        what = told.title.rpartition(" ")[2]
        if direction:
            more = "more" if mean * direction > 0.0 else "less"
            return f"The motor needs {size} {more} {what} {where}{moving} than the model."
        way = "forward" if mean > 0.0 else "backward"
        return f"The motor needs {size} more {what} {way} {where} than the model."
    title = in_sentence(SIGNALS[signal].title)
    if SIGNALS[signal].kind == "position":
        behind = direction and mean * direction < 0.0
        side = ("behind" if behind else "ahead of") if direction else ("above" if mean > 0.0 else "below")
        return f"The {title} is {size} {side} the model {where}{moving}."
    return f"The {title} is {size} {'above' if mean > 0 else 'below'} the model {where}{moving}."


def range_text(variable: str, low: float, high: float, axes: Axes, digits: int = 3) -> str:
    """'from 250 to 350 rad/s'."""
    told = of_variable(variable, axes)
    told = told if is_turn(variable, axes) else told.scaled([low, high])
    ends = [number(told.factor * end, digits) for end in (low, high)]
    return f"from {ends[0]} to {ends[1]} {told.unit}".rstrip()


def _where(variable: str, low: float, high: float, typical: float, axes: Axes, duration_s: float, slow: bool) -> str:
    told = of_variable(variable, axes)
    if is_turn(variable, axes):
        return f"between {told.factor * low:.0f}° and {told.factor * high:.0f}° of the motor's turn"
    if variable == "motor_speed" and slow:
        return "at reversals and standstill"
    if variable == "time":
        part = ""
        if duration_s > 0.0:
            part = " (the start)" if high < 0.2 * duration_s else " (the end)" if low > 0.8 * duration_s else ""
        told = told.scaled(high)
        return f"from {number(told.factor * low)} to {told.text(high)}{part}"
    return f"{VARIABLES[variable].place}{told.scaled(typical).text(float(f'{typical:.3g}'))}"
