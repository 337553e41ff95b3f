"""The motor of `unknown_drive` under a current that nobody controls: its motion, integrated here, and a noisy log."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ema_model.recordings import Measurement

_STEP_S = 2e-5
_EVERY = 50  # steps, a row of the log
_CONSTANT, _INERTIA, _VISCOUS, _FRICTION = 0.05, 1.05e-4, 2.5e-5, 0.011
_COUNTS = 2600.0  # of the encoder, per radian


def pushed(
    seed: int, noise_A: float = 0.05, hidden: Callable[[float, float], float] | None = None, name: str = "push"
) -> Measurement:
    """Two seconds of it.  hidden(angle, speed): a torque, N·m, that brakes and that no file knows of."""
    random = np.random.default_rng(seed)
    time = np.arange(100_000) * _STEP_S
    rate = 2.0 * np.pi * np.array([[0.7], [1.9], [3.3]]) * random.uniform(0.8, 1.2)
    current = np.array([0.8, 0.4, 0.3]) @ np.sin(rate * time + random.uniform(0.0, 6.0, (3, 1)))
    angle, place, speed = np.empty(time.size), 0.0, 0.0
    for i, driven in enumerate(_CONSTANT * current):
        angle[i] = place
        free = driven - _VISCOUS * speed - (hidden(place, speed) if hidden else 0.0)
        sticks = speed == 0.0 and abs(free) <= _FRICTION
        later = 0.0 if sticks else speed + _STEP_S / _INERTIA * (free - _FRICTION * np.sign(speed or free))
        if speed * later < 0.0:
            later = 0.0  # it stops there, and breaks away in the next step
        place, speed = place + 0.5 * _STEP_S * (speed + later), later
    rows = slice(0, None, _EVERY)
    signals = {
        "time_s": time[rows],
        "motor_position_rad": np.round(angle[rows] * _COUNTS) / _COUNTS,
        "current_A": current[rows] + noise_A * random.standard_normal(len(time[rows])),
    }
    return Measurement(signals, name=name)
