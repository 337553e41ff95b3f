"""Borello's dry friction with stick (T 3.5.1) and the step of a rotor under it."""

from __future__ import annotations

from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def borello_friction(omega, active_torque, static, dynamic):
    """Friction torque, N·m.

    At rest it balances the active torque up to ±static; in motion it is dynamic·sgn ω.
    (The thesis prints "V = 0 or |F| ≤ FSJ"; only "and" gives a rotor that can stick and move.)
    """
    moving = dynamic if omega > 0.0 else -dynamic
    return clamp(active_torque, -static, static) if omega == 0.0 else moving


@scalar
def advance_rotor(theta, omega, net_torque, inverse_inertia, stop_low, stop_high, dt):
    """New angle and speed (T 3.13, semi-implicit Euler).

    A change of sign within the step stops the rotor (T 3.16), so that friction is asked again at rest;
    an end stop holds the angle and stops the rotor inelastically.
    """
    accelerated = omega + dt * inverse_inertia * net_torque
    omega1 = 0.0 if accelerated * omega < 0.0 else accelerated
    free = theta + dt * omega1
    theta1 = clamp(free, stop_low, stop_high)
    return theta1, (omega1 if theta1 == free else 0.0)
