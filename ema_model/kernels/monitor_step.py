"""One step of the Monitor Model (MODEL: T 3.3), for one lane of a block."""

from __future__ import annotations

from ema_model.numba_options import scalar
from ema_model.physics.backlash import advance_play
from ema_model.physics.elementary import clamp, rotate
from ema_model.physics.friction import advance_rotor, borello_friction
from ema_model.physics.phases import flux_factor
from ema_model.physics.rows import (
    COS_ELECTRICAL,
    COS_ROTOR,
    CURRENT,
    CURRENT_PER_TORQUE,
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
    OMEGA,
    OUTPUT_LIMIT,
    PLAY,
    POLE_PAIRS,
    POSITION_GAIN,
    RESISTANCE,
    SIN_ELECTRICAL,
    SIN_ROTOR,
    SPEED_GAIN,
    SPEED_LIMIT,
    STATIC_FRICTION,
    STOP_HIGH,
    STOP_LOW,
    THETA,
    TORQUE_CONSTANT,
    TORQUE_LIMIT,
    VISCOUS,
    VOLTAGE,
)

from .composition import advance_current, control, electric_torque, moving_friction, shaft_torque


@scalar
def advance(s, p, i, command, load, supply, dt):
    """Advances lane i of the state s (rows of `STATE_ROWS`) by dt, s, under a command, rad, and a load, N·m.

    supply: the bus voltage over its nominal value; 0 is a drive switched off, which carries no current.
    """
    theta = s[THETA * LANES + i]
    omega = s[OMEGA * LANES + i]
    play = s[PLAY * LANES + i]
    sin_r = s[SIN_ROTOR * LANES + i]
    cos_r = s[COS_ROTOR * LANES + i]
    sin_2e = s[SIN_ELECTRICAL * LANES + i]
    cos_2e = s[COS_ELECTRICAL * LANES + i]
    user = p[GEAR_RATIO * LANES + i] * play

    demand = control(
        command,
        user,
        omega,
        p[POSITION_GAIN * LANES + i],
        p[SPEED_LIMIT * LANES + i],
        p[SPEED_GAIN * LANES + i],
        p[CURRENT_PER_TORQUE * LANES + i],
        p[OUTPUT_LIMIT * LANES + i],
    )

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
    driven = advance_current(
        s[CURRENT * LANES + i],
        demand,
        p[EMF_CONSTANT * LANES + i] * flux * omega,
        p[VOLTAGE * LANES + i] * supply,
        p[RESISTANCE * LANES + i],
        p[INVERSE_INDUCTANCE * LANES + i],
        dt,
    )
    current = driven if supply > 0.0 else 0.0
    limit = p[TORQUE_LIMIT * LANES + i]
    developed = p[TORQUE_CONSTANT * LANES + i] * flux * current
    motor_torque = clamp(electric_torque(developed, theta, omega, current, p, i), -limit, limit)

    gear = p[GEAR_RATIO * LANES + i]
    passive = motor_torque - gear * load - p[VISCOUS * LANES + i] * omega
    active = shaft_torque(passive, theta, omega, current, user, gear, p, i)
    static = p[STATIC_FRICTION * LANES + i]
    dynamic = moving_friction(p[DYNAMIC_FRICTION * LANES + i], static, omega, motor_torque, load, p, i)
    net = active - borello_friction(omega, active, static, dynamic)
    theta1, omega1 = advance_rotor(
        theta, omega, net, p[INVERSE_INERTIA * LANES + i], p[STOP_LOW * LANES + i], p[STOP_HIGH * LANES + i], dt
    )
    turned = theta1 - theta
    sin_r1, cos_r1 = rotate(sin_r, cos_r, turned)
    sin_2e1, cos_2e1 = rotate(sin_2e, cos_2e, 2.0 * p[POLE_PAIRS * LANES + i] * turned)

    s[THETA * LANES + i] = theta1
    s[OMEGA * LANES + i] = omega1
    s[PLAY * LANES + i] = advance_play(play, theta1, p[HALF_PLAY * LANES + i])
    s[SIN_ROTOR * LANES + i] = sin_r1
    s[COS_ROTOR * LANES + i] = cos_r1
    s[SIN_ELECTRICAL * LANES + i] = sin_2e1
    s[COS_ELECTRICAL * LANES + i] = cos_2e1
    s[CURRENT * LANES + i] = current
