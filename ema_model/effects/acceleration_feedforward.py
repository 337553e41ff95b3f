"""The torque that the command's acceleration takes, added to what the speed loop asks for."""

from __future__ import annotations

from ema_model.effects.effect import MOTOR, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def goal(goal, gear, begins, dt, inertia, time_constant, before, speed, torque, known):
    """The command as it is; of its speed v at the motor, T dv_f/dt = v − v_f, implicit; the torque is J_f dv_f/dt."""
    risen = (goal - before) / (gear * dt)
    smooth = risen if known < 0.5 else speed + (risen - speed) * (dt / (time_constant + dt))
    pull = 0.0 if known < 0.5 else inertia * (smooth - speed) / dt
    return goal, goal, 0.0 if begins else smooth, 0.0 if begins else pull, 0.0 if begins else 1.0


@scalar
def loop_torque(torque, begins, dt, inertia, time_constant, before, speed, pull, known):
    """T + J_f dv_f/dt."""
    return torque + pull, before, speed, pull, known


EFFECT = Effect(
    title="Acceleration feedforward",
    equation="T_ref = … + J_f d²θ_cmd/dt²/τ, smoothed by a first-order lag T",
    source="Ellis, Control System Design Guide, 4th ed., 2012: feed-forward of a position loop",
    explanation=(
        "Motion controllers know ahead of time how fast the command will change its speed, and add the torque that "
        "this takes of the inertia J_f that they were told of, in place of waiting for an error. With the motor's own "
        "inertia the current comes at once where the command accelerates, and the position hardly errs; with less or "
        "more it errs in proportion to the acceleration. The second derivative of a sampled command is rough, so that "
        "it is smoothed by a lag T of some samples."
    ),
    parameters=(
        Parameter(
            "inertia_kgm2", "inertia J_f that is fed forward", 8e-6, 0.0, 10.0, side=MOTOR, linear=(1.0, 0.0, 1e5)
        ),
        Parameter("time_constant_s", "time constant T of its smoothing", 1e-3, 0.0, 0.05),
    ),
    severities=(4e-6, 8e-6, 1.6e-5),
    places=(goal, loop_torque),
    shows="in current and position error where the command accelerates",
    against="acceleration",
    mistaken_for="inertia error, velocity feedforward, current loop lag",
    family="drive",
    states=("goal_rad", "speed_rad_s", "torque_Nm", "known"),
)
