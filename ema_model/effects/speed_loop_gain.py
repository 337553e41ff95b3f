"""A proportional gain of the speed loop that is not what the file says."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def speed_gain(gain, ratio):
    """(1 + g) K_P."""
    return gain * (1.0 + ratio)


EFFECT = Effect(
    title="Speed loop gain",
    equation="K_P → (1 + g) K_P",
    source="Åström and Hägglund, Advanced PID Control, ISA 2006",
    explanation=(
        "Drives are tuned on site, and the list of parameters that came with them is not always the last; some scale "
        "the gain with an inertia or a torque constant of their own. With less gain the motor follows the wanted "
        "speed more softly: the position trails more, and a load pushes it further away, while the current that a "
        "slow motion takes stays the same. A gain that is off by half or threefold is usual. Integral action that "
        "is told as a gain of its own stays as it is."
    ),
    parameters=(Parameter("ratio", "share g that the gain is greater by", 0.3, -0.95, 20.0),),
    severities=(0.15, 0.3, 0.6),
    places=(speed_gain,),
    shows="in how far the motion trails the command, and in the current as the speed changes",
    mistaken_for="current sensor gain, torque constant, position gain, inertia error",
    family="drive",
    duplicates="controller.speed_gain_Nms_rad",
    scale=1.0,
)
