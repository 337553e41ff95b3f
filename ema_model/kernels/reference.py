"""The Reference Model's kernel: three phases, one hysteresis relay per leg, floating star (T 3.2)."""

from __future__ import annotations

from ema_model.physics.backlash import advance_play
from ema_model.physics.elementary import clamp, rotate
from ema_model.physics.friction import advance_rotor, borello_friction
from ema_model.physics.inverter import relay
from ema_model.physics.jit import kernel
from ema_model.physics.phases import (
    air_gap,
    equivalent_current,
    minus_120,
    plus_120,
    winding_coefficients,
)
from ema_model.physics.rows import (
    BUS_VOLTAGE,
    COS_ELECTRICAL,
    COS_ROTOR,
    CURRENT_A,
    CURRENT_B,
    CURRENT_C,
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
    current_reading,
    electric_torque,
    friction,
    inverse_inertia,
    moving_friction,
    position_reading,
    shaft_torque,
    user_position,
    winding_resistance,
)
from .drive_step import advance_drive, is_driven, plain_demand

FIRST = len(REFERENCE_STATE_ROWS)  # row of the effects' own states


@kernel
def run(state, p, command, load, period, substeps, dt, result):
    """One run of the Reference Model from a state (rows of `REFERENCE_STATE_ROWS`, lane 0).

    command, load: a value per `substeps` steps of dt, linear between them (one more value than there are
    intervals); period: intervals per sample.
    result: (samples, 11), written here: equivalent current (mean over the sample's period), motor speed,
    motor angle, user position (at its end), phase currents, motor torque and leg voltages (means).
    """
    theta = state[THETA * LANES]
    omega = state[OMEGA * LANES]
    play = state[PLAY * LANES]
    sin_r = state[SIN_ROTOR * LANES]
    cos_r = state[COS_ROTOR * LANES]
    sin_e = state[SIN_ELECTRICAL * LANES]
    cos_e = state[COS_ELECTRICAL * LANES]
    current_a = state[CURRENT_A * LANES]
    current_b = state[CURRENT_B * LANES]
    current_c = state[CURRENT_C * LANES]
    leg_a, leg_b, leg_c = 1.0, 1.0, 1.0
    driven = is_driven(p)

    tau = p[GEAR_RATIO * LANES]
    torque_limit = p[TORQUE_LIMIT * LANES]
    s = state.copy()
    bus = p[BUS_VOLTAGE * LANES]
    ratio = p[VOLTAGE_RATIO * LANES]
    voltage = ratio * bus
    inertia = inverse_inertia(p[INVERSE_INERTIA * LANES], s, FIRST, p, 0)
    winding = winding_resistance(p[RESISTANCE * LANES], s, FIRST, p, 0)
    q = 0.0
    band = p[HYSTERESIS * LANES]
    emf = p[EMF_CONSTANT * LANES]
    turns_a, turns_b, turns_c = p[TURNS_A * LANES], p[TURNS_B * LANES], p[TURNS_C * LANES]
    # turns physics: R_i = N_i R, L_i = N_i² L
    inverse_a = p[INVERSE_INDUCTANCE * LANES] / (turns_a * turns_a)
    inverse_b = p[INVERSE_INDUCTANCE * LANES] / (turns_b * turns_b)
    inverse_c = p[INVERSE_INDUCTANCE * LANES] / (turns_c * turns_c)
    star = 1.0 / (inverse_a + inverse_b + inverse_c)
    resistance_a = winding * turns_a
    resistance_b = winding * turns_b
    resistance_c = winding * turns_c
    eccentricity = p[ECCENTRICITY * LANES]
    cos_phase, sin_phase = p[ECCENTRICITY_COS * LANES], p[ECCENTRICITY_SIN * LANES]
    static = p[STATIC_FRICTION * LANES]
    scale = 1.0 / (period * substeps)
    interval = 0

    for sample in range(result.shape[0]):
        mean_q, mean_a, mean_b, mean_c, mean_torque = 0.0, 0.0, 0.0, 0.0, 0.0
        mean_va, mean_vb, mean_vc = 0.0, 0.0, 0.0
        for _ in range(period):
            demand = command[interval]
            demand_step = (command[interval + 1] - demand) / substeps
            user_load = load[interval]
            load_step = (load[interval + 1] - user_load) / substeps
            interval += 1
            for _ in range(substeps):
                rigid = tau * play
                user = user_position(rigid, theta, tau, s, FIRST, p, 0)
                told = position_reading(user, s, FIRST, p, 0)
                if driven:
                    current_ref = advance_drive(s, FIRST, p, 0, demand, told, omega, 1.0, dt)
                else:
                    current_ref = plain_demand(p, 0, demand, told, omega)

                amplitude = -(2.0 / 3.0) * current_ref
                sin_b = minus_120(sin_e, cos_e)[0]
                sin_c = plus_120(sin_e, cos_e)[0]
                leg_a = relay(leg_a, amplitude * sin_e - current_a, band)
                leg_b = relay(leg_b, amplitude * sin_b - current_b, band)
                leg_c = relay(leg_c, amplitude * sin_c - current_c, band)

                gap_a, gap_b, gap_c = air_gap(sin_r, cos_r, eccentricity, cos_phase, sin_phase)
                volts = ratio * bus_voltage(bus, q, s, FIRST, p, 0)
                k_a, k_b, k_c = winding_coefficients(sin_e, cos_e, gap_a, gap_b, gap_c, turns_a, turns_b, turns_c)
                against_a = back_emf(emf * k_a * omega, omega, current_a, s, FIRST, p, 0)
                drive_a = leg_a * volts - resistance_a * current_a - against_a
                against_b = back_emf(emf * k_b * omega, omega, current_b, s, FIRST, p, 0)
                drive_b = leg_b * volts - resistance_b * current_b - against_b
                against_c = back_emf(emf * k_c * omega, omega, current_c, s, FIRST, p, 0)
                drive_c = leg_c * volts - resistance_c * current_c - against_c
                neutral = star * (drive_a * inverse_a + drive_b * inverse_b + drive_c * inverse_c)
                current_a += dt * inverse_a * (drive_a - neutral)
                current_b += dt * inverse_b * (drive_b - neutral)
                current_c += dt * inverse_c * (drive_c - neutral)

                q = equivalent_current(current_a, current_b, current_c, sin_e, cos_e)
                developed = p[TORQUE_CONSTANT * LANES] * (k_a * current_a + k_b * current_b + k_c * current_c)
                motor_torque = clamp(
                    electric_torque(developed, theta, omega, q, s, FIRST, p, 0), -torque_limit, torque_limit
                )
                active = shaft_torque(
                    motor_torque - tau * user_load - p[VISCOUS * LANES] * omega,
                    theta,
                    omega,
                    q,
                    user,
                    tau,
                    user_load,
                    s,
                    FIRST,
                    p,
                    0,
                )
                dynamic = moving_friction(
                    p[DYNAMIC_FRICTION * LANES], static, omega, motor_torque, user_load, tau, s, FIRST, p, 0
                )
                resisting = friction(
                    borello_friction(omega, active, static, dynamic), omega, active, static, dynamic, s, FIRST, p, 0
                )
                theta1, omega1 = advance_rotor(
                    theta,
                    omega,
                    active - resisting,
                    inertia,
                    p[STOP_LOW * LANES],
                    p[STOP_HIGH * LANES],
                    dt,
                )
                turned = theta1 - theta
                sin_r, cos_r = rotate(sin_r, cos_r, turned)
                sin_e, cos_e = rotate(sin_e, cos_e, p[POLE_PAIRS * LANES] * turned)
                play1 = advance_play(play, theta1, p[HALF_PLAY * LANES])
                advance_states(
                    dt,
                    theta,
                    omega,
                    rigid,
                    tau * play1,
                    tau * (play1 - play),
                    tau,
                    user_load,
                    active,
                    static,
                    dynamic,
                    s,
                    FIRST,
                    p,
                    0,
                )
                theta, omega, play = theta1, omega1, play1

                mean_q += current_reading(q, s, FIRST, p, 0)
                mean_a += current_a
                mean_b += current_b
                mean_c += current_c
                mean_torque += motor_torque
                mean_va += leg_a
                mean_vb += leg_b
                mean_vc += leg_c
                demand += demand_step
                user_load += load_step
        result[sample, 0] = mean_q * scale
        result[sample, 1] = omega
        result[sample, 2] = theta
        result[sample, 3] = position_reading(user_position(tau * play, theta, tau, s, FIRST, p, 0), s, FIRST, p, 0)
        result[sample, 4] = mean_a * scale
        result[sample, 5] = mean_b * scale
        result[sample, 6] = mean_c * scale
        result[sample, 7] = mean_torque * scale
        result[sample, 8] = mean_va * voltage * scale
        result[sample, 9] = mean_vb * voltage * scale
        result[sample, 10] = mean_vc * voltage * scale
