"""Resistance drift: the winding warms up in the course of a recording."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def winding_resistance(resistance, time, rate):
    """R (1 + r t), never below 0."""
    return resistance * max(1.0 + rate * time, 0.0)


EFFECT = Effect(
    title="Resistance drift",
    equation="R = R_0 (1 + r t)",
    source="IEC 60034-1: resistance of copper windings, 0.39 % a kelvin",
    explanation=(
        "Copper's resistance grows by 0.39 % with each kelvin, and a motor that is driven hard warms up by tens of "
        "kelvins within minutes. Where the voltage is at its limit, or is what the drive sets, it yields less and less "
        "current for the same motion. Time is counted from each recording's own start."
    ),
    parameters=(Parameter("rate_1_s", "rate r, share a second", 0.5, -10.0, 10.0),),
    severities=(0.2, 0.5, 1.0),
    places=(winding_resistance,),
    shows="in the top speed, or in the current of a voltage drive, growing with time",
    against="time",
    mistaken_for="bus voltage sag, friction drift",
    family="electrics",
)
