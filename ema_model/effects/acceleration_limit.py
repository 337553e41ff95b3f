"""A limit of the acceleration that the drive lets its speed loop ask for."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def speed_command(wanted, limit, begins, dt, ramp, before):
    """ω_ref, which changes by ω_max dt/T_r at most.  It begins where it is wanted."""
    most = limit * dt / ramp
    after = wanted if begins else clamp(wanted, before - most, before + most)
    return after, after


EFFECT = Effect(
    title="Acceleration limit",
    equation="|dω_ref/dt| ≤ ω_max/T_r",
    source="Ellis, Control System Design Guide, 4th ed., 2012; drives' ramp-up time, from rest to the speed limit",
    explanation=(
        "To spare the mechanics a drive lets the wanted speed change no faster than by a ramp, told as an "
        "acceleration or as the time T_r in which it may rise from rest to its limit ω_max: 10 ms to some seconds. "
        "Below that acceleration nothing is seen; a step of the command, or a fast sine, is followed in straight "
        "ramps of speed with a current that the inertia alone asks for, and the position overshoots."
    ),
    parameters=(Parameter("ramp_s", "ramp time T_r from rest to the speed limit", 0.02, 0.0, 10.0),),
    severities=(0.01, 0.02, 0.04),
    places=(speed_command,),
    shows="in steps and fast sines: straight ramps of speed, flat tops of current",
    mistaken_for="inertia error, current limit, torque limit",
    family="drive",
    states=("reference_rad_s",),
)
