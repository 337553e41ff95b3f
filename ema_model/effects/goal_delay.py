"""The time that a command takes to the loop."""

from __future__ import annotations

from ema_model.effects.computation_delay import drive_output as delayed
from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def goal(goal, gear, begins, dt, delay, clock, before, first, second, third, fourth):
    """θ_cmd(t − T), kept as the output of a computation delay is."""
    return delayed(goal, begins, dt, delay, clock, before, first, second, third, fourth)


EFFECT = Effect(
    title="Goal delay",
    equation="θ_goal(t) = θ_cmd(t − T)",
    source="Franklin, Powell, Workman, Digital Control of Dynamic Systems, 3rd ed., 1998: transport delay",
    explanation=(
        "Between a command that is logged and the loop that follows it there is a bus, a buffer, an interpolator: 1 ms "
        "at an industrial bus, 5 to 50 ms at a serial line, a pulse width or a robot's middleware. All of the answer "
        "comes that much later, at rest and in motion alike, but the loop is as stable as without: that tells it from "
        "a delay inside of the loop, which lets it swing. From a late clock of all sensors it is not told at all."
    ),
    parameters=(Parameter("delay_s", "dead time T", 4e-3, 0.0, 0.3),),
    severities=(2e-3, 4e-3, 8e-3),
    places=(goal,),
    shows="in how far the motor trails a moving command, in proportion to its speed, and at the start of each step",
    against="motor_speed",
    mistaken_for="position gain, velocity feedforward, position sensor delay, the sensors' delay",
    family="drive",
    states=("clock_s", "before", "first", "second", "third", "fourth"),
)
