"""One step of the drive's controller, shared by both models: what it asks for, from a command and what sensors tell.

`plain_demand` is the cascade or position loop alone.  `advance_drive` is the same with all that it may remember, and
with the stages where effects of the drive act (`ema_model.effects.effect.STAGES`); where none does it gives the same
to the last bit, and is left out (`is_driven`).
"""

from __future__ import annotations

from ema_model.physics.elementary import clamp
from ema_model.physics.equations import advance_speed_loop, speed_reference
from ema_model.physics.jit import scalar
from ema_model.physics.rows import (
    BEGUN,
    CURRENT_PER_TORQUE,
    DERIVATIVE_GAIN,
    GEAR_RATIO,
    INTEGRAL,
    INTEGRAL_GAIN,
    INTEGRATOR_REST,
    INTEGRATOR_WINDOW,
    LANES,
    OUTPUT_LIMIT,
    POSITION_GAIN,
    SPEED_ERROR,
    SPEED_GAIN,
    SPEED_LIMIT,
)

from .composition import (
    control,
    current_reference,
    drive_acts,
    drive_output,
    goal,
    integral_gain,
    loop_torque,
    position_error,
    speed_command,
    speed_gain,
    speed_reading,
    speed_sample,
)


@scalar
def is_driven(p):
    """Whether the drive of any lane does more than its plain loop: an integral or derivative action, or an effect."""
    for i in range(LANES):
        if p[INTEGRAL_GAIN * LANES + i] != 0.0 or p[DERIVATIVE_GAIN * LANES + i] != 0.0 or drive_acts(p, i):
            return True
    return False


@scalar
def plain_demand(p, i, command, told, omega):
    """The reference current, A, or share of the bus voltage of lane i, from a command and a position told, rad."""
    error = command - told
    gain = p[POSITION_GAIN * LANES + i]
    return control(
        command,
        error,
        speed_reference(error, gain, p[SPEED_LIMIT * LANES + i]) - omega,
        0.0,
        gain,
        p[SPEED_GAIN * LANES + i],
        p[CURRENT_PER_TORQUE * LANES + i],
        p[OUTPUT_LIMIT * LANES + i],
    )


@scalar
def advance_drive(s, first, p, i, command, told, omega, supply, dt):
    """The same in full, for a step of dt, s, of which the state s (effects' own from row `first` on) is renewed.

    supply: the bus voltage over its nominal value; switched off, the speed loop's integral forgets.
    """
    begun = s[BEGUN * LANES + i]
    begins = begun <= 0.0
    limit = p[SPEED_LIMIT * LANES + i]
    wished = goal(command, p[GEAR_RATIO * LANES + i], begun == 0.0, dt, s, first, p, i)
    error = position_error(wished - told, begins, dt, s, first, p, i)
    read = speed_sample(speed_reading(omega, begins, dt, s, first, p, i), begins, dt, s, first, p, i)
    position_gain = p[POSITION_GAIN * LANES + i]
    wanted = speed_command(speed_reference(error, position_gain, limit), limit, begins, dt, s, first, p, i)
    speed_error = wanted - read
    gain = speed_gain(p[SPEED_GAIN * LANES + i], s, first, p, i)
    current_per_torque = p[CURRENT_PER_TORQUE * LANES + i]
    most = p[OUTPUT_LIMIT * LANES + i]
    if begins:
        given = s[INTEGRAL * LANES + i]
        if begun < 0.0:  # for the plain loop, as what makes it ask for the torque that is there
            plain = speed_reference(command - told, position_gain, limit) - omega
            given += p[SPEED_GAIN * LANES + i] * plain - gain * speed_error
        s[INTEGRAL * LANES + i] = clamp(given, -most / current_per_torque, most / current_per_torque)
    remembered, integral = advance_speed_loop(
        error,
        speed_error,
        omega,
        s[INTEGRAL * LANES + i],
        s[SPEED_ERROR * LANES + i],
        begins,
        gain,
        integral_gain(p[INTEGRAL_GAIN * LANES + i], gain, s, first, p, i),
        p[DERIVATIVE_GAIN * LANES + i],
        p[INTEGRATOR_WINDOW * LANES + i],
        p[INTEGRATOR_REST * LANES + i],
        current_per_torque,
        most,
        dt,
    )
    beside = loop_torque(remembered, begins, dt, s, first, p, i)
    output = control(wished, error, speed_error, beside, position_gain, gain, current_per_torque, most)
    put_out = drive_output(output, begins, dt, s, first, p, i)
    s[INTEGRAL * LANES + i] = integral if supply > 0.0 else 0.0
    s[SPEED_ERROR * LANES + i] = speed_error
    s[BEGUN * LANES + i] = 1.0
    return current_reference(put_out, begins, dt, s, first, p, i)


@scalar
def follow(s, first, p, i, command, dt):
    """A step of dt, s, before a start in mid-run: the goal that the drive makes of its command goes on, and no more."""
    goal(command, p[GEAR_RATIO * LANES + i], s[BEGUN * LANES + i] == 0.0, dt, s, first, p, i)
    s[BEGUN * LANES + i] = -1.0
