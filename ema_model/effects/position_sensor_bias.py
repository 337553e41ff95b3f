"""An offset of the position sensor: the user stands beside where the controller believes it to be."""

from __future__ import annotations

from ema_model.effects.effect import USER, Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def position_reading(user, bias):
    """θ_user + b."""
    return user + bias


EFFECT = Effect(
    title="Position sensor bias",
    equation="θ_read = θ_user + b",
    source="Isermann, Fault-Diagnosis Applications, Springer 2011: offset faults of sensors",
    explanation=(
        "The sensor was mounted a little askew, or its zero has drifted. The controller moves the user until the "
        "reading is right, so the user, and with it the motor, stands off by the bias, with the opposite sign. "
        "The reading itself looks perfect: only against the motor's angle is the offset seen."
    ),
    parameters=(
        Parameter("bias_rad", "offset b of the reading", 3e-5, -0.1, 0.1, side=USER, linear=(1e-5, -0.1, 0.1)),
    ),
    severities=(1e-5, 3e-5, 1e-4),
    places=(position_reading,),
    shows="in the motor angle against the user position, as a constant offset",
    mistaken_for="backlash",
    family="sensor",
)
