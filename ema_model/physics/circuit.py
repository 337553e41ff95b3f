"""The Monitor Model's two circuits: L dI/dt = V − R I − E."""

from __future__ import annotations

from ema_model.numba_options import scalar
from ema_model.physics.elementary import clamp, sign


@scalar
def thesis_circuit(current, reference, emf, voltage, resistance, inverse_inductance, dt):
    """The thesis's: the full voltage by the sign of I_ref − I (T 3.3.3), which chops at every step."""
    v = voltage * sign(reference - current)
    return current + dt * inverse_inductance * (v - resistance * current - emf)


@scalar
def reduced_circuit(current, reference, emf, voltage, resistance, inverse_inductance, dt):
    """The dead-beat voltage, clamped: the reference is met within the step where the voltage suffices."""
    rate = dt * inverse_inductance
    drift = current - rate * (resistance * current + emf)
    return clamp(reference, drift - rate * voltage, drift + rate * voltage)
