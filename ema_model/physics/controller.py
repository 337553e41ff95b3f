"""Control electronics (T 3.2.3): position loop, speed loop, saturated reference current.

The Reference and the Monitor Model call the same functions.  What the speed loop remembers, its integral and its
error of the step before, is a function of its own: only where a gain asks for it do the lanes pay for it.
"""

from __future__ import annotations

from ema_model.physics.elementary import clamp
from ema_model.physics.jit import scalar


@scalar
def speed_reference(position_error, position_gain, speed_limit):
    """ω_ref = sat(G·e), rad/s, with e the position error at the user, rad."""
    return clamp(position_gain * position_error, -speed_limit, speed_limit)


@scalar
def cascade_controller(
    command, position_error, speed_error, remembered, position_gain, speed_gain, current_per_torque, limit
):
    """PID speed loop (T 3.1) behind a position loop: the reference current, A.

    I_ref = sat(T_ref / k_t), T_ref = K_P e + K_I ∫e dt + K_D de/dt, e = ω_ref − ω; remembered: the last two, N·m.
    """
    return clamp((speed_gain * speed_error + remembered) * current_per_torque, -limit, limit)


@scalar
def position_controller(
    command, position_error, speed_error, remembered, position_gain, speed_gain, current_per_torque, limit
):
    """A position loop alone: limit·sat(gain·e), the share of the bus voltage, or a current, A."""
    return limit * clamp(position_gain * position_error, -1.0, 1.0)


@scalar
def open_controller(
    command, position_error, speed_error, remembered, position_gain, speed_gain, current_per_torque, limit
):
    """No controller: what is put in is the current itself, A."""
    return clamp(command, -limit, limit)


@scalar
def advance_speed_loop(
    position_error,
    speed_error,
    omega,
    integral,
    error_before,
    begins,
    speed_gain,
    integral_gain,
    derivative_gain,
    window,
    rest,
    current_per_torque,
    limit,
    dt,
):
    """What the speed loop remembers: K_I ∫e dt + K_D de/dt for this step, N·m; and its integral after it.

    integral: K_I ∫e dt, N·m, which counts for nothing without an integral gain; error_before: e of the step before,
    rad/s; begins: whether there was none.
    """
    kept = integral if integral_gain != 0.0 else 0.0
    rise = 0.0 if begins else speed_error - error_before
    remembered = kept + derivative_gain * (rise * (1.0 / dt))
    wanted = (speed_gain * speed_error + remembered) * current_per_torque
    after = advance_integral(kept, integral_gain, speed_error, position_error, omega, wanted, limit, window, rest, dt)
    return remembered, after


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
