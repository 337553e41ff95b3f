"""Control electronics (T 3.2.3): position loop, speed loop, saturated reference current.

The Reference and the Monitor Model call the same functions.  What the speed loop remembers, its integral and its
error of the step before, is a function of its own: only where a gain asks for it do the lanes pay for it.
"""

from __future__ import annotations

from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def speed_reference(command, user_position, position_gain, speed_limit):
    """ω_ref = sat(G·e), rad/s, with e the position error at the user, rad."""
    return clamp(position_gain * (command - user_position), -speed_limit, speed_limit)


@scalar
def cascade_controller(
    command, user_position, omega, remembered, position_gain, speed_limit, speed_gain, current_per_torque, limit
):
    """Position loop and PID speed loop (T 3.1): the reference current, A.

    I_ref = sat(T_ref / k_t), T_ref = K_P e + K_I ∫e dt + K_D de/dt, e = ω_ref − ω; remembered: the last two, N·m.
    """
    error = speed_reference(command, user_position, position_gain, speed_limit) - omega
    return clamp((speed_gain * error + remembered) * current_per_torque, -limit, limit)


@scalar
def position_controller(
    command, user_position, omega, remembered, position_gain, speed_limit, speed_gain, current_per_torque, limit
):
    """A position loop alone: limit·sat(gain·e), the share of the bus voltage, or a current, A."""
    return limit * clamp(position_gain * (command - user_position), -1.0, 1.0)


@scalar
def advance_speed_loop(
    command,
    user_position,
    omega,
    integral,
    error_before,
    position_gain,
    speed_limit,
    speed_gain,
    integral_gain,
    derivative_gain,
    window,
    rest,
    current_per_torque,
    limit,
    dt,
):
    """What the speed loop remembers: K_I ∫e dt + K_D de/dt for this step, N·m; its integral after; its error now.

    integral: K_I ∫e dt, N·m; error_before: e of the step before, rad/s, NaN in the first one.
    """
    error = speed_reference(command, user_position, position_gain, speed_limit) - omega
    rise = error - error_before
    remembered = integral + derivative_gain * (rise * (1.0 / dt) if rise == rise else 0.0)
    wanted = (speed_gain * error + remembered) * current_per_torque
    position_error = command - user_position
    after = advance_integral(integral, integral_gain, error, position_error, omega, wanted, limit, window, rest, dt)
    return remembered, after, error


@scalar
def advance_integral(integral, gain, speed_error, position_error, omega, wanted, limit, window, rest, dt):
    """The integral action K_I ∫(ω_ref − ω) dt after a step, N·m.

    Conditional integration against wind-up: the integral is held while the wanted current is at its limit, A, or
    beyond, and the error would drive it further (Åström and Hägglund, Advanced PID Control, ISA 2006).  An error
    of the other sign unwinds it at once, where the thesis's bare "deactivated in saturation" keeps what has piled up.
    It is held, too, where the position error exceeds the window, rad, and at the speed `rest`, rad/s, and below it:
    0 is the thesis's PID, which stops integrating at standstill (T 3.2.3); −1 never does, as drives usually are.
    """
    winding = (abs(wanted) >= limit) & (speed_error * wanted > 0.0)
    held = winding | (abs(position_error) > window) | (abs(omega) <= rest)
    return integral if held else integral + dt * gain * speed_error
