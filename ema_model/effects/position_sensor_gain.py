"""A gain error of the position sensor: it reads a share too much of every displacement."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def position_reading(user, ratio):
    """θ_user (1 + g)."""
    return user + ratio * user


EFFECT = Effect(
    title="Position sensor gain",
    equation="θ_read = (1 + g) θ_user",
    source="Isermann, Fault-Diagnosis Applications, Springer 2011: gain faults of sensors",
    explanation=(
        "The sensor's scale is off, as after a replacement without calibration or with a reference voltage that has "
        "drifted. The controller moves the user until the reading is right, so the user goes too short or too far in "
        "proportion. The reading itself looks perfect: only the motor's angle tells, as another gear ratio would."
    ),
    parameters=(Parameter("ratio", "share g that it reads too much", 2e-3, -0.3, 0.3),),
    severities=(5e-4, 2e-3, 1e-2),
    places=(position_reading,),
    shows="in the motor angle, in proportion to the user position",
    against="user_position",
    mistaken_for="another gear ratio, position sensor eccentricity",
    family="sensor",
)
