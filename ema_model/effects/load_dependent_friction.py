"""Load-dependent friction: what the teeth and threads transmit presses them together."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, ratio):
    """+ μ |T_m|."""
    return level + ratio * abs(motor_torque)


EFFECT = Effect(
    title="Load-dependent friction",
    equation="T_f = sgn ω [T_d + μ |T_m|]",
    source="Duclusaud et al., Extended Friction Models for the Physics Simulation of Servo Actuators, ICRA 2025",
    explanation=(
        "Gear teeth, screw threads and bearings rub the harder, the more torque they transmit. The base model's "
        "friction is the same under any load; with this effect it grows with the motor's torque. The motor must "
        "then push more than the load alone asks for, and holds it with less when it is let down."
    ),
    parameters=(Parameter("ratio", "friction μ per motor torque", 0.15, 0.0, 0.95, plausible=(0.0, 0.6)),),
    severities=(0.08, 0.15, 0.25),
    places=(moving_friction,),
    shows="in the current under load, with the direction of motion",
    against="current",
    mistaken_for="dry friction, viscous friction",
    family="mechanics",
)
