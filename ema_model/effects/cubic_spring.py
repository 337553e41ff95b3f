"""Cubic spring: a moment on the user that grows faster than its deflection."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, stiffness):
    """− τ K_3 θ_user³, added."""
    return torque - gear * stiffness * user * user * user


EFFECT = Effect(
    title="Cubic spring",
    equation="T = − τ K_3 θ_user^3",
    source="Nayfeh and Mook, Nonlinear Oscillations, Wiley 1979: Duffing's spring",
    explanation=(
        "Rubber, leaf springs and stops that give become stiffer the further they are bent. Near the neutral position "
        "nothing is felt, and at the ends of the travel the motor has to hold a moment that grows with the cube of the "
        "deflection. A spring in proportion is the hinge moment; both may be there."
    ),
    parameters=(
        Parameter("stiffness_Nm_rad3", "cubic stiffness K_3", 1e6, -1e12, 1e12, side=USER, linear=(1e7, -1e15, 1e15)),
    ),
    severities=(5e5, 1e6, 2e6),
    places=(shaft_torque,),
    shows="in the current, with the cube of the user position",
    against="user_position",
    mistaken_for="hinge moment, one-sided spring",
    terms=("hinge_moment",),
    family="mechanics",
    is_load=True,
)
