"""A wrong scale of the current's sensor: the reading is off, the motion is not."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def current_reading(current, ratio):
    """(1 + g) q."""
    return current * (1.0 + ratio)


EFFECT = Effect(
    title="Current sensor gain",
    equation="q_read = (1 + g) q",
    source="Chung and Sul, Analysis and compensation of current measurement error in vector-controlled AC motor "
    "drives, IEEE Trans. Ind. Appl. 34(2), 1998",
    explanation=(
        "A shunt's resistance or an amplifier's gain is not what the drive takes it to be, so every reading of the "
        "current is too large by the same share. From the current alone this cannot be told from a motor with less "
        "torque per ampere; a measured voltage, or the top speed, tells them apart."
    ),
    parameters=(Parameter("ratio", "share g that is read too much", 0.06, -0.9, 5.0, plausible=(-0.3, 0.3)),),
    severities=(0.03, 0.06, 0.12),
    places=(current_reading,),
    shows="in the recorded current, in proportion to it, not in the motion",
    against="current",
    mistaken_for="demagnetisation",
    family="sensor",
)
