"""Dead time: the pause between the two switches of an inverter's leg costs voltage, against the current."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar

_LEAST_A = 1e-12  # of the zone, where there is no supply
_ZERO = 0.01  # of the current at standstill, below which the pause costs less: it ripples through zero there


@scalar
def back_emf(emf, omega, current, gain, most, voltage):
    """+ V_dt sgn I, of the current that flows with it: within the zone it yields as a resistance does."""
    zone = _ZERO * most + gain * voltage
    return emf + voltage * clamp(current / (zone + _LEAST_A), -1.0, 1.0)


EFFECT = Effect(
    title="Dead time",
    equation="L dI/dt = V − R I − E − V_dt sgn I",
    source="Jeong and Park, The analysis and compensation of dead-time effects in PWM inverters, IEEE Trans. Ind. "
    "Electron. 38(2), 1991",
    explanation=(
        "The two switches of a leg must never conduct at once, so the inverter waits a microsecond or two between "
        "them. In the pause the current flows on through a diode, always against the voltage that was wanted. The "
        "loss depends on the current's direction only, and shows when the voltage is at its limit. The voltage "
        "is that of the winding which it acts on: in the Reference Model a phase, in the Monitor Model the "
        "equivalent winding, where the phases' square waves of V_dt add up to √2 (4/π) V_dt = 1.8 V_dt."
    ),
    parameters=(Parameter("voltage_V", "voltage V_dt lost in the winding", 1.0, 0.0, 10.0),),
    severities=(0.5, 1.0, 2.0),
    places=(back_emf,),
    shows="in the current and the speed in saturating steps",
    against="current",
    mistaken_for="winding resistance, bus voltage sag",
    family="electrics",
)
