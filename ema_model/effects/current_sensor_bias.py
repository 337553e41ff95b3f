"""An offset of the current's sensor: the drive holds what it reads, so that the motor's current is off."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def current_reading(current, bias):
    """q + b."""
    return current + bias


@scalar
def current_reference(reference, begins, dt, bias):
    """The current at which the sensor reads the reference: I_ref − b."""
    return reference - bias


EFFECT = Effect(
    title="Current sensor bias",
    equation="q_read = q + b, the current loop holds q_read = I_ref",
    source="Chung and Sul, Analysis and compensation of current measurement error in vector-controlled AC motor "
    "drives, IEEE Trans. Ind. Appl. 34(2), 1998",
    explanation=(
        "A Hall sensor or an amplifier rarely reads exactly nothing at no current: its zero drifts with "
        "temperature and age. The drive's current loop holds what it reads, so that the motor's current is off by −b "
        "and its torque by −k_t b, as under a constant load: the loop outside answers, and the reading is what a load "
        "would ask for. The two can be told apart only where the current has no loop (a voltage drive, whose motion "
        "does not change) or another sensor. With a controller that is not known, what is recorded is shifted by b. "
        "An offset of the logger alone is the file's [sensors] current_bias_A."
    ),
    parameters=(Parameter("bias_A", "offset b of the reading", 0.2, -10.0, 10.0),),
    severities=(0.1, 0.2, 0.4),
    places=(current_reading, current_reference),
    shows="as a constant load: in the recorded current where a loop integrates, else in the position as well",
    against="current",
    mistaken_for="constant load, asymmetric friction",
    family="sensor",
)
