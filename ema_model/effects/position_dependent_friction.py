"""Position-dependent friction: a bent shaft or an uneven seal rubs harder at some angles of each turn."""

from __future__ import annotations

import math

from ema_model.effects.effect import MOTOR, NEITHER, Effect, Parameter
from ema_model.physics.elementary import sine
from ema_model.physics.jit import scalar


@scalar
def moving_friction(
    level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, ratio, order, phase
):
    """T_d [1 + a sin(h θ + φ)]."""
    return level * (1.0 + ratio * sine(order * theta + phase))


EFFECT = Effect(
    title="Position-dependent friction",
    equation="T_f = T_d [1 + a sin(h θ + φ)] sgn ω",
    source="Popović and Goldenberg, Friction by spectral analysis, IEEE Trans. Robot. Autom. 14(1), 1998",
    explanation=(
        "A shaft that is a little bent, a bearing ring out of round or a seal that was fitted askew presses harder at "
        "some angles than at others. Friction then swings with each turn. It turns over with the direction of motion, "
        "which tells it from cogging, and does not grow with the current, which tells it from torque ripple."
    ),
    parameters=(
        Parameter("ratio", "share a that friction swings by", 0.2, 0.0, 1.0),
        Parameter(
            "order",
            "periods h in each turn of the motor",
            1.0,
            1.0,
            48.0,
            integer=True,
            per=MOTOR,
            linear=(200.0, 1.0, 20000.0),
        ),
        Parameter("phase_rad", "phase φ", 0.0, -math.pi, math.pi, side=NEITHER),
    ),
    severities=(0.1, 0.2, 0.4),
    places=(moving_friction,),
    shows="periodic in the motor angle, turning over with the direction",
    against="motor_angle",
    mistaken_for="cogging torque, torque ripple",
    family="mechanics",
    by_direction=True,
)
