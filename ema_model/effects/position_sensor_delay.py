"""Delay of the position sensor: the controller sees where the user was a moment ago."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def position_reading(user, delay, late):
    """θ_user + d, d the delayed reading less the true position."""
    return user + late


@scalar
def advance_states(dt, theta, omega, rigid, rigid_next, user_step, gear, load, active, static, dynamic, delay, late):
    """T dd/dt = −2 d − 2 T dθ_user/dt: e^{−sT} ≈ (1 − sT/2)/(1 + sT/2) less 1; implicit, so that T may be 0."""
    return ((late - 2.0 * user_step) * delay / (delay + 2.0 * dt),)


EFFECT = Effect(
    title="Position sensor delay",
    equation="θ_read = exp(−s T) θ_user ≈ (1 − s T/2) / (1 + s T/2) θ_user",
    source="Franklin, Powell, Emami-Naeini, Feedback Control of Dynamic Systems: Padé's approximation of a delay",
    explanation=(
        "A sensor that filters, converts and sends its reading over a bus tells the controller where the user was "
        "some time ago. At constant speed the reading trails by speed times delay. The controller acts on old "
        "news: it swings a little more, and the more so the faster the command changes."
    ),
    parameters=(Parameter("delay_s", "delay T", 6e-4, 0.0, 0.02),),
    severities=(3e-4, 6e-4, 1.2e-3),
    places=(position_reading,),
    shows="in the user position against the motor angle, as a lag, and in the current as frequency rises",
    against="motor_speed",
    mistaken_for="inertia error, position gain",
    family="sensor",
    states=("late_rad",),
    advance_states=advance_states,
)
