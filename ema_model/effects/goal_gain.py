"""A goal that is another share of the command than one."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def goal(goal, gear, begins, dt, ratio):
    """(1 + g) θ_cmd."""
    return goal * (1.0 + ratio)


EFFECT = Effect(
    title="Goal gain",
    equation="θ_goal = (1 + g) θ_cmd",
    source="Bolton, Mechatronics, 7th ed., 2019: calibration of a servo's pulse width",
    explanation=(
        "A command reaches a servo as a pulse, a voltage or counts, and what a millisecond or a volt stands for is set "
        "once, by hand. If that scale is off, the actuator goes further or less far than it is told, in proportion to "
        "the command, and is content with it: at rest its loop sees no error, while the log does. Where the position "
        "that is logged is the loop's own, only the ratio of the two scales is known."
    ),
    parameters=(Parameter("ratio", "share g that the goal is greater by", 0.02, -0.9, 5.0),),
    severities=(0.01, 0.02, 0.04),
    places=(goal,),
    shows="in the user position, in proportion to the command, at rest as well",
    against="user_position",
    mistaken_for="position sensor gain, hinge moment, goal rate limit",
    family="drive",
)
