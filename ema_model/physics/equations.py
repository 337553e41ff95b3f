"""The equations of the thesis's chapter 3: controller, inverter, the three phases, current, friction and backlash."""

from __future__ import annotations

import math

import numpy as np

from ema_model.physics.elementary import clamp, sign
from ema_model.physics.jit import scalar

# --- control electronics (T 3.2.3): position loop, speed loop, saturated reference current ----------------------------
# The Reference and the Monitor Model call the same functions. What the speed loop remembers, its integral and its error
# of the step before, is a function of its own: only where a gain asks for it do the lanes pay for it.


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


# --- the inverter's legs (T 3.2.5): a relay with hysteresis about the reference current -------------------------------


@scalar
def relay(leg, error, half_band):
    """New state of a leg, ±1, from the error of its phase current, A: it switches beyond ±half_band."""
    return 1.0 if error > half_band else (-1.0 if error < -half_band else leg)


# --- three phases 120° apart: the windings' coefficients and the equivalent current (T 3.3–3.5, 3.14) -----------------

_HALF_SQRT3 = math.sqrt(3.0) / 2.0


@scalar
def minus_120(s, c):
    """sin and cos of x − 2π/3 from those of x."""
    return -0.5 * s - _HALF_SQRT3 * c, -0.5 * c + _HALF_SQRT3 * s


@scalar
def plus_120(s, c):
    """sin and cos of x + 2π/3 from those of x."""
    return -0.5 * s + _HALF_SQRT3 * c, -0.5 * c - _HALF_SQRT3 * s


@scalar
def air_gap(sin_rotor, cos_rotor, eccentricity, cos_phase, sin_phase):
    """1 + ζ cos(θ_m − φ + 2πi/3) for i = A, B, C (T 3.20 with the mechanical angle)."""
    s = sin_rotor * cos_phase - cos_rotor * sin_phase
    c = cos_rotor * cos_phase + sin_rotor * sin_phase
    cos_b = plus_120(s, c)[1]
    cos_c = minus_120(s, c)[1]
    return 1.0 + eccentricity * c, 1.0 + eccentricity * cos_b, 1.0 + eccentricity * cos_c


@scalar
def winding_coefficients(sin_e, cos_e, gap_a, gap_b, gap_c, turns_a, turns_b, turns_c):
    """k_i = N_i · [−sin(θ_e − 2πi/3)] · [1 + ζ cos(θ_m − φ + 2πi/3)].

    The reading of T 3.3–3.5 that keeps their symbols and still gives torque at ζ = 0.
    """
    sin_b = minus_120(sin_e, cos_e)[0]
    sin_c = plus_120(sin_e, cos_e)[0]
    return -turns_a * sin_e * gap_a, -turns_b * sin_b * gap_b, -turns_c * sin_c * gap_c


@scalar
def equivalent_current(current_a, current_b, current_c, sin_e, cos_e):
    """I_3eq = [−I_A + ½(I_B + I_C)] sin θ_e + (√3/2)(I_B − I_C) cos θ_e (T 3.14), A."""
    return (0.5 * (current_b + current_c) - current_a) * sin_e + _HALF_SQRT3 * (current_b - current_c) * cos_e


@scalar
def flux_factor(sin_rotor, cos_rotor, sin_2e, cos_2e, flux):
    """f(θ) = (2/3) Σ N_i sin²(θ_e − 2πi/3) [1 + ζ cos(θ_m − φ + 2πi/3)].

    What the three phases' torque becomes when they carry the currents of one equivalent current: the
    exact single-phase reduction, 1 for a healthy motor.  With sin² written in 2θ_e it is
    f = g_0 + g_1 cos 2θ_e + g_2 sin 2θ_e, each g = a + b sin θ_m + c cos θ_m: the nine coefficients of
    `flux_harmonics`, a tuple here.
    """
    a0, b0, c0, a1, b1, c1, a2, b2, c2 = flux
    g0 = a0 + b0 * sin_rotor + c0 * cos_rotor
    g1 = a1 + b1 * sin_rotor + c1 * cos_rotor
    g2 = a2 + b2 * sin_rotor + c2 * cos_rotor
    return g0 + g1 * cos_2e + g2 * sin_2e


def flux_harmonics(turns, eccentricity, phase):
    """The nine coefficients of `flux_factor`; turns: (3, …), eccentricity, phase: (…), rad; gives (9, …)."""
    shift = 2.0 * np.pi / 3.0 * np.arange(3)
    weights = np.array([np.ones(3), -np.cos(2.0 * shift), -np.sin(2.0 * shift)]) / 3.0
    ones = np.ones_like(np.asarray(eccentricity, dtype=float))
    angle = np.multiply.outer(shift, ones) - phase
    gaps = np.array([np.broadcast_to(ones, angle.shape), -eccentricity * np.sin(angle), eccentricity * np.cos(angle)])
    harmonics = np.einsum("hi,ji...,i...->hj...", weights, gaps, np.asarray(turns, dtype=float))
    return harmonics.reshape(9, *ones.shape)


# --- drives: how the Monitor Model's current follows the controller's demand; L dI/dt = V − R I − E -------------------
# Two for the thesis's hysteresis current loop, whose demand is a current, and two for other actuators.


@scalar
def thesis_drive(current, reference, emf, voltage, resistance, inverse_inductance, dt):
    """The thesis's: the full voltage by the sign of I_ref − I (T 3.3.3), which chops at every step."""
    v = voltage * sign(reference - current)
    return current + dt * inverse_inductance * (v - resistance * current - emf)


@scalar
def reduced_drive(current, reference, emf, voltage, resistance, inverse_inductance, dt):
    """The dead-beat voltage, clamped: the reference is met within the step where the voltage suffices."""
    rate = dt * inverse_inductance
    drift = current - rate * (resistance * current + emf)
    return clamp(reference, drift - rate * voltage, drift + rate * voltage)


@scalar
def current_drive(current, reference, emf, voltage, resistance, inverse_inductance, dt):
    """An ideal current source: the reference is met at once."""
    return reference


@scalar
def voltage_drive(current, duty, emf, voltage, resistance, inverse_inductance, dt):
    """A share of the bus voltage (PWM) on the winding; implicit, so that any inductance is stable."""
    rate = dt * inverse_inductance
    return (current + rate * (duty * voltage - emf)) / (1.0 + rate * resistance)


# --- Borello's dry friction with stick (T 3.5.1), and the step of a rotor under it ------------------------------------


@scalar
def borello_friction(omega, active_torque, static, dynamic):
    """Friction torque, N·m.

    At rest it balances the active torque up to ±static; in motion it is dynamic·sgn ω.
    (The thesis prints "V = 0 or |F| ≤ FSJ"; only "and" gives a rotor that can stick and move.)
    Where an effect takes the level in motion beyond static, so much holds at rest, too: else it would creep.
    """
    moving = dynamic if omega > 0.0 else -dynamic
    holds = max(static, dynamic)
    return clamp(active_torque, -holds, holds) if omega == 0.0 else moving


@scalar
def advance_rotor(theta, omega, net_torque, inverse_inertia, sticks, stop_low, stop_high, dt):
    """New angle and speed (T 3.13, semi-implicit Euler).

    sticks: whether friction is Borello's, of which a change of sign within the step stops the rotor (T 3.16), so that
    it is asked again at rest.  An end stop holds the angle and stops the rotor inelastically.
    """
    theta1, omega1, _ = advance_reversing_rotor(
        theta, omega, net_torque, inverse_inertia, sticks, stop_low, stop_high, 0.0, dt
    )  # fmt: skip
    return theta1, omega1


@scalar
def advance_reversing_rotor(theta, omega, net_torque, inverse_inertia, sticks, stop_low, stop_high, left, dt):
    """The same, and what is left of the step after the rotor has come to rest in it, s, which acts with the next.

    So a reversal is when the speed is zero, and not at a step's end: signals do not jump where a parameter moves it
    from one step into another, which a derivative by differences would take for a slope.
    """
    accelerated = omega + (dt + left) * inverse_inertia * net_torque
    stops = sticks & (accelerated * omega < 0.0)
    omega1 = 0.0 if stops else accelerated
    free = theta + (dt + 0.5 * left) * omega1
    theta1 = clamp(free, stop_low, stop_high)
    after = dt * accelerated / (accelerated - omega) if stops else 0.0
    return theta1, (omega1 if theta1 == free else 0.0), after


# --- backlash as a play operator with memory (T 3.5.2; Simulink's Backlash block) -------------------------------------


@scalar
def advance_play(play, theta, half_width):
    """Output of the play: it stays where it is until the input pushes one of its flanks."""
    return clamp(play, theta - half_width, theta + half_width)
