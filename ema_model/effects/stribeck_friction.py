"""Stribeck friction: between sticking and sliding, friction falls with speed instead of dropping at once."""

from __future__ import annotations

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.elementary import decay
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, speed, breakaway):
    """T_d + (T_s − T_d) e^{−(ω/ω_s)²}, of which nothing is left beyond T_d where ω_s = 0.

    T_s is the actuator's static friction, or breakaway · T_d where that is more: few data sheets tell it.
    """
    ratio = omega / speed
    begins = max(static, breakaway * level)
    return level + (begins - level) * (decay(ratio * ratio) if speed > 0.0 else 0.0)


EFFECT = Effect(
    title="Stribeck friction",
    equation="T_f = sgn ω [T_d + (T_s − T_d) exp(−(ω/ω_s)²)]",
    source="Stribeck 1902; Armstrong-Hélouvry et al., Automatica 30(7), 1994",
    explanation=(
        "A lubricated contact at rest touches metal to metal. As it begins to slide, oil is drawn in and carries "
        "more and more of the load, so friction falls from its static to its sliding value over a band of speeds. "
        "The base model lets it fall at once. The difference is felt after each reversal, while the motor is slow. "
        "Where the actuator states no static friction, or one below the ratio's, the ratio says where it begins."
    ),
    parameters=(
        Parameter(
            "speed_rad_s", "speed ω_s over which friction falls", 10.0, 0.1, 200.0, side=MOTOR, linear=(5e-3, 1e-5, 1.0)
        ),
        Parameter("breakaway_ratio", "least ratio of friction at breakaway to that in motion, T_s/T_d", 1.5, 1.0, 4.0),
    ),
    severities=(3.0, 10.0, 25.0),
    at_speeds=(0.01, 0.03, 0.1, 0.3),
    places=(moving_friction,),
    shows="in the current just after reversals and at low speed",
    against="motor_speed",
    mistaken_for="backlash, dry friction",
    family="mechanics",
)
