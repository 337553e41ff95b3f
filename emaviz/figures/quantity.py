"""What stands on an axis: a title, a unit that suits the size of the numbers, and the factor to get there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ema_model.comparison.residuals import Residuals
from ema_model.comparison.result import Comparison
from ema_model.quantities.numbers import Quantity
from ema_model.recordings import SIGNALS

_VARIABLE_TITLES = {
    "motor_angle": "Motor angle",
    "user_position": "User position",
    "motor_speed": "Motor speed",
    "acceleration": "Motor acceleration",
    "current": "Current",
    "load": "Load",
    "time": "Time",
    "temperature": "Temperature",
}
MODULATOR_TITLES = {"1": "alone", "current": "× current", "sign_speed": "× direction"}


def of_signal(comparison: Comparison, name: str) -> Quantity:
    """A signal, in its own unit."""
    signal = SIGNALS.get(comparison.actuator.axes.signal(name))
    return (
        Quantity(name.replace("_", " "), "")
        if signal is None
        else Quantity(signal.title, signal.unit, symbol=signal.symbol)
    )


def of_residual(comparison: Comparison, name: str, *, as_torque: bool = False) -> Quantity:
    """What is left of a signal; as_torque: the current's is told as the motor's torque, where that is known."""
    constant = comparison.residuals.torque_constant
    if as_torque and name == "current_A" and constant is not None:
        linear = comparison.actuator.axes.motor == "linear"
        if linear:
            return Quantity("Residual force", "N", constant, "ΔF_m")
        return Quantity("Residual torque", "N·m", constant, "ΔT_m")
    quantity = of_signal(comparison, name)
    title = quantity.title.removeprefix("Equivalent ")
    return replace(quantity, title=f"Residual {title[0].lower()}{title[1:]}", symbol=f"Δ{quantity.symbol}")


def of_variable(comparison: Comparison, variable: str) -> Quantity:
    """A variable that residuals are held against; an angle of the motor in degrees."""
    unit = comparison.actuator.axes.variable_unit(variable)
    title = _VARIABLE_TITLES[variable]
    if variable == "motor_angle" and unit == "rad":
        return Quantity(title, "°", 180.0 / math.pi)
    return Quantity(title, unit)


def variable_title(variable: str) -> str:
    """'Motor angle' of 'motor_angle'."""
    return _VARIABLE_TITLES.get(variable, variable.replace("_", " "))


def wrapped(comparison: Comparison, variable: str) -> np.ndarray:
    """A variable's values (blocks,) in SI units; a rotary motor's angle within one turn."""
    residuals: Residuals = comparison.residuals
    values = residuals.variables[variable]
    if variable == "motor_angle" and comparison.actuator.axes.variable_unit(variable) == "rad":
        return np.mod(values, 2.0 * np.pi)
    return values
