"""Mesh friction: what teeth or threads carry on to the inertia and the load behind them presses them together."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.elementary import sign
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, ratio):
    """L = T_d + μ |T_m − C ω − L sgn ω|, solved for L; at rest sgn ω is of the motion that would begin."""
    drives = (motor_torque - drag) * sign(active if omega == 0.0 else omega)
    side = ratio if drives > level else -ratio
    return (level + side * drives) / (1.0 + side)


EFFECT = Effect(
    title="Mesh friction",
    equation="T_f = sgn ω [T_d + μ |J dω/dt + τ T_load|]",
    source="Hamon, Gautier, Garrec, Dynamic identification with friction depending on load and velocity, IROS 2010",
    explanation=(
        "Teeth and threads rub the harder, the more torque they carry on to what is behind them. Of the motor's torque "
        "they carry what its own friction has left: what accelerates the inertia and holds the load. So, unlike "
        "load-dependent friction, a motor that turns steadily without a load adds none, and one that brakes a heavy "
        "table adds as much as one that drives it. The ratio counts per torque on the whole inertia; of a motor whose "
        "own rotor is much of it, the teeth carry less."
    ),
    parameters=(Parameter("ratio", "friction μ per torque carried, both at the motor", 0.15, 0.0, 0.6),),
    severities=(0.08, 0.15, 0.25),
    places=(moving_friction,),
    shows="in the current while the speed changes or under a load, with the direction of motion",
    against="current",
    mistaken_for="load-dependent friction, torque saturation",
    family="mechanics",
)
