"""The time that a drive computes before what it has found takes effect."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar

_KEPT = 3.0  # intervals of the line of kept values


@scalar
def drive_output(output, begins, dt, delay, clock, before, first, second, third, fourth):
    """u(t − T), of u at four times a third of T apart, and linear between the last two of them.

    Below three steps the line is three steps long, and its end counts by T's share of that.
    """
    spacing = delay * (1.0 / _KEPT)
    spacing = spacing if spacing > dt else dt
    since = clock + dt
    kept = begins | (since >= spacing)
    late = 0.0 if begins else since - spacing  # since the line had to be moved on
    now = output if begins else output + (before - output) * (late * (1.0 / dt))
    a = now if kept else first
    b = (now if begins else first) if kept else second
    c = (now if begins else second) if kept else third
    d = (now if begins else third) if kept else fourth
    age = late if kept else since
    shifted = c + (d - c) * (1.0 - age / spacing)
    share = clamp(delay * (1.0 / (_KEPT * dt)), 0.0, 1.0)
    return output + share * (shifted - output), age, output, a, b, c, d


EFFECT = Effect(
    title="Computation delay",
    equation="I_ref(t) → I_ref(t − T)",
    source="Franklin, Powell, Workman, Digital Control of Dynamic Systems, 3rd ed., 1998",
    explanation=(
        "A digital drive reads its sensors, computes, and puts the result out one sample later, or two: 0.1 to 2 ms "
        "in all, at drives of 1 to 20 kHz, and more where a position loop runs over a bus. What the motor does is an "
        "answer to what was true a moment ago, so that the loop swings as with less damping. Nothing is late in "
        "a steady motion."
    ),
    parameters=(Parameter("delay_s", "delay T", 1e-4, 0.0, 0.02),),
    severities=(5e-5, 1e-4, 2e-4),
    places=(drive_output,),
    shows="as oscillation of speed and current where the command changes fast",
    mistaken_for="position sensor delay, torsional compliance, inertia error, the drive's other delays",
    family="drive",
    states=("clock_s", "before", "first", "second", "third", "fourth"),
)
