"""The Monitor Model's outer kernels: the errors, or the signals, of a whole population in lanes.

A single run is a population of one in the same kernel (a block of lanes takes no longer than a plain loop
over one), so that it is bit-identical to any lane.
"""

from __future__ import annotations

import numba
import numpy as np

from ema_model.physics.jit import kernel, parallel_kernel
from ema_model.physics.rows import LANES, TOLD

from .drive_step import follow, is_driven
from .monitor_step import FIRST, advance, advance_demand, sense, shown_angle, shown_current, shown_speed


@parallel_kernel
def squared_errors(
    states, parameters, command, load, supply, first_step, target, weight, first_sample, period, dt, result
):
    """Sum of weighted squared errors of the equivalent current against the targets, A².

    states: (runs, blocks, STATE_ROWS·LANES) initial states; parameters: (blocks, rows·LANES);
    command, load, supply: the runs one after another, a value per step, run r from first_step[r];
    target, weight: likewise a value per sample of `period` steps, run r from first_sample[r] to
    first_sample[r + 1]; result: (runs, blocks, LANES), written here.
    A sample is the mean of the current over its period.
    """
    runs, blocks = states.shape[0], states.shape[1]
    for job in numba.prange(runs * blocks):
        run = job // blocks
        block = job % blocks
        s = states[run, block].copy()
        p = parameters[block]
        driven = is_driven(p)
        for i in range(LANES):
            sense(s, p, i)
        total = np.zeros(LANES)
        mean = np.empty(LANES)
        scale = 1.0 / period
        step = first_step[run]
        for sample in range(first_sample[run], first_sample[run + 1]):
            mean[:] = 0.0
            for _ in range(period):
                c = command[step]
                t = load[step]
                u = supply[step]
                if driven:
                    for i in range(LANES):
                        advance_demand(s, p, i, c, u, dt)
                for i in range(LANES):
                    advance(s, p, i, c, t, u, driven, dt)
                    mean[i] += shown_current(s, p, i)
                step += 1
            y = target[sample]
            w = weight[sample]
            for i in range(LANES):
                error = mean[i] * scale - y
                total[i] += w * error * error
        for i in range(LANES):
            result[run, block, i] = total[i]


@kernel
def traces(states, parameters, before, command, load, supply, period, group, dt, result):
    """Signals of a population over one run, each value the mean of `group` samples of `period` steps.

    result: (blocks, values, 4, LANES), written here; states: left as they are at the end.
    before: commands that came before the start, a value per step, which the drive has followed.
    A sample of the current is its mean over the period; one of motor speed, motor angle and user position
    is taken at the period's end.
    """
    for block in range(states.shape[0]):
        s = states[block].copy()  # of its own, which proves to the compiler that nothing overlaps
        p = parameters[block]
        driven = is_driven(p)
        if driven:
            for step in range(len(before)):
                for i in range(LANES):
                    follow(s, FIRST, p, i, before[step], dt)
        for i in range(LANES):
            sense(s, p, i)
        total = np.empty(4 * LANES)
        of_group = 1.0 / group
        of_steps = of_group / period
        step = 0
        for value in range(result.shape[1]):
            total[:] = 0.0
            for _ in range(group):
                for _ in range(period):
                    c = command[step]
                    t = load[step]
                    u = supply[step]
                    if driven:
                        for i in range(LANES):
                            advance_demand(s, p, i, c, u, dt)
                    for i in range(LANES):
                        advance(s, p, i, c, t, u, driven, dt)
                        total[i] += shown_current(s, p, i)
                    step += 1
                for i in range(LANES):
                    total[LANES + i] += shown_speed(s, p, i)
                    total[2 * LANES + i] += shown_angle(s, p, i)
                    total[3 * LANES + i] += s[TOLD * LANES + i]
            for i in range(LANES):
                result[block, value, 0, i] = total[i] * of_steps
                result[block, value, 1, i] = total[LANES + i] * of_group
                result[block, value, 2, i] = total[2 * LANES + i] * of_group
                result[block, value, 3, i] = total[3 * LANES + i] * of_group
        states[block, :] = s
