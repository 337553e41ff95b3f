"""Bus voltage sag: the supply gives less than its nominal voltage, the less the more is drawn."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def bus_voltage(volts, current, drop, resistance):
    """V − V_d − R |I|, not below 0."""
    left = volts - drop - resistance * abs(current)
    return left if left > 0.0 else 0.0 * left  # so that NaN stays NaN


EFFECT = Effect(
    title="Bus voltage sag",
    equation="V = max(0, V_bus − V_d − R |I|)",
    source="MIL-STD-704F, Aircraft Electric Power Characteristics, 2004; Thévenin's source",
    explanation=(
        "Batteries run down, others draw from the same bus, and cables have a resistance: the inverter gets less "
        "than its nominal voltage. While the current controller has voltage left nothing is seen. In a large step "
        "the motor reaches a lower top speed and its current rises later. The current that the cable carries is "
        "taken to be the motor's equivalent current."
    ),
    parameters=(
        Parameter("drop_V", "voltage V_d that is missing at no current", 6.0, 0.0, 100.0),
        Parameter("resistance_Ohm", "resistance R of supply and cables", 0.0, 0.0, 2.0),
    ),
    severities=(3.0, 6.0, 10.0),
    places=(bus_voltage,),
    shows="in the top speed, and in the current near the voltage limit",
    against="motor_speed",
    mistaken_for="winding resistance",
    family="electrics",
)
