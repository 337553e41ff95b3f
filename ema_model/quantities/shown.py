"""Signals and what is left of them, as figures, tables and sentences show them."""

from __future__ import annotations

from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import Quantity
from ema_model.quantities.signals import SIGNALS
from ema_model.quantities.titles import in_sentence


def of_signal(name: str, axes: Axes) -> Quantity:
    """A signal in its own unit, by its name inside or in files."""
    signal = SIGNALS.get(axes.signal(name))
    if signal is None:
        return Quantity(name.replace("_", " "), "")
    return Quantity(signal.title, signal.unit, symbol=signal.symbol)


def of_residual(name: str, axes: Axes, torque_constant: float | None = None) -> Quantity:
    """What is left of a signal; with a torque constant, N·m/A, the current's is told as the motor's torque."""
    if name == "current_A" and torque_constant is not None:
        torque = SIGNALS[axes.signal("motor_torque_Nm")]
        return Quantity(f"Residual {torque.kind}", torque.unit, torque_constant, f"Δ{torque.symbol}")
    whole = of_signal(name, axes)
    return Quantity(
        f"Residual {in_sentence(whole.title.removeprefix('Equivalent '))}", whole.unit, symbol=f"Δ{whole.symbol}"
    )
