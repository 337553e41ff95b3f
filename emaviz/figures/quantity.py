"""What stands on an axis: a title, a unit that suits the size of the numbers, and the factor to get there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ema_model.comparison.residuals import Residuals
from ema_model.comparison.result import Comparison
from ema_model.recordings import SIGNALS

_PREFIXED = frozenset(("rad", "m", "A", "V", "N·m", "N", "rad/s", "m/s", "s"))
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
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SMALLEST = 0.3  # shown as it is; what is smaller gets the next prefix


@dataclass(frozen=True)
class Quantity:
    """shown = factor · value in SI units."""

    title: str
    unit: str
    factor: float = 1.0
    symbol: str = ""

    @property
    def short_label(self) -> str:
        """'I_eq [A]': for an axis that is too short for the title."""
        return f"{self.symbol or self.title} [{self.unit}]" if self.unit else self.symbol or self.title

    @property
    def label(self) -> str:
        """'Residual torque [mN·m]'."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def scaled(self, values: ArrayLike) -> Quantity:
        """With milli or micro where the largest of the values (in SI units) asks for it."""
        size = np.abs(np.asarray(values, dtype=float) * self.factor)
        largest = float(np.max(size[np.isfinite(size)], initial=0.0))
        if self.unit not in _PREFIXED or largest == 0.0:
            return self
        for factor, prefix in ((1.0, ""), (1e3, "m")):
            if largest * factor >= _SMALLEST:
                return replace(self, unit=prefix + self.unit, factor=self.factor * factor)
        return replace(self, unit="µ" + self.unit, factor=self.factor * 1e6)

    def text(self, value: float) -> str:
        """'35.2 mN·m', three digits."""
        return f"{number(value * self.factor)} {self.unit}".strip()


def number(value: float, digits: int = 3) -> str:
    """So many digits, without an exponent where that is readable: 0.0352, 1.30·10⁻⁵; – for what is no number."""
    if not math.isfinite(value):
        return "–"
    size = abs(value)
    if size != 0.0 and not 1e-4 <= size < 1e6:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        return f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    decimals = max(0, digits - 1 - (math.floor(math.log10(size)) if size else 0))
    return f"{value:.{min(decimals, 8)}f}".replace("-", "−")


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
