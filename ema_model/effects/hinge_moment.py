"""Hinge moment: the air's, or a spring's, torque on the user, growing with its deflection."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, stiffness, offset):
    """− τ (H θ_user + H_0), added."""
    return torque - gear * (stiffness * user + offset)


EFFECT = Effect(
    title="Hinge moment",
    equation="T = − τ (H θ_user + H_0)",
    source="Roskam, Airplane Flight Dynamics, 2001, ch. 3: hinge moment derivatives",
    explanation=(
        "A control surface in the air stream is pushed back toward its neutral position, the harder the further it "
        "is turned, like a spring. Through the gear the motor feels a torque that follows the user's position, and "
        "the current shows it at rest as well as in motion."
    ),
    parameters=(
        Parameter(
            "stiffness_Nm_rad",
            "stiffness H",
            1000.0,
            -1e6,
            1e6,
            side=USER,
            linear=(1e4, -1e9, 1e9),
            plausible=(0.0, None),  # a spring pulls back
        ),
        Parameter(
            "offset_Nm", "moment H_0 at the neutral position", 0.0, -1e5, 1e5, side=USER, linear=(0.0, -1e6, 1e6)
        ),
    ),
    severities=(500.0, 1000.0, 2000.0),
    places=(shaft_torque,),
    shows="in the current, in proportion to the user position",
    against="user_position",
    mistaken_for="position gain, inertia in a sine",
    family="mechanics",
    is_load=True,
)
