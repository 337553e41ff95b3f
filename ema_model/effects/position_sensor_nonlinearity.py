"""Nonlinearity of the position sensor: its characteristic is a bow instead of a straight line."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def position_reading(user, curvature):
    """θ_user + c θ_user²."""
    return user + curvature * user * user


EFFECT = Effect(
    title="Position sensor nonlinearity",
    equation="θ_read = θ_user + c θ_user^2",
    source="Fraden, Handbook of Modern Sensors, Springer 2016, ch. 3: nonlinearity",
    explanation=(
        "No potentiometer, resolver or differential transformer is quite straight. A bow in its characteristic makes "
        "it read too much at both ends of the travel, or too little. The controller follows the reading, so the user "
        "stands off by the bow, and the motor's angle with it."
    ),
    parameters=(Parameter("curvature_1_rad", "curvature c", 0.05, -10.0, 10.0, side=USER, linear=(0.05, -10.0, 10.0)),),
    severities=(0.02, 0.05, 0.2),
    places=(position_reading,),
    shows="in the motor angle against the user position, as a parabola",
    against="user_position",
    mistaken_for="position sensor eccentricity, position sensor gain",
    family="sensor",
)
