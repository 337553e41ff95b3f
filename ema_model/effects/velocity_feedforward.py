"""The speed of the command, added to the speed that the position loop asks for."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def goal(goal, gear, begins, dt, ratio, before, slope):
    """The command as it is; what it rises by, as a speed of the motor, rad/s."""
    rise = 0.0 if begins else (goal - before) / (gear * dt)
    return goal, goal, rise


@scalar
def speed_command(wanted, limit, begins, dt, ratio, before, slope):
    """ω_ref + r dθ_cmd/dt, kept to ±limit."""
    return clamp(wanted + ratio * slope, -limit, limit), before, slope


EFFECT = Effect(
    title="Velocity feedforward",
    equation="ω_ref = sat(G (θ_cmd − θ_user) + r (dθ_cmd/dt)/τ)",
    source="Ellis, Control System Design Guide, 4th ed., 2012: feed-forward of a position loop",
    explanation=(
        "A position loop alone trails a steady motion by its speed over its gain. Drives take that away by adding the "
        "command's own speed to what the speed loop is asked for: all of it (r = 1) in most motion controllers, less "
        "in robots' drives, none in hobby servos. The motor then follows with hardly a lag, or leads at r > 1, and "
        "overshoots at corners; at rest nothing is seen. The gain of the position loop is the same, so that a load "
        "pushes the motor away as far as without."
    ),
    parameters=(Parameter("ratio", "share r of the command's speed", 0.5, -1.0, 3.0),),
    severities=(0.25, 0.5, 1.0),
    places=(goal, speed_command),
    shows="in how far the motor trails a moving command, in proportion to its speed",
    against="motor_speed",
    mistaken_for="position gain, position sensor delay, goal delay, viscous friction",
    family="drive",
    states=("goal_rad", "slope_rad_s"),
)
