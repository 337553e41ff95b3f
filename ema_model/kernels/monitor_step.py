"""One step of the Monitor Model (MODEL: T 3.3), for one lane of a block."""

from __future__ import annotations

from ema_model.physics.elementary import clamp, rotate
from ema_model.physics.equations import advance_play, advance_reversing_rotor, borello_friction, flux_factor
from ema_model.physics.jit import scalar
from ema_model.physics.rows import (
    BUS_VOLTAGE,
    COS_ELECTRICAL,
    COS_ROTOR,
    CURRENT,
    DEMAND,
    DYNAMIC_FRICTION,
    EMF_CONSTANT,
    FLUX_0,
    FLUX_1,
    FLUX_2,
    FLUX_3,
    FLUX_4,
    FLUX_5,
    FLUX_6,
    FLUX_7,
    FLUX_8,
    GEAR_RATIO,
    HALF_PLAY,
    INVERSE_INDUCTANCE,
    INVERSE_INERTIA,
    LANES,
    LEFT,
    OMEGA,
    PLAY,
    POLE_PAIRS,
    RESISTANCE,
    SIN_ELECTRICAL,
    SIN_ROTOR,
    STATE_ROWS,
    STATIC_FRICTION,
    STOP_HIGH,
    STOP_LOW,
    THETA,
    TIME,
    TOLD,
    TORQUE_CONSTANT,
    TORQUE_LIMIT,
    USER,
    VISCOUS,
    VOLTAGE_RATIO,
)

from .composition import (
    advance_current,
    advance_states,
    back_emf,
    bus_voltage,
    current_reading,
    electric_torque,
    friction,
    inverse_inertia,
    motor_angle_reading,
    motor_speed_reading,
    moving_friction,
    position_reading,
    shaft_torque,
    user_position,
    winding_resistance,
)
from .drive_step import advance_drive, plain_demand

FIRST = len(STATE_ROWS)  # row of the effects' own states


@scalar
def sense(s, p, i):
    """Where the user of lane i stands, and what the sensor tells of it, for the step to come."""
    gear = p[GEAR_RATIO * LANES + i]
    user = user_position(gear * s[PLAY * LANES + i], s[THETA * LANES + i], gear, s, FIRST, p, i)
    s[USER * LANES + i] = user
    s[TOLD * LANES + i] = position_reading(user, s, FIRST, p, i)


@scalar
def advance_demand(s, p, i, command, supply, dt):
    """What the drive of lane i asks for, in full, for the step that `advance` is about to take."""
    s[DEMAND * LANES + i] = advance_drive(
        s, FIRST, p, i, command, s[TOLD * LANES + i], shown_speed(s, p, i), supply, dt
    )


@scalar
def advance(s, p, i, command, load, supply, driven, dt):
    """Advances lane i of the state s (rows of `STATE_ROWS`) by dt, s, under a command, rad, and a load, N·m.

    supply: the bus voltage over its nominal value; 0 is a drive switched off, which carries no current.
    driven: whether `advance_demand` has found what the drive asks for.  The state has been sensed (`sense`), and is so
    again at the end.
    """
    theta = s[THETA * LANES + i]
    omega = s[OMEGA * LANES + i]
    play = s[PLAY * LANES + i]
    sin_r = s[SIN_ROTOR * LANES + i]
    cos_r = s[COS_ROTOR * LANES + i]
    sin_2e = s[SIN_ELECTRICAL * LANES + i]
    cos_2e = s[COS_ELECTRICAL * LANES + i]
    before = s[CURRENT * LANES + i]
    gear = p[GEAR_RATIO * LANES + i]
    rigid = gear * play
    user = s[USER * LANES + i]
    time = s[TIME * LANES + i]

    plain = plain_demand(p, i, command, s[TOLD * LANES + i], motor_speed_reading(omega, theta, s, FIRST, p, i))
    demand = s[DEMAND * LANES + i] if driven else plain

    flux = flux_factor(
        sin_r,
        cos_r,
        sin_2e,
        cos_2e,
        (
            p[FLUX_0 * LANES + i],
            p[FLUX_1 * LANES + i],
            p[FLUX_2 * LANES + i],
            p[FLUX_3 * LANES + i],
            p[FLUX_4 * LANES + i],
            p[FLUX_5 * LANES + i],
            p[FLUX_6 * LANES + i],
            p[FLUX_7 * LANES + i],
            p[FLUX_8 * LANES + i],
        ),
    )
    bus = p[BUS_VOLTAGE * LANES + i]
    volts = p[VOLTAGE_RATIO * LANES + i] * bus_voltage(bus * supply, before, s, FIRST, p, i)
    winding = winding_resistance(p[RESISTANCE * LANES + i], time, s, FIRST, p, i)
    inverse = p[INVERSE_INDUCTANCE * LANES + i]
    emf = p[EMF_CONSTANT * LANES + i] * flux * omega
    alone = advance_current(before, demand, emf, volts, winding, inverse, dt)
    gain = dt * inverse / (1.0 + dt * inverse * winding)
    against = back_emf(emf, omega, alone, gain, volts / winding, s, FIRST, p, i)
    driven = advance_current(before, demand, against, volts, winding, inverse, dt)
    current = driven if supply > 0.0 else 0.0
    limit = p[TORQUE_LIMIT * LANES + i]
    developed = p[TORQUE_CONSTANT * LANES + i] * flux * current
    motor_torque = clamp(electric_torque(developed, theta, omega, current, s, FIRST, p, i), -limit, limit)

    drag = p[VISCOUS * LANES + i] * omega
    passive = motor_torque - gear * load - drag
    active = shaft_torque(passive, theta, omega, current, user, gear, load, time, s, FIRST, p, i)
    static = p[STATIC_FRICTION * LANES + i]
    level = p[DYNAMIC_FRICTION * LANES + i]
    dynamic = moving_friction(
        level, static, omega, motor_torque, drag, active, load, gear, theta, user, time, s, FIRST, p, i
    )
    dry = borello_friction(omega, active, static, dynamic)
    resisting = friction(dry, omega, active, static, dynamic, s, FIRST, p, i)
    theta1, omega1, left = advance_reversing_rotor(
        theta,
        omega,
        active - resisting,
        inverse_inertia(p[INVERSE_INERTIA * LANES + i], s, FIRST, p, i),
        resisting == dry,
        p[STOP_LOW * LANES + i],
        p[STOP_HIGH * LANES + i],
        s[LEFT * LANES + i],
        dt,
    )
    turned = theta1 - theta
    sin_r1, cos_r1 = rotate(sin_r, cos_r, turned)
    sin_2e1, cos_2e1 = rotate(sin_2e, cos_2e, 2.0 * p[POLE_PAIRS * LANES + i] * turned)
    play1 = advance_play(play, theta1, p[HALF_PLAY * LANES + i])

    s[THETA * LANES + i] = theta1
    s[OMEGA * LANES + i] = omega1
    s[LEFT * LANES + i] = left
    s[PLAY * LANES + i] = play1
    s[SIN_ROTOR * LANES + i] = sin_r1
    s[COS_ROTOR * LANES + i] = cos_r1
    s[SIN_ELECTRICAL * LANES + i] = sin_2e1
    s[COS_ELECTRICAL * LANES + i] = cos_2e1
    s[CURRENT * LANES + i] = current
    s[TIME * LANES + i] = time + dt
    advance_states(
        dt,
        theta,
        omega,
        rigid,
        gear * play1,
        gear * (play1 - play),
        gear,
        load,
        active,
        static,
        dynamic,
        s,
        FIRST,
        p,
        i,
    )
    sense(s, p, i)


@scalar
def shown_current(s, p, i):
    """The equivalent current as its sensor shows it, A."""
    return current_reading(s[CURRENT * LANES + i], s, FIRST, p, i)


@scalar
def shown_angle(s, p, i):
    """The motor's angle as its encoder shows it, rad."""
    return motor_angle_reading(s[THETA * LANES + i], s, FIRST, p, i)


@scalar
def shown_speed(s, p, i):
    """The motor's speed as its encoder shows it, rad/s."""
    return motor_speed_reading(s[OMEGA * LANES + i], s[THETA * LANES + i], s, FIRST, p, i)
