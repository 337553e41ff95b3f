"""Drag by the square of speed: what stirs or blows a fluid."""

from __future__ import annotations

import math

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, speed):
    """+ T_d (ω/ω_q)²."""
    ratio = omega * (1.0 / speed)
    return level * (1.0 + ratio * ratio)


EFFECT = Effect(
    title="Quadratic drag",
    equation="T_f = sgn ω T_d [1 + (ω/ω_q)^2]",
    source="Seetharaman and Kahraman, Load-independent spin power losses of a spur gear pair, J. Tribology 131, 2009",
    explanation=(
        "Teeth that run through an oil bath and a fan on the shaft throw the fluid aside, and twice the speed takes "
        "four times the torque. Nothing is felt at low speed, so it is not the shear of grease, which grows in "
        "proportion. The parameter is the speed at which it has grown to the dry friction: the lower, the more drag."
    ),
    parameters=(
        Parameter(
            "speed_rad_s",
            "speed ω_q at which the drag is as much as dry friction",
            600.0,
            0.1,
            1e5,
            side=MOTOR,
            linear=(0.3, 1e-4, 100.0),
        ),
    ),
    severities=(1000.0, 600.0, 350.0),
    at_speeds=(0.7, 1.5, 3.0),
    places=(moving_friction,),
    shows="in the current, with the square of speed",
    against="motor_speed",
    mistaken_for="viscous friction, Stribeck friction",
    family="mechanics",
    nothing=math.inf,
)
