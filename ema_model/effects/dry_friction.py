"""More dry friction than the base model's, or less: a tight seal, a preloaded gear, parts that have run in."""

from __future__ import annotations

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, more):
    """T_d + T, and no less than none; at rest as much holds where it is more than the static friction."""
    return max(level + more, min(level, 0.0))


EFFECT = Effect(
    title="Dry friction",
    equation="T_f = (T_d + T) sgn ω",
    source="Coulomb 1785; Armstrong-Hélouvry et al., Automatica 30(7), 1994",
    explanation=(
        "Seals, preloaded bearings and gears that are pressed together resist sliding with a force that hardly depends "
        "on speed. Data sheets tell it seldom, it grows with preload, dirt and cold, and falls as parts run in. The "
        "base model has some; the effect adds to it, or takes away from it. Of the three-phase actuator it is the "
        "fault k1."
    ),
    parameters=(
        Parameter(
            "torque_Nm",
            "dry friction T beyond the base model's; negative: less",
            0.02,
            -1e3,
            1e3,
            side=MOTOR,
            linear=(5.0, -1e5, 1e5),
        ),
    ),
    severities=(0.01, 0.02, 0.04),
    places=(moving_friction,),
    shows="in the current, by the direction of motion",
    against="motor_speed",
    mistaken_for="Stribeck friction, load-dependent friction, demagnetisation",
    family="mechanics",
    duplicates="motor.dynamic_friction_Nm",
    fault="k1",
)
