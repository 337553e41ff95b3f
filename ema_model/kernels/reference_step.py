"""One step of the Reference Model (MODEL: T 3.2), for one lane: three phases, a relay per leg, floating star.

Its state is a tuple, so that one run alone keeps it in registers; a population keeps it in rows of its own.
"""

from __future__ import annotations

from ema_model.physics.elementary import clamp, rotate
from ema_model.physics.equations import (
    advance_play,
    advance_rotor,
    air_gap,
    borello_friction,
    equivalent_current,
    minus_120,
    plus_120,
    relay,
    winding_coefficients,
)
from ema_model.physics.jit import scalar
from ema_model.physics.rows import (
    BUS_VOLTAGE,
    COS_ELECTRICAL,
    COS_ROTOR,
    CURRENT_A,
    CURRENT_B,
    CURRENT_C,
    DEMAND,
    DYNAMIC_FRICTION,
    ECCENTRICITY,
    ECCENTRICITY_COS,
    ECCENTRICITY_SIN,
    EMF_CONSTANT,
    GEAR_RATIO,
    HALF_PLAY,
    HYSTERESIS,
    INVERSE_INDUCTANCE,
    INVERSE_INERTIA,
    LANES,
    OMEGA,
    PLAY,
    POLE_PAIRS,
    REFERENCE_STATE_ROWS,
    RESISTANCE,
    SIN_ELECTRICAL,
    SIN_ROTOR,
    STATIC_FRICTION,
    STOP_HIGH,
    STOP_LOW,
    THETA,
    TIME,
    TORQUE_CONSTANT,
    TORQUE_LIMIT,
    TURNS_A,
    TURNS_B,
    TURNS_C,
    VISCOUS,
    VOLTAGE_RATIO,
)

from .composition import (
    advance_states,
    back_emf,
    bus_voltage,
    electric_torque,
    friction,
    inverse_inertia,
    motor_speed_reading,
    moving_friction,
    position_reading,
    shaft_torque,
    user_position,
    winding_resistance,
)
from .drive_step import advance_drive, plain_demand

STATE = 14  # numbers in the state
CONSTANT = 5
FIRST = len(REFERENCE_STATE_ROWS)  # row of the effects' own states


@scalar
def constants(s, p, i):
    """What stays as it is over a run of lane i: the inertia, the windings' inductances (L_i = N_i² L)."""
    inverse = p[INVERSE_INDUCTANCE * LANES + i]
    turns_a, turns_b, turns_c = p[TURNS_A * LANES + i], p[TURNS_B * LANES + i], p[TURNS_C * LANES + i]
    inverse_a = inverse / (turns_a * turns_a)
    inverse_b = inverse / (turns_b * turns_b)
    inverse_c = inverse / (turns_c * turns_c)
    return (
        inverse_inertia(p[INVERSE_INERTIA * LANES + i], s, FIRST, p, i),
        1.0 / (inverse_a + inverse_b + inverse_c),
        inverse_a,
        inverse_b,
        inverse_c,
    )


@scalar
def advance_demand(theta, play, omega, s, p, i, demand, dt):
    """What the drive of lane i asks for, in full, for the step that `advance` is about to take."""
    tau = p[GEAR_RATIO * LANES + i]
    told = position_reading(user_position(tau * play, theta, tau, s, FIRST, p, i), s, FIRST, p, i)
    read = motor_speed_reading(omega, theta, s, FIRST, p, i)
    s[DEMAND * LANES + i] = advance_drive(s, FIRST, p, i, demand, told, read, 1.0, dt)


@scalar
def advance(state, constant, s, p, i, demand, load, driven, dt):
    """Advances lane i by dt, s, under a command, rad, and a load, N·m: its new state, and its motor torque, N·m.

    state: (theta, omega, play, sin_rotor, cos_rotor, sin_electrical, cos_electrical, three currents, three legs, the
    equivalent current); s: of which the drive's and the effects' rows are renewed.
    """
    theta, omega, play, sin_r, cos_r, sin_e, cos_e, current_a, current_b, current_c, leg_a, leg_b, leg_c, q = state
    inertia, star, inverse_a, inverse_b, inverse_c = constant
    tau = p[GEAR_RATIO * LANES + i]
    limit = p[TORQUE_LIMIT * LANES + i]
    emf = p[EMF_CONSTANT * LANES + i]
    static = p[STATIC_FRICTION * LANES + i]
    time = s[TIME * LANES + i]
    rigid = tau * play
    user = user_position(rigid, theta, tau, s, FIRST, p, i)
    told = position_reading(user, s, FIRST, p, i)
    plain = plain_demand(p, i, demand, told, motor_speed_reading(omega, theta, s, FIRST, p, i))
    current_ref = s[DEMAND * LANES + i] if driven else plain

    amplitude = -(2.0 / 3.0) * current_ref
    band = p[HYSTERESIS * LANES + i]
    sin_b = minus_120(sin_e, cos_e)[0]
    sin_c = plus_120(sin_e, cos_e)[0]
    leg_a = relay(leg_a, amplitude * sin_e - current_a, band)
    leg_b = relay(leg_b, amplitude * sin_b - current_b, band)
    leg_c = relay(leg_c, amplitude * sin_c - current_c, band)

    gap_a, gap_b, gap_c = air_gap(
        sin_r, cos_r, p[ECCENTRICITY * LANES + i], p[ECCENTRICITY_COS * LANES + i], p[ECCENTRICITY_SIN * LANES + i]
    )
    volts = p[VOLTAGE_RATIO * LANES + i] * bus_voltage(p[BUS_VOLTAGE * LANES + i], q, s, FIRST, p, i)
    turns_a, turns_b, turns_c = p[TURNS_A * LANES + i], p[TURNS_B * LANES + i], p[TURNS_C * LANES + i]
    k_a, k_b, k_c = winding_coefficients(sin_e, cos_e, gap_a, gap_b, gap_c, turns_a, turns_b, turns_c)
    winding = winding_resistance(p[RESISTANCE * LANES + i], time, s, FIRST, p, i)  # R_i = N_i R
    most = volts / winding
    against_a = back_emf(emf * k_a * omega, omega, current_a, 0.0, most, s, FIRST, p, i)
    drive_a = leg_a * volts - winding * turns_a * current_a - against_a
    against_b = back_emf(emf * k_b * omega, omega, current_b, 0.0, most, s, FIRST, p, i)
    drive_b = leg_b * volts - winding * turns_b * current_b - against_b
    against_c = back_emf(emf * k_c * omega, omega, current_c, 0.0, most, s, FIRST, p, i)
    drive_c = leg_c * volts - winding * turns_c * current_c - against_c
    neutral = star * (drive_a * inverse_a + drive_b * inverse_b + drive_c * inverse_c)
    current_a += dt * inverse_a * (drive_a - neutral)
    current_b += dt * inverse_b * (drive_b - neutral)
    current_c += dt * inverse_c * (drive_c - neutral)

    q = equivalent_current(current_a, current_b, current_c, sin_e, cos_e)
    developed = p[TORQUE_CONSTANT * LANES + i] * (k_a * current_a + k_b * current_b + k_c * current_c)
    motor_torque = clamp(electric_torque(developed, theta, omega, q, s, FIRST, p, i), -limit, limit)
    drag = p[VISCOUS * LANES + i] * omega
    passive = motor_torque - tau * load - drag
    active = shaft_torque(passive, theta, omega, q, user, tau, load, time, s, FIRST, p, i)
    level = p[DYNAMIC_FRICTION * LANES + i]
    dynamic = moving_friction(
        level, static, omega, motor_torque, drag, active, load, tau, theta, user, time, s, FIRST, p, i
    )
    dry = borello_friction(omega, active, static, dynamic)
    resisting = friction(dry, omega, active, static, dynamic, s, FIRST, p, i)
    theta1, omega1 = advance_rotor(
        theta,
        omega,
        active - resisting,
        inertia,
        resisting == dry,
        p[STOP_LOW * LANES + i],
        p[STOP_HIGH * LANES + i],
        dt,
    )
    turned = theta1 - theta
    sin_r, cos_r = rotate(sin_r, cos_r, turned)
    sin_e, cos_e = rotate(sin_e, cos_e, p[POLE_PAIRS * LANES + i] * turned)
    play1 = advance_play(play, theta1, p[HALF_PLAY * LANES + i])
    step = tau * (play1 - play)
    s[TIME * LANES + i] = time + dt
    advance_states(dt, theta, omega, rigid, tau * play1, step, tau, load, active, static, dynamic, s, FIRST, p, i)
    return (
        theta1,
        omega1,
        play1,
        sin_r,
        cos_r,
        sin_e,
        cos_e,
        current_a,
        current_b,
        current_c,
        leg_a,
        leg_b,
        leg_c,
        q,
    ), motor_torque


@scalar
def begun(state, i):
    """The state of lane i at the start, as `advance` takes it; the legs are up."""
    return (
        state[THETA * LANES + i],
        state[OMEGA * LANES + i],
        state[PLAY * LANES + i],
        state[SIN_ROTOR * LANES + i],
        state[COS_ROTOR * LANES + i],
        state[SIN_ELECTRICAL * LANES + i],
        state[COS_ELECTRICAL * LANES + i],
        state[CURRENT_A * LANES + i],
        state[CURRENT_B * LANES + i],
        state[CURRENT_C * LANES + i],
        1.0,
        1.0,
        1.0,
        0.0,
    )
