"""A motor whose drive's controller nobody knows: its file, and logs of its motion and current."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator
from ema_model.recordings import Measurement

Array = NDArray[np.float64]

_FILE = """
[controller]
kind = "{kind}"
[motor]
torque_constant_Nm_A = 0.05
inertia_kgm2 = {{ value = 1e-4, tolerance = 0.1 }}
viscous_friction_Nms_rad = {{ value = 2e-5, sigma = 2e-5 }}
static_friction_Nm = 0.01
dynamic_friction_Nm = {{ value = 0.01, tolerance = 0.15 }}
"""


def drive_of(folder: Path, leaves_out_reversals: bool, kind: str = "unknown") -> Actuator:
    """As its file describes it; kind: of its controller."""
    reversals = "[model]\nleaves_out_reversals = true\n" if leaves_out_reversals else ""
    (folder / "motor.toml").write_text(reversals + _FILE.format(kind=kind), encoding="utf-8")
    return load_actuator(folder / "motor.toml")


def logged(
    seed: int,
    rate_Hz: float = 1000.0,
    noise_A: float = 0.05,
    counts: float | None = 2600.0,
    hidden: Callable[[Array, Array], Array] | None = None,
    name: str = "moves",
    times: float = 1.0,
    reach: float = 1.0,
    strokes: Sequence[tuple[float, float]] = ((40.0, 0.7), (12.0, 1.9), (4.0, 2.3)),
) -> Measurement:
    """Of that motor, with other values within their tolerances, begun and ended in mid-motion.

    counts: of the encoder, per radian; hidden(angle, speed): a torque, N·m, that the file does not know of; times: by
    which all is faster; reach: by which all angles are greater; strokes: amplitudes,
    rad, and frequencies, Hz, of the sines that the motion is made of.
    """
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 4.0, 1.0 / rate_Hz)
    size, rate = (np.array(each)[:, None] for each in zip(*strokes))
    size, rate = reach * size, 2.0 * np.pi * times * rate
    phase = rate * time + random.uniform(0.0, 2.0 * np.pi, (len(strokes), 1))
    angle, speed = np.sum(size * np.sin(phase), axis=0), np.sum(size * rate * np.cos(phase), axis=0)
    torque = -1.05e-4 * np.sum(size * rate**2 * np.sin(phase), axis=0) + 2.5e-5 * speed + 0.011 * np.sign(speed)
    if hidden is not None:
        torque = torque + hidden(angle, speed)
    signals = {
        "time_s": time,
        "motor_position_rad": angle if counts is None else np.round(angle * counts) / counts,
        "current_A": torque / 0.05 + noise_A * random.standard_normal(time.size),
    }
    return Measurement(signals, name=name)
