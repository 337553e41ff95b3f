"""A drive that computes at a rate of its own: it sees samples, and holds what it has found until the next."""

from __future__ import annotations

from ema_model.effects.effect import Effect, Parameter
from ema_model.physics.jit import scalar


@scalar
def speed_sample(speed, begins, dt, period, clock, sampled, total, count, held_speed, held_output):
    """The mean speed between the last two samples: the difference of the motor's angle over the period."""
    since = 0.0 if begins else clock + dt
    now = begins | (since >= period - 0.5 * dt)
    sum_ = speed if begins else total + speed
    steps = 1.0 if begins else count + 1.0
    mean = sum_ / steps if now else held_speed
    left = since - (0.0 if begins else period) if now else since
    return mean, left, 1.0 if now else 0.0, 0.0 if now else sum_, 0.0 if now else steps, mean, held_output


@scalar
def drive_output(output, begins, dt, period, clock, sampled, total, count, held_speed, held_output):
    """What was computed at the last sample."""
    held = output if sampled > 0.5 else held_output
    return held, clock, sampled, total, count, held_speed, held


EFFECT = Effect(
    title="Sampled control",
    equation="I_ref(t) = I_ref(nT), ω = (θ(nT) − θ(nT − T))/T for nT ≤ t < (n + 1)T",
    source="Franklin, Powell, Workman, Digital Control of Dynamic Systems, 3rd ed., 1998: zero-order hold",
    explanation=(
        "A digital drive does not control all the time: it reads its sensors at a rate of 1 to 20 kHz, takes the "
        "angle that the encoder has moved on by for the speed, and holds its output until the next sample. On the "
        "average both are half a period late, so that a fast loop swings, and a slow drive lets the current run in "
        "stairs. The rate is 1/T: 0.5 ms are 2 kHz. In the limit of a short period nothing is sampled."
    ),
    parameters=(Parameter("period_s", "sampling period T, 1/rate", 1e-4, 0.0, 0.02),),
    severities=(5e-5, 1e-4, 2e-4),
    places=(speed_sample, drive_output),
    shows="as stairs in the current, and as oscillation where the command changes fast",
    mistaken_for="computation delay, speed filter, inertia error, torsional compliance",
    family="drive",
    states=("clock_s", "sampled", "total", "count", "speed_rad_s", "output"),
)
