"""A winding's resistance beyond the nominal one: warm copper, bad joints."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def winding_resistance(resistance, time, ratio):
    """R (1 + r)."""
    return resistance * (1.0 + ratio)


EFFECT = Effect(
    title="Winding resistance",
    equation="R' = R (1 + r)",
    source="Pyrhönen, Jokinen, Hrabovcová, Design of Rotating Electrical Machines, Wiley 2008, ch. 5",
    explanation=(
        "Copper's resistance rises by 0.39 % for each kelvin, so a winding 50 K warmer has a fifth more, and a "
        "corroded joint adds its own. The current controller makes up for it with more voltage as long as it has "
        "some left: only when the voltage is at its limit, in large and fast steps, does the current fall short."
    ),
    parameters=(Parameter("ratio", "share r more than nominal", 0.3, 0.0, 10.0),),
    severities=(0.2, 0.3, 0.5),
    places=(winding_resistance,),
    shows="in the current and the speed near the voltage limit",
    against="motor_speed",
    mistaken_for="bus voltage sag, dead time",
    family="electrics",
    duplicates="motor.resistance_Ohm",
    scale=1.0,
)
