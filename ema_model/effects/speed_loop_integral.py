"""Integral action of the speed loop, where the file has none, or another."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def integral_gain(gain, speed_gain, rate):
    """K_I + r K_P, not below 0."""
    raised = gain + rate * speed_gain
    least = gain if gain < 0.0 else 0.0
    return least if raised < least else raised


EFFECT = Effect(
    title="Speed loop integral action",
    equation="K_I → max(0, K_I + r K_P), held while the current is at its limit",
    source="Åström and Hägglund, Advanced PID Control, ISA 2006 (conditional integration against wind-up)",
    explanation=(
        "Nearly every drive's speed loop integrates, so that a load does not push the motor away for long: the error "
        "that is left by the proportional gain dies out within the reset time T_n = 1/r, typically 5 to 100 ms. At "
        "the current's limit it is held, against wind-up. A file that leaves it out, or has another reset time, "
        "gives a motor that yields to load and friction and comes back late. What the file says of where it is held, "
        "as the integrator's window, holds here as well."
    ),
    parameters=(Parameter("rate_1_s", "reset rate r = 1/T_n beyond the file's", 100.0, -1000.0, 2000.0),),
    severities=(50.0, 100.0, 200.0),
    places=(integral_gain,),
    shows="in the position at rest and after each change of speed or load, slowly",
    mistaken_for="dry friction, hinge moment, constant load, presliding friction",
    family="drive",
)
