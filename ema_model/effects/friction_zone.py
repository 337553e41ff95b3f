"""A zone of friction: over a part of the travel the mechanism runs stiffly."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar

_LEAST = 1e-12  # rad², of a zone without width


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, ratio, begin, end):
    """T_d (1 + a z), z a parabola that is 1 in the middle of the zone and 0 at its ends and beyond."""
    half = 0.5 * (end - begin)
    away = user - 0.5 * (begin + end)
    return level * (1.0 + ratio * clamp(1.0 - away * away / (half * half + _LEAST), 0.0, 1.0))


EFFECT = Effect(
    title="Friction zone",
    equation="T_f = T_d (1 + a z) sgn ω, z = max(0, 1 − (2 θ_user − θ_1 − θ_2)^2 / (θ_2 − θ_1)^2)",
    source="Armstrong-Hélouvry, Control of Machines with Friction, Kluwer 1991: friction by position",
    explanation=(
        "Where an actuator works most, its screw, its seal or its guide wears or runs dry; dirt and dents do the same "
        "at one place. Over that part of the travel it takes more torque to slide, either way. Elsewhere nothing is "
        "seen, so a model whose friction is right on average fails in the zone and, the other way, outside it."
    ),
    parameters=(
        Parameter("ratio", "share a more in the middle of the zone", 0.6, -0.9, 5.0),
        Parameter("begin_rad", "user position θ_1 at which it begins", -0.002, -100.0, 100.0, side=USER),
        Parameter("end_rad", "user position θ_2 at which it ends", 0.002, -100.0, 100.0, side=USER),
    ),
    severities=(0.3, 0.6, 1.2),
    placed={"begin_rad": (0.0, 0.2, 0.4, 0.6, 0.0), "end_rad": (0.4, 0.6, 0.8, 1.0, 1.0)},
    places=(moving_friction,),
    shows="in the current by direction, over a part of the user's travel",
    against="user_position",
    mistaken_for="hinge moment, load-dependent friction",
    family="mechanics",
    by_direction=True,
)
