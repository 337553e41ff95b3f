"""More inertia than the base model's: a part was changed, or never weighed."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def inverse_inertia(inverse, ratio):
    """1 / [J (1 + ε)]."""
    return inverse / (1.0 + ratio)


EFFECT = Effect(
    title="Inertia error",
    equation="J' = J (1 + ε)",
    source="Swevers et al., Dynamic model identification for industrial robots, IEEE Control Systems 27, 2007",
    explanation=(
        "The torque for an acceleration is in proportion to the inertia of all that turns: rotor, gear, and the "
        "user's share through the gear. Data sheets often name the rotor alone. With more inertia than the model "
        "has, the motor needs more current whenever it speeds up or slows down, and none more at constant speed."
    ),
    parameters=(Parameter("ratio", "share ε more than the model's", 0.2, -0.9, 20.0),),
    severities=(0.15, 0.2, 0.3),
    places=(inverse_inertia,),
    shows="in the current, in proportion to acceleration",
    against="acceleration",
    mistaken_for="position gain, torque constant, torsional compliance",
    family="mechanics",
    duplicates="motor.inertia_kgm2",
    scale=1.0,
)
