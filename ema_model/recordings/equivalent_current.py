"""The equivalent current from three phase currents (T 3.14)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.recordings.health.estimates import rotation_order
from ema_model.recordings.measurement import Measurement

PHASES = ("phase_a_current_A", "phase_b_current_A", "phase_c_current_A")

Array = NDArray[np.float64]

_CLEAR = 0.5  # likeness of the currents to a turning field, from which on its angle counts


def equivalent_current(a: Array, b: Array, c: Array, motor_position_rad: Array, pole_pairs: float) -> Array:
    """I_3eq = [−I_A + ½(I_B + I_C)] sin θ_e + (√3/2)(I_B − I_C) cos θ_e, A; θ_e is pole_pairs times the position."""
    angle = pole_pairs * motor_position_rad
    return (0.5 * (b + c) - a) * np.sin(angle) + 0.5 * math.sqrt(3.0) * (b - c) * np.cos(angle)


def can_have_current(measurement: Measurement) -> bool:
    """Whether the equivalent current is missing and can be made."""
    return "current_A" not in measurement and all(name in measurement for name in (*PHASES, "motor_position_rad"))


def with_equivalent_current(measurement: Measurement, pole_pairs: float, rotor_offset_rad: float = 0.0) -> Measurement:
    """The measurement with `current_A` made from its phase currents and motor position; one that has it is kept.

    `rotor_offset_rad` is the rotor's angle where the motor position is zero.  Raises InputError if a phase
    or the position is missing.
    """
    if "current_A" in measurement:
        return measurement
    measurement.require(*PHASES, "motor_position_rad")
    if not (math.isfinite(pole_pairs) and pole_pairs > 0.0):
        raise InputError(f"the pole pairs must be a number above 0, not {pole_pairs:g}")
    angle = measurement["motor_position_rad"] + rotor_offset_rad
    a, b, c = (measurement[name] for name in PHASES)
    current = equivalent_current(a, b, c, angle, pole_pairs)
    note = f"current_A is made from the phase currents with {pole_pairs:g} pole pairs"
    return measurement.with_signals(current_A=current).with_notes(note)


def with_current(measurement: Measurement, pole_pairs: float, rotor_offset_rad: float) -> Measurement:
    """The same where a current can be made, at the rotor offset that the phase currents themselves show.

    They show it up to a multiple of π/pole_pairs; of these the nearest to `rotor_offset_rad` is taken.
    """
    if not can_have_current(measurement):
        return measurement
    phases = np.array([measurement[name] for name in PHASES])
    _, forward, backward, shown = rotation_order(phases, measurement["motor_position_rad"], pole_pairs)
    offset = rotor_offset_rad
    if forward > _CLEAR and forward > 2.0 * backward and math.isfinite(shown):
        step = math.pi / pole_pairs
        offset = shown + step * round((rotor_offset_rad - shown) / step)
    made = with_equivalent_current(measurement, pole_pairs, offset)
    return made.with_notes(f"the rotor's offset is taken as {offset:.4g} rad") if offset != rotor_offset_rad else made
