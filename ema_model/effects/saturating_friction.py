"""Viscous friction that saturates: what a lubricant that thins as it is sheared drags with."""

from __future__ import annotations

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def moving_friction(level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, ratio, half_speed):
    """T_d [1 + a |ω| / (|ω| + ω_h)]."""
    return level * (1.0 + ratio * abs(omega) / (abs(omega) + half_speed))


EFFECT = Effect(
    title="Saturating viscous friction",
    equation="T_f = sgn ω T_d [1 + a |ω| / (|ω| + ω_h)]",
    source=(
        "Cross, Rheology of non-Newtonian fluids, J. Colloid Science 20, 1965, of m = 1; "
        "Waiboer, Aarts and Jonker, Velocity dependence of joint friction, Multibody Dynamics 2005: robot joints"
    ),
    explanation=(
        "Grease and oil get thinner the faster they are sheared, and so does the film between a strain wave gear's "
        "teeth. Drag then grows less than linearly with speed: steeply at first, as a T_d/ω_h, about as the root of "
        "speed beyond, and toward a T_d at last. A line through it is too low at medium speeds, and too high at rest "
        "and at the top speed: what such a line leaves is what the effect shows."
    ),
    parameters=(
        Parameter("ratio", "share a of dry friction toward which the drag grows", 0.6, 0.0, 20.0),
        Parameter(
            "half_speed_rad_s",
            "speed ω_h at which it is half of that",
            40.0,
            1e-3,
            1e5,
            side=MOTOR,
            linear=(0.02, 1e-6, 100.0),
        ),
    ),
    severities=(0.3, 0.6, 1.2),
    placed={"half_speed_rad_s": (0.03, 0.1, 0.3, 1.0)},
    places=(moving_friction,),
    shows="in the current, with a bent curve of speed, either way",
    against="motor_speed",
    mistaken_for="viscous friction, a zone of friction where the axis goes back and forth",
    family="mechanics",
    terms=("dry_friction",),
    by_direction=True,
)
