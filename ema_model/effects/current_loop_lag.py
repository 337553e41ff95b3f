"""A current loop of finite bandwidth."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def current_reference(reference, begins, dt, time_constant, current):
    """T dI/dt = I_ref − I; implicit, so that T may be 0.  It begins settled."""
    before = reference if begins else current
    after = reference + (before - reference) * (time_constant / (time_constant + dt))
    return after, after


EFFECT = Effect(
    title="Current loop lag",
    equation="T dI/dt = I_ref − I",
    source="Ellis, Control System Design Guide, 4th ed., 2012: the current loop as a low-pass filter",
    explanation=(
        "The current does not follow its reference at once: a PI current loop of 200 Hz to 2 kHz is a lag of 0.8 ms "
        "down to 0.08 ms, in which the winding's inductance is hidden. The torque comes that much later, and steps "
        "of the current are rounded. The voltage's limit acts besides. A drive that logs the reference in place of "
        "the current shows none of it there."
    ),
    parameters=(Parameter("time_constant_s", "time constant T", 2e-4, 0.0, 0.02),),
    severities=(1e-4, 2e-4, 4e-4),
    places=(current_reference,),
    shows="in the current's edges, and as oscillation where the command changes fast",
    mistaken_for="computation delay, speed filter, inductance, inertia error",
    family="drive",
    states=("current_A",),
)
