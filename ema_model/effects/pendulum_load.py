"""Gravity on an arm: the load of a pendulum at the user."""

from __future__ import annotations

import math

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.elementary import sine
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, moment, angle):
    """− τ M sin(θ_user − θ_0), added."""
    return torque - gear * moment * sine(user - angle)


EFFECT = Effect(
    title="Pendulum load",
    equation="T = − τ m g l sin(θ_user − θ_0)",
    source="Newton's law of a mass m on an arm of length l",
    explanation=(
        "A mass on an arm is pulled down by its weight. Hanging, it needs no torque; the further it is lifted the "
        "more the motor must hold, up to m g l where the arm is level. The motor feels it through the gear, and the "
        "current shows it against the user's position, whether the axis moves or stands. Over a short travel the sine "
        "is a straight line, and the weight is not to be told from a spring; along a linear axis it is a constant load."
    ),
    parameters=(
        Parameter("moment_Nm", "moment m g l", 0.5, 0.0, 1e4, side=USER),
        Parameter("angle_rad", "angle θ_0 at which the arm hangs", 0.0, -math.pi, math.pi, side=USER),
    ),
    severities=(100.0, 300.0, 900.0),
    places=(shaft_torque,),
    shows="against the user position, in motion and at rest",
    against="user_position",
    mistaken_for="hinge moment, cubic spring, constant load",
    family="mechanics",
    is_load=True,
    turns=USER,
    terms=("constant_load", "hinge_moment"),
)
