"""Inverse dynamics: the current that a measured motion needs, for recordings whose controller is not known."""

from __future__ import annotations

import numpy as np

from ema_model.physics.elementary import clamp
from ema_model.physics.jit import kernel, scalar
from ema_model.physics.rows import (
    DYNAMIC_FRICTION,
    GEAR_RATIO,
    INVERSE_INERTIA,
    LANES,
    STATIC_FRICTION,
    TORQUE_CONSTANT,
    VISCOUS,
)

from .composition import current_reading, electric_torque, inverse_inertia, moving_friction, shaft_torque

_MOST_STATES = 16
_ROUNDS = 3  # in which the current is found that effects depend on themselves, by secants
_FIRST_SLOPE = (
    -1.5
)  # of what a round leaves, by its step: so careful that braking friction up to μ = 0.6 does not turn over
_LEAST_SLOPE, _MOST_SLOPE = -20.0, -0.05


@scalar
def needed_current(s, p, i, theta, omega, acceleration, load, time, still):
    """I with T(I) = J dω/dt + C ω + τ T_load + T_f sgn ω − effects on the shaft, A (T 3.13 solved for the motor).

    Friction's sign goes over softly below the speed `still`, rad/s, under which the direction is not known.
    """
    constant = p[TORQUE_CONSTANT * LANES + i]
    gear = p[GEAR_RATIO * LANES + i]
    user = gear * theta
    static = p[STATIC_FRICTION * LANES + i]
    dynamic = p[DYNAMIC_FRICTION * LANES + i]
    direction = clamp(omega / still, -1.0, 1.0)
    drag = p[VISCOUS * LANES + i] * omega
    base = acceleration / inverse_inertia(p[INVERSE_INERTIA * LANES + i], s, 0, p, i) + drag + gear * load
    current = (base + direction * dynamic) / constant
    lacked, step, slope = 0.0, 0.0, _FIRST_SLOPE
    for _ in range(_ROUNDS):
        torque = electric_torque(constant * current, theta, omega, current, s, 0, p, i)
        added = shaft_torque(0.0, theta, omega, current, user, gear, load, time, s, 0, p, i)
        active = torque - drag - gear * load + added
        level = moving_friction(dynamic, static, omega, torque, drag, active, load, gear, theta, user, time, s, 0, p, i)
        lacks = (base + direction * level - added - torque) / constant
        slope = clamp((lacks - lacked) / step, _LEAST_SLOPE, _MOST_SLOPE) if step != 0.0 else slope
        lacked, step = lacks, -lacks / slope
        current += step
    return current_reading(current, s, 0, p, i)


@kernel
def currents(parameters, theta, omega, acceleration, load, time, still, result):
    """The current of every sample for a population: parameters (blocks, rows·LANES).

    The motion, the load and the time: (samples,) each.
    result: (blocks, samples, LANES), A, written here.  Effects' own states stay at 0.
    """
    for block in range(parameters.shape[0]):
        p = parameters[block]
        s = np.zeros(_MOST_STATES * LANES)
        for n in range(theta.size):
            for i in range(LANES):
                result[block, n, i] = needed_current(
                    s, p, i, theta[n], omega[n], acceleration[n], load[n], time[n], still
                )
