"""Gear friction: the load from outside presses the gear's teeth together."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, ratio):
    """+ μ |τ T_load|."""
    return level + ratio * abs(gear * load)


EFFECT = Effect(
    title="Gear load friction",
    equation="T_f = sgn ω [T_d + μ |τ T_load|]",
    source="Hamon, Gautier, Garrec, Dynamic identification with friction depending on load and velocity, IROS 2010",
    explanation=(
        "What the user pulls at the gear's output presses teeth and threads together, and they rub the harder. "
        "Unlike load-dependent friction this one does not care what the motor does: an actuator that accelerates "
        "without a load has none of it. Only recordings under a load can show it, and two loads tell it from "
        "plain dry friction."
    ),
    parameters=(Parameter("ratio", "friction μ per load, both at the motor", 0.2, 0.0, 0.95, plausible=(0.0, 0.8)),),
    severities=(0.1, 0.2, 0.4),
    places=(moving_friction,),
    shows="in the current under a load from outside, with the direction of motion",
    against="motor_speed",
    mistaken_for="load-dependent friction, dry friction",
    family="mechanics",
)
