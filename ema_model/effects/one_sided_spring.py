"""One-sided spring: beyond a place of the travel the user is pushed back, as by a stop that gives."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.elementary import sign
from ema_model.physics.jit import scalar


@scalar
def shaft_torque(torque, theta, omega, current, user, gear, load, time, stiffness, contact):
    """− τ K s max(0, s θ_user − |θ_c|), s = sgn θ_c, added."""
    side = sign(contact)
    return torque - gear * stiffness * side * max(side * user - abs(contact), 0.0)


EFFECT = Effect(
    title="One-sided spring",
    equation="T = − τ K sgn θ_c max(0, |θ_user| − |θ_c|) on the side of θ_c",
    source="Brogliato, Nonsmooth Mechanics, Springer 2016: compliant unilateral contact",
    explanation=(
        "A stop that gives, a cable that comes taut, a spring that is touched on one side only: up to a place of the "
        "travel nothing happens, and beyond it the user is pushed back in proportion. The model fails on one side of "
        "the travel and is right on the other."
    ),
    parameters=(
        Parameter("stiffness_Nm_rad", "stiffness K", 3000.0, 0.0, 1e7, side=USER, linear=(3e4, 0.0, 1e10)),
        Parameter("contact_rad", "user position θ_c of the contact", 0.002, -100.0, 100.0, side=USER),
    ),
    severities=(1000.0, 3000.0, 10000.0),
    placed={"contact_rad": (0.15, 0.3, 0.45, 0.55, 0.7, 0.85)},
    places=(shaft_torque,),
    shows="in the current, beyond one user position",
    against="user_position",
    mistaken_for="hinge moment, cubic spring",
    family="mechanics",
    is_load=True,
)
