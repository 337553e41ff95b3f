"""Friction drift: friction falls as grease warms up, or rises, in the course of a recording."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, rate):
    """T_d (1 + r t), never below 0."""
    return level * max(1.0 + rate * time, 0.0)


EFFECT = Effect(
    title="Friction drift",
    equation="T_f = T_d (1 + r t) sgn ω",
    source="Bittencourt and Gunnarsson, Static friction in a robot joint, J. Dyn. Syst. Meas. Control 134(5), 2012",
    explanation=(
        "Grease gets thinner as it warms up, so friction falls while the actuator works; a bearing that runs hot or a "
        "brake that drags lets it rise. The model's friction is right in the middle of the recording and wrong at both "
        "ends. Time is counted from each recording's own start."
    ),
    parameters=(Parameter("rate_1_s", "rate r, share a second", 0.5, -10.0, 10.0),),
    severities=(0.2, 0.5, 1.0),
    places=(moving_friction,),
    shows="in the current by direction, growing with time",
    against="time",
    mistaken_for="viscous friction in a chirp",
    family="mechanics",
)
