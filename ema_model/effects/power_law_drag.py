"""Drag by a power of speed below one: what the film of lubricant in a rolling bearing drags with."""

from __future__ import annotations

import math

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, speed, exponent):
    """+ T_d (|ω|/ω_p)^p."""
    return level * (1.0 + math.pow(abs(omega) * (1.0 / speed), exponent))


EFFECT = Effect(
    title="Power-law drag",
    equation="T_f = sgn ω T_d [1 + (|ω|/ω_p)^p]",
    source="Palmgren, Ball and Roller Bearing Engineering, 1959: rolling bearings, p = 2/3; in other films p = 1/2",
    explanation=(
        "The faster balls and rollers roll, the thicker the film of oil that they draw in, so that the drag of its "
        "shear grows less than in proportion to speed: with its power of two thirds in a rolling bearing, with its "
        "root in other films. It is steep at low speed and never levels off, where a drag that saturates does. The "
        "first parameter is the speed at which it has grown to the dry friction: the lower, the more drag."
    ),
    parameters=(
        Parameter(
            "speed_rad_s",
            "speed ω_p at which the drag is as much as dry friction",
            800.0,
            1e-3,
            1e6,
            side=MOTOR,
            linear=(0.4, 1e-6, 1000.0),
        ),
        Parameter("exponent", "power p of speed", 0.5, 0.2, 0.9),
    ),
    severities=(4000.0, 800.0, 200.0),
    at_speeds=(0.5, 2.0, 10.0),
    places=(moving_friction,),
    shows="in the current, with a bent curve of speed, either way",
    against="motor_speed",
    mistaken_for="viscous friction, viscous friction that saturates",
    family="mechanics",
    terms=("dry_friction",),
    by_direction=True,
    nothing=math.inf,
)
