"""The Reference Model's outer kernels: one run, with all that it shows, or several at once, of those that are compared.

Both advance by the same step, and give the same to the last bit: several runs in lanes take hardly longer than one.
"""

from __future__ import annotations

import numpy as np

from ema_model.physics.jit import kernel, scalar
from ema_model.physics.rows import BUS_VOLTAGE, GEAR_RATIO, LANES, VOLTAGE_RATIO

from .composition import current_reading, motor_angle_reading, motor_speed_reading, position_reading, user_position
from .drive_step import follow, is_driven
from .reference_step import CONSTANT, FIRST, STATE, advance, advance_demand, begun, constants

RUNS = 16  # at once: 8 do not vectorise, 32 take twice as long


@scalar
def follow_all(s, p, lanes, before, then, substeps, dt):
    """The drives of some lanes follow the commands before the start, linear between them and up to the one `then`."""
    for interval in range(len(before)):
        demand = before[interval]
        after = before[interval + 1] if interval + 1 < len(before) else then
        demand_step = (after - demand) / substeps
        for _ in range(substeps):
            for i in range(lanes):
                follow(s, FIRST, p, i, demand, dt)
            demand += demand_step


@kernel
def run(state, p, before, command, load, period, substeps, dt, result):
    """One run of the Reference Model from a state (rows of `REFERENCE_STATE_ROWS`, lane 0).

    command, load: a value per `substeps` steps of dt, linear between them (one more value than there are
    intervals); period: intervals per sample.
    before: commands that came before the start, likewise, which the drive has followed.
    result: (samples, 11), written here: equivalent current (mean over the sample's period), motor speed,
    motor angle, user position (at its end), phase currents, motor torque and leg voltages (means).
    """
    s = state.copy()
    x = begun(s, 0)
    constant = constants(s, p, 0)
    driven = is_driven(p)
    if driven:
        follow_all(s, p, 1, before, command[0], substeps, dt)
    tau = p[GEAR_RATIO * LANES]
    voltage = p[VOLTAGE_RATIO * LANES] * p[BUS_VOLTAGE * LANES]
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
                if driven:
                    advance_demand(x[0], x[2], x[1], s, p, 0, demand, dt)
                x, motor_torque = advance(x, constant, s, p, 0, demand, user_load, driven, dt)
                mean_q += current_reading(x[13], s, FIRST, p, 0)
                mean_a += x[7]
                mean_b += x[8]
                mean_c += x[9]
                mean_torque += motor_torque
                mean_va += x[10]
                mean_vb += x[11]
                mean_vc += x[12]
                demand += demand_step
                user_load += load_step
        theta, play = x[0], x[2]
        result[sample, 0] = mean_q * scale
        result[sample, 1] = motor_speed_reading(x[1], theta, s, FIRST, p, 0)
        result[sample, 2] = motor_angle_reading(theta, s, FIRST, p, 0)
        result[sample, 3] = position_reading(user_position(tau * play, theta, tau, s, FIRST, p, 0), s, FIRST, p, 0)
        result[sample, 4] = mean_a * scale
        result[sample, 5] = mean_b * scale
        result[sample, 6] = mean_c * scale
        result[sample, 7] = mean_torque * scale
        result[sample, 8] = mean_va * voltage * scale
        result[sample, 9] = mean_vb * voltage * scale
        result[sample, 10] = mean_vc * voltage * scale


@kernel
def runs(state, p, before, command, load, period, substeps, dt, result):
    """RUNS runs under one command, each under a constant load: what of `run` is compared, (samples, 4, RUNS).

    state, p: rows of LANES, of which the first RUNS are simulated; before, command: as of `run`; load: (RUNS,).
    result: written here: equivalent current, motor speed, motor angle, user position.
    """
    s = state.copy()
    driven = is_driven(p)
    if driven:
        follow_all(s, p, RUNS, before, command[0], substeps, dt)
    kept = np.empty(CONSTANT * RUNS)
    x = np.empty(STATE * RUNS)
    mean = np.empty(RUNS)
    for i in range(RUNS):
        given = constants(s, p, i)
        for j in range(CONSTANT):
            kept[j * RUNS + i] = given[j]
        first = begun(s, i)
        for j in range(STATE):
            x[j * RUNS + i] = first[j]
    scale = 1.0 / (period * substeps)
    interval = 0
    for sample in range(result.shape[0]):
        mean[:] = 0.0
        for _ in range(period):
            demand = command[interval]
            demand_step = (command[interval + 1] - demand) / substeps
            interval += 1
            for _ in range(substeps):
                if driven:
                    for i in range(RUNS):
                        advance_demand(x[i], x[2 * RUNS + i], x[RUNS + i], s, p, i, demand, dt)
                for i in range(RUNS):
                    new = advance(
                        (
                            x[0 * RUNS + i],
                            x[1 * RUNS + i],
                            x[2 * RUNS + i],
                            x[3 * RUNS + i],
                            x[4 * RUNS + i],
                            x[5 * RUNS + i],
                            x[6 * RUNS + i],
                            x[7 * RUNS + i],
                            x[8 * RUNS + i],
                            x[9 * RUNS + i],
                            x[10 * RUNS + i],
                            x[11 * RUNS + i],
                            x[12 * RUNS + i],
                            x[13 * RUNS + i],
                        ),
                        (
                            kept[0 * RUNS + i],
                            kept[1 * RUNS + i],
                            kept[2 * RUNS + i],
                            kept[3 * RUNS + i],
                            kept[4 * RUNS + i],
                        ),
                        s,
                        p,
                        i,
                        demand,
                        load[i],
                        driven,
                        dt,
                    )[0]
                    x[0 * RUNS + i] = new[0]
                    x[1 * RUNS + i] = new[1]
                    x[2 * RUNS + i] = new[2]
                    x[3 * RUNS + i] = new[3]
                    x[4 * RUNS + i] = new[4]
                    x[5 * RUNS + i] = new[5]
                    x[6 * RUNS + i] = new[6]
                    x[7 * RUNS + i] = new[7]
                    x[8 * RUNS + i] = new[8]
                    x[9 * RUNS + i] = new[9]
                    x[10 * RUNS + i] = new[10]
                    x[11 * RUNS + i] = new[11]
                    x[12 * RUNS + i] = new[12]
                    x[13 * RUNS + i] = new[13]
                    mean[i] += current_reading(new[13], s, FIRST, p, i)
                demand += demand_step
        for i in range(RUNS):
            theta, play, tau = x[i], x[2 * RUNS + i], p[GEAR_RATIO * LANES + i]
            user = user_position(tau * play, theta, tau, s, FIRST, p, i)
            result[sample, 0, i] = mean[i] * scale
            result[sample, 1, i] = motor_speed_reading(x[RUNS + i], theta, s, FIRST, p, i)
            result[sample, 2, i] = motor_angle_reading(theta, s, FIRST, p, i)
            result[sample, 3, i] = position_reading(user, s, FIRST, p, i)
