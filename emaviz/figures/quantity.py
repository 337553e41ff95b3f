"""What stands on an axis of a comparison's figures: a title, a unit, and the factor to get there."""

from __future__ import annotations

import numpy as np

from ema_model.comparison.result import Comparison
from ema_model.quantities import shown, variables
from ema_model.quantities.numbers import Quantity


def of_signal(comparison: Comparison, name: str) -> Quantity:
    """A signal, in its own unit."""
    return shown.of_signal(name, comparison.actuator.axes)


def of_residual(comparison: Comparison, name: str, *, as_torque: bool = False) -> Quantity:
    """What is left of a signal; as_torque: the current's is told as the motor's torque, where that is known."""
    constant = comparison.residuals.torque_constant if as_torque else None
    return shown.of_residual(name, comparison.actuator.axes, constant)


def of_variable(comparison: Comparison, variable: str) -> Quantity:
    """A variable that residuals are held against; an angle of the motor in degrees."""
    return variables.of_variable(variable, comparison.actuator.axes)


def wrapped(comparison: Comparison, variable: str) -> np.ndarray:
    """A variable's values (blocks,) in SI units; a rotary motor's angle within one turn."""
    values = comparison.residuals.variables[variable]
    return np.mod(values, 2.0 * np.pi) if variables.is_turn(variable, comparison.actuator.axes) else values
