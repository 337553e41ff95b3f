"""Control electronics (T 3.2.3): position loop, speed loop, saturated reference current."""

from __future__ import annotations

from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def speed_reference(command, user_position, position_gain, speed_limit):
    """ω_ref = sat(G·e), rad/s, with e the position error at the user, rad."""
    return clamp(position_gain * (command - user_position), -speed_limit, speed_limit)


@scalar
def current_reference(torque_reference, current_per_torque, current_limit):
    """I_ref = sat(T_ref / 0.0752), A."""
    return clamp(torque_reference * current_per_torque, -current_limit, current_limit)


@scalar
def cascade_controller(
    command, user_position, omega, position_gain, speed_limit, speed_gain, current_per_torque, limit
):
    """Position and speed loop with proportional action: the reference current, A."""
    torque = speed_gain * (speed_reference(command, user_position, position_gain, speed_limit) - omega)
    return current_reference(torque, current_per_torque, limit)


@scalar
def position_controller(
    command, user_position, omega, position_gain, speed_limit, speed_gain, current_per_torque, limit
):
    """A position loop alone: limit·sat(gain·e), the share of the bus voltage, or a current, A."""
    return limit * clamp(position_gain * (command - user_position), -1.0, 1.0)


@scalar
def advance_integral(integral, speed_error, position_error, omega, saturated, window, dt):
    """∫(ω_ref − ω) dt of the PID's integral branch, rad.

    Frozen at zero speed, where the position error exceeds the window, and in saturation (T 3.2.3).
    """
    frozen = (omega == 0.0) | (abs(position_error) > window) | saturated
    return integral if frozen else integral + dt * speed_error
