"""Three motors on a bench, of which the last has more friction: recordings of a few kilobytes, without a controller."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ema_model.recordings import Measurement, write_measurement

ACTUATOR = [
    *("--controller=unknown", "--set=motor.torque_constant_Nm_A=0.05 fixed", "--set=motor.inertia_kgm2=1e-4±30%"),
    *("--set=motor.dynamic_friction_Nm=0.01±50%", "--set=motor.viscous_friction_Nms_rad=0±1e-5"),
]
FRICTION = {"left": 0.012, "middle": 0.012, "right": 0.02}  # N·m
RUNS = ("slow", "fast", "unseen")


def motion(friction_Nm: float, seed: int) -> dict[str, np.ndarray]:
    """A motor of 1.1e-4 kg·m², moved to and fro."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 2.0, 2e-3)
    position = 20.0 * np.sin(2.0 * np.pi * (0.6 + 0.2 * (seed % len(RUNS))) * time)
    speed = np.gradient(position, time)
    torque = 1.1e-4 * np.gradient(speed, time) + friction_Nm * np.sign(speed)
    current = torque / 0.05 + 0.01 * random.standard_normal(len(time))
    return {"time_s": time, "motor_position_rad": position, "current_A": current}


def write_units(folder: Path) -> list[dict[str, np.ndarray]]:
    """A folder for each unit, with its runs; returns the slow ones."""
    slow = []
    for i, (unit, friction) in enumerate(FRICTION.items()):
        (folder / unit).mkdir(parents=True)
        for j, run in enumerate(RUNS):
            signals = motion(friction, len(RUNS) * i + j)
            write_measurement(Measurement(signals), folder / unit / f"{unit}_{run}.csv")
            slow += [signals] if run == "slow" else []
    return slow
