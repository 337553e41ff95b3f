"""Eccentricity of the position sensor: it reads ahead and behind once in each turn of the user."""

from __future__ import annotations

import math

from ema_model.effects.effect import NEITHER, USER, Effect, Parameter
from ema_model.physics.elementary import sine
from ema_model.physics.jit import scalar


@scalar
def position_reading(user, amplitude, phase):
    """θ_user + A sin(θ_user + φ)."""
    return user + amplitude * sine(user + phase)


EFFECT = Effect(
    title="Position sensor eccentricity",
    equation="θ_read = θ_user + A sin(θ_user + φ)",
    source="Hanselman, Resolver signal requirements for high accuracy, IEEE Trans. Ind. Electron. 37(6), 1990",
    explanation=(
        "A magnet or code disc that sits off the axis of the output shaft makes the sensor read ahead over one half of "
        "a turn and behind over the other. The controller follows the reading, so that the user stands off by the "
        "error. Over a short travel only a part of the sine is seen, which looks like an offset and a gain."
    ),
    parameters=(
        Parameter("amplitude_rad", "amplitude A", 3e-4, 0.0, 0.2, side=USER),
        Parameter("phase_rad", "phase φ", 0.0, -math.pi, math.pi, side=NEITHER),
    ),
    severities=(1e-4, 3e-4, 1e-3),
    places=(position_reading,),
    shows="in the motor angle against the user position, once in each turn of the user",
    against="user_position",
    mistaken_for="position sensor gain, position sensor bias",
    family="sensor",
    turns=USER,
)
