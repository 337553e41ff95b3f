"""Three phases 120° apart: the windings' coefficients and the equivalent current (T 3.3–3.5, 3.14)."""

from __future__ import annotations

import math

import numpy as np

from ema_model.physics.jit import scalar

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
