"""Screw lead error: a screw's or a gear's pitch wobbles, so the user stands a little off where it should."""

from __future__ import annotations

import math

from ema_model.effects.effect import MOTOR, NEITHER, USER, Effect, Parameter
from ema_model.physics.elementary import sine
from ema_model.physics.jit import scalar

_TURN = 2.0 * math.pi


@scalar
def user_position(user, theta, gear, amplitude, period, phase):
    """+ A sin(2π θ/p + φ)."""
    return user + amplitude * sine(_TURN / period * theta + phase)


EFFECT = Effect(
    title="Screw lead error",
    equation="θ_user = τ θ + A sin(2π θ / p + φ)",
    source="ISO 3408-3, Ball screws: acceptance conditions, 2006: travel deviation and its wobble per turn",
    explanation=(
        "No thread or gear is cut exactly: as it turns, the output runs ahead of its ideal position and behind "
        "it again, in a pattern that repeats with the part's own turn. The controller sees the error at the user and "
        "moves the motor to make up for it, so the user follows the command and the motor's angle wobbles."
    ),
    parameters=(
        Parameter("amplitude_rad", "amplitude A at the user", 1e-5, 0.0, 1e-2, side=USER),
        Parameter(
            "period_rad",
            "motor angle p after which it repeats",
            _TURN,
            0.1,
            1000.0,
            side=MOTOR,
            linear=(0.02, 1e-4, 10.0),
        ),
        Parameter("phase_rad", "phase φ", 0.0, -math.pi, math.pi, side=NEITHER),
    ),
    severities=(5e-6, 1e-5, 2e-5),
    places=(user_position,),
    shows="in the user position against the motor angle, periodic",
    against="motor_angle",
    mistaken_for="an error of the position sensor, cogging torque",
    family="mechanics",
)
