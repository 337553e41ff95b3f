"""Presliding friction (LuGre): a contact that sticks is a stiff spring, not a rigid lock."""

from __future__ import annotations

import math

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.elementary import decay
from ema_model.physics.jit import scalar

_STICK_RAD_S = 1.0  # speed over which the level falls from static to dynamic, which the base law lets fall at once


@scalar
def _slip(omega, static, dynamic):
    """|ω| / g(ω), g the friction of a bristle bent as far as it goes."""
    ratio = omega * (1.0 / _STICK_RAD_S)
    return abs(omega) / (dynamic + (static - dynamic) * decay(ratio * ratio))


@scalar
def friction(torque, omega, active, static, dynamic, stiffness, damping, bend):
    """σ_0 z + σ_1 ż in place of the base law's, which bristles of no give have."""
    rate = omega - stiffness * bend * _slip(omega, static, dynamic)
    bristles = stiffness * bend + damping * rate
    return bristles if stiffness < math.inf else torque


@scalar
def advance_states(
    dt, theta, omega, rigid, rigid_next, user_step, gear, load, active, static, dynamic, stiffness, damping, bend
):
    """z after the step, implicit, so that any speed is stable."""
    bent = (bend + dt * omega) / (1.0 + dt * stiffness * _slip(omega, static, dynamic))
    return (bent if stiffness < math.inf else 0.0,)


EFFECT = Effect(
    title="Presliding friction",
    equation="T_f = σ_0 z + σ_1 ż, ż = ω − σ_0 |ω| z / g(ω)",
    source="Canudas de Wit et al., A new model for control of systems with friction, IEEE Trans. Autom. Control, 1995",
    explanation=(
        "Two rough faces touch like two brushes. Before they slide, their bristles bend and push back like a "
        "spring, so a rotor that sticks still gives a little, and after each reversal friction builds up over a "
        "small angle instead of at once. Once the bristles are bent as far as they go they slip, and friction is "
        "that of the base model (g: static at rest, dynamic in motion). A softer spring shows more."
    ),
    parameters=(
        Parameter(
            "stiffness_Nm_rad",
            "bristles' stiffness σ_0 at the motor",
            8.0,
            1.0,
            200.0,
            side=MOTOR,
            linear=(1e6, 1e3, 1e10),
        ),
        Parameter("damping_Nms_rad", "bristles' damping σ_1", 0.01, 0.0, 0.1, side=MOTOR, linear=(1e3, 0.0, 1e7)),
    ),
    severities=(20.0, 8.0, 3.0),
    places=(friction,),
    shows="as hysteresis of the current just after reversals and at rest",
    against="motor_speed",
    mistaken_for="backlash",
    family="mechanics",
    states=("bend_rad",),
    advance_states=advance_states,
    nothing=math.inf,
)
