"""Torsional compliance: shaft and mounting twist, and the user's inertia swings on them."""

from __future__ import annotations

import math

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def user_position(user, theta, gear, stiffness, damping, inertia, deflection, speed, twist):
    """The rigid output, deflected."""
    return user + deflection


@scalar
def shaft_torque(
    torque, theta, omega, current, user, gear, load, time, stiffness, damping, inertia, deflection, speed, twist
):
    """The twisted shaft's torque in place of the load, which acts on the user's side of it; a rigid one's as it is."""
    twisted = torque + gear * (load - twist)
    return twisted if stiffness < math.inf else torque


@scalar
def advance_states(
    dt, theta, omega, rigid, rigid_next, user_step, gear, load, active, static, dynamic,
    stiffness, damping, inertia, deflection, speed, twist,
):  # fmt: skip
    """J_u dv/dt = K (θτ − θ_user) + C (ωτ − v) − T_load; implicit in C, speed before angle (symplectic)."""
    moved = rigid_next - rigid
    driven = moved * (1.0 / dt)
    pushed = inertia * speed + dt * (damping * driven - stiffness * deflection - load)
    speed1 = pushed / (inertia + dt * damping)
    deflection1 = deflection + dt * speed1 - moved
    twist1 = damping * (driven - speed1) - stiffness * deflection1
    gives = stiffness < math.inf
    return deflection1 if gives else 0.0, speed1 if gives else 0.0, twist1 if gives else 0.0


EFFECT = Effect(
    title="Torsional compliance",
    equation="J_u dv/dt = K (θ τ − θ_user) + C (ω τ − v) − T_load",
    source="Spong, Modeling and control of elastic joint robots, J. Dyn. Syst. Meas. Control 109(4), 1987",
    explanation=(
        "No shaft is rigid. What the motor turns at one end twists the shaft first, and the user at the other end "
        "follows with its own inertia, like a weight on a spring. Slow motion passes unchanged; near the "
        "spring's own frequency, √(K/J_u)/2π, the user lags, swings, and pulls back at the motor. The controller, "
        "which sees the user, may even excite it: with little damping the loop oscillates. The inertia of the "
        "user comes on top of the base model's, which has it in the motor's alone."
    ),
    parameters=(
        Parameter(
            "stiffness_Nm_rad", "stiffness K at the user", 28400.0, 1e-3, 1e6, side=USER, linear=(1.42e6, 1e3, 1e12)
        ),
        Parameter("damping_Nms_rad", "damping C at the user", 60.0, 0.0, 1e4, side=USER, linear=(3000.0, 0.0, 1e8)),
        Parameter("inertia_kgm2", "inertia J_u of the user", 0.2, 1e-8, 100.0, side=USER, linear=(10.0, 1e-3, 1e5)),
    ),
    severities=(64000.0, 28400.0, 7100.0),  # the mode at 90, 60, 30 Hz
    places=(user_position, shaft_torque),
    shows="in the user position, as a lag near the mode, and in the current",
    against="acceleration",
    mistaken_for="backlash, inertia error",
    family="mechanics",
    states=("deflection_rad", "speed_rad_s", "twist_Nm"),
    advance_states=advance_states,
    nothing=math.inf,
)
