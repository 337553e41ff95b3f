"""More viscous friction than the base model's: drag in proportion to speed."""

from __future__ import annotations

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, coefficient):
    """− C ω, added."""
    return torque - coefficient * omega


EFFECT = Effect(
    title="Viscous friction",
    equation="T = − C ω",
    source="Armstrong-Hélouvry et al., Automatica 30(7), 1994",
    explanation=(
        "Oil and grease resist being sheared, the more the faster the parts slide, so this friction grows in "
        "proportion to speed. Cold makes grease stiff: the same actuator may drag several times as much in winter. "
        "The base model has some; the effect adds to it."
    ),
    parameters=(
        Parameter(
            "coefficient_Nms_rad",
            "drag C beyond the base model's",
            7e-5,
            0.0,
            5e-3,
            side=MOTOR,
            linear=(10.0, 0.0, 1e5),
        ),
    ),
    severities=(3e-5, 7e-5, 1.5e-4),
    places=(shaft_torque,),
    shows="in the current, in proportion to speed",
    against="motor_speed",
    mistaken_for="load-dependent friction",
    family="mechanics",
    duplicates="motor.viscous_friction_Nms_rad",
)
