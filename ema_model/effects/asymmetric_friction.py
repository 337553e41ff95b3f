"""Asymmetric friction: it takes more to slide one way than the other."""

from __future__ import annotations

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.elementary import sign
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, ratio, viscous):
    """T_d (1 + a sgn ω)."""
    return level * (1.0 + ratio * sign(omega))


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, ratio, viscous):
    """− c |ω|, added."""
    return torque - viscous * abs(omega)


EFFECT = Effect(
    title="Asymmetric friction",
    equation="T_f = T_d (1 + a sgn ω) sgn ω + c |ω|",
    source="Armstrong-Hélouvry, Control of Machines with Friction, Kluwer 1991: friction by direction",
    explanation=(
        "Seals lie at a slant, teeth wear on one flank, a bearing is loaded to one side: friction one way is then "
        "not that of the other. The mean of both is the base model's friction. Half the difference acts like a "
        "constant torque as long as the motor moves, and goes away when it stands, which tells it from an offset "
        "of the current's sensor. Viscous friction differs as well where grease is sheared more one way: that "
        "part grows with the speed."
    ),
    parameters=(
        Parameter(
            "ratio", "share a more in positive motion, and less in negative", 0.12, -0.9, 0.9, plausible=(-0.6, 0.6)
        ),
        Parameter(
            "viscous_part_Nms_rad",
            "viscous friction c more in positive motion, and less in negative",
            0.0,
            -5e-3,
            5e-3,
            side=MOTOR,
            linear=(0.0, -1e5, 1e5),
            plausible=(-1.0, 1.0),  # beyond, one direction would be driven by its friction
            plausible_of="motor.viscous_friction_Nms_rad",
        ),
    ),
    severities=(0.06, 0.12, 0.25),
    places=(moving_friction, shaft_torque),
    shows="as an offset of the current in motion, in either direction alike",
    against="motor_speed",
    mistaken_for="current sensor bias",
    beside={"viscous_part_Nms_rad": 0.01},
    family="mechanics",
)
