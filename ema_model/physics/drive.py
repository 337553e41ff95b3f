"""Drives: how the Monitor Model's current follows the controller's demand; L dI/dt = V − R I − E.

Two for the thesis's hysteresis current loop, whose demand is a current, and two for other actuators.
"""

from __future__ import annotations

from ema_model.physics.elementary import clamp, sign
from ema_model.physics.jit import scalar


@scalar
def thesis_drive(current, reference, emf, voltage, resistance, inverse_inductance, dt):
    """The thesis's: the full voltage by the sign of I_ref − I (T 3.3.3), which chops at every step."""
    v = voltage * sign(reference - current)
    return current + dt * inverse_inductance * (v - resistance * current - emf)


@scalar
def reduced_drive(current, reference, emf, voltage, resistance, inverse_inductance, dt):
    """The dead-beat voltage, clamped: the reference is met within the step where the voltage suffices."""
    rate = dt * inverse_inductance
    drift = current - rate * (resistance * current + emf)
    return clamp(reference, drift - rate * voltage, drift + rate * voltage)


@scalar
def current_drive(current, reference, emf, voltage, resistance, inverse_inductance, dt):
    """An ideal current source: the reference is met at once."""
    return reference


@scalar
def voltage_drive(current, duty, emf, voltage, resistance, inverse_inductance, dt):
    """A share of the bus voltage (PWM) on the winding; implicit, so that any inductance is stable."""
    rate = dt * inverse_inductance
    return (current + rate * (duty * voltage - emf)) / (1.0 + rate * resistance)
