"""An offset of the current's sensor: the reading is off, the motion is not."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def current_reading(current, bias):
    """q + b."""
    return current + bias


EFFECT = Effect(
    title="Current sensor bias",
    equation="q_read = q + b",
    source="Chung and Sul, Analysis and compensation of current measurement error in vector-controlled AC motor "
    "drives, IEEE Trans. Ind. Appl. 34(2), 1998",
    explanation=(
        "A Hall sensor or an amplifier rarely reads exactly nothing at no current: its zero drifts with "
        "temperature and age. All that is recorded is shifted by the same amount, in motion and at rest, while the "
        "actuator moves as before."
    ),
    parameters=(Parameter("bias_A", "offset b of the reading", 0.2, -10.0, 10.0),),
    severities=(0.1, 0.2, 0.4),
    places=(current_reading,),
    shows="as a constant offset of the recorded current, not in the motion",
    mistaken_for="asymmetric friction, constant load",
)
