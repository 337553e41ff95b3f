"""A filter of the speed that the drive controls."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def speed_reading(speed, begins, dt, time_constant, filtered):
    """T dω_f/dt = ω − ω_f; implicit, so that T may be 0.  It begins settled."""
    before = speed if begins else filtered
    after = speed + (before - speed) * (time_constant / (time_constant + dt))
    return after, after


EFFECT = Effect(
    title="Speed filter",
    equation="T dω_f/dt = ω − ω_f, the speed loop controls ω_f",
    source="Ellis, Control System Design Guide, 4th ed., 2012: filters of encoder speed",
    explanation=(
        "A drive finds the speed from differences of its encoder's readings, which come in steps, and smooths them by "
        "a low-pass filter of first order: 0.1 to 5 ms, corner frequencies of 1.6 kHz down to 30 Hz. The speed loop "
        "acts on a speed of a moment ago, so that it swings where the command changes fast. The filter is the "
        "drive's own: the recorded speed need not have passed it."
    ),
    parameters=(Parameter("time_constant_s", "time constant T", 2e-4, 0.0, 0.05),),
    severities=(1e-4, 2e-4, 4e-4),
    places=(speed_reading,),
    shows="as oscillation of speed and current where the command changes fast",
    mistaken_for="torsional compliance, inertia error, position sensor delay, the drive's other delays",
    family="drive",
    states=("filtered_rad_s",),
)
