"""A motor that carries a load on a shaft that gives, simulated by itself: torque in, the motor's encoder out."""

from __future__ import annotations

from functools import cache

import numpy as np

from ema_model.recordings import Measurement

STEP_S = 2e-5
RATE_HZ = 1000.0
TORQUE_CONSTANT = 0.05  # N·m/A
MOTOR, LOAD = 8e-5, 1.6e-4  # kg·m²


@cache
def flexible_drive(
    seed: int,
    antiresonance_Hz: float = 22.0,
    *,
    seconds: float = 8.0,
    damping: float = 0.02,
    counts: float = 2600.0,
    noise_A: float = 0.05,
    is_rigid: bool = False,
) -> Measurement:
    """Current and motor position under a sweep from 1 to 70 Hz about slow strokes; semi-implicit Euler.

    damping: of the shaft, relative to the load on it; is_rigid: both masses as one.
    """
    random = np.random.default_rng(seed)
    stiffness = LOAD * (2.0 * np.pi * antiresonance_Hz) ** 2
    loss = 2.0 * damping * np.sqrt(stiffness * LOAD)
    time = np.arange(0.0, seconds, STEP_S)
    sweep = 2.0 * np.pi * (1.0 * time + 0.5 * (70.0 - 1.0) / seconds * time**2) + random.uniform(0.0, 2.0 * np.pi)
    torque = 0.03 * np.sin(sweep) + 0.03 * np.sign(np.sin(2.0 * np.pi * 0.4 * time))
    motor = load = speed = load_speed = 0.0
    every = round(1.0 / (RATE_HZ * STEP_S))
    angles = np.empty(time.size // every)
    inertia = MOTOR + LOAD if is_rigid else MOTOR
    for n, drive in enumerate(torque):
        if n % every == 0:
            angles[n // every] = motor
        shaft = 0.0 if is_rigid else stiffness * (motor - load) + loss * (speed - load_speed)
        free = drive - shaft - 2e-5 * speed
        speed += STEP_S / inertia * (free - 0.01 * np.tanh(speed / 0.05))
        motor += STEP_S * speed
        load_speed += STEP_S / LOAD * shaft
        load += STEP_S * load_speed
    current = torque[::every][: angles.size] / TORQUE_CONSTANT
    signals = {
        "time_s": time[::every][: angles.size],
        "motor_position_rad": np.round(angles * counts) / counts,
        "current_A": current + noise_A * random.standard_normal(angles.size),
    }
    return Measurement(signals, name="sweep")
