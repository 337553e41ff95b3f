"""A drive whose controller nobody knows: a true model of it leaves what the floor says, whatever its log lacks."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison import compare
from ema_model.comparison.criteria import SLOW
from ema_model.comparison.verdict import slow_ratio
from ema_model.recordings import Measurement

FILE = """
[controller]
kind = "unknown"
[motor]
torque_constant_Nm_A = 0.05
inertia_kgm2 = { value = 1e-4, tolerance = 0.1 }
viscous_friction_Nms_rad = { value = 2e-5, sigma = 2e-5 }
static_friction_Nm = 0.01
dynamic_friction_Nm = { value = 0.01, tolerance = 0.15 }
"""
SEEDS = range(12)


@pytest.fixture(params=["whole", "steady parts"])
def actuator(request, tmp_path) -> Actuator:
    reversals = "[model]\nleaves_out_reversals = true\n" if request.param == "steady parts" else ""
    (tmp_path / "motor.toml").write_text(reversals + FILE, encoding="utf-8")
    return load_actuator(tmp_path / "motor.toml")


def logged(seed: int, rate_Hz: float, noise_A: float, counts: float | None) -> Measurement:
    """Of that motor, with other values within their tolerances, begun and ended in mid-motion; counts: per radian."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 4.0, 1.0 / rate_Hz)
    rate, size = 2.0 * np.pi * np.array([[0.7], [1.9], [2.3]]), np.array([[40.0], [12.0], [4.0]])
    phase = rate * time + random.uniform(0.0, 2.0 * np.pi, (3, 1))
    angle, speed = np.sum(size * np.sin(phase), axis=0), np.sum(size * rate * np.cos(phase), axis=0)
    acceleration = -np.sum(size * rate**2 * np.sin(phase), axis=0)
    current = (1.05e-4 * acceleration + 2.5e-5 * speed + 0.011 * np.sign(speed)) / 0.05
    return Measurement(
        {
            "time_s": time,
            "motor_position_rad": angle if counts is None else np.round(angle * counts) / counts,
            "current_A": current + noise_A * random.standard_normal(time.size),
        },
        name="moves",
    )


@pytest.mark.parametrize(
    ("rate_Hz", "noise_A", "counts"),
    [(500.0, 0.2, None), (2000.0, 0.2, None), (1000.0, 0.05, 652.0)],
    ids=["noise", "noise, logged fast", "a coarse encoder"],
)
def test_a_true_model_is_adequate_and_at_its_floor(actuator, rate_Hz, noise_A, counts):
    """A filter leaves noise alike for a while, which is no lasting error; what it cannot know at the ends, is none."""
    found = [compare([logged(seed, rate_Hz, noise_A, counts)], actuator) for seed in SEEDS]
    error = np.array([one.over_floor for one in found])
    print(np.round(error, 3), np.round(np.mean([one.floor_band for one in found], axis=0), 3))
    assert 0.88 <= np.median(error) <= 1.03
    assert max(slow_ratio(one.residuals, "current_A") for one in found) < 0.75 * SLOW
    assert sum(one.adequate for one in found) >= len(SEEDS) - 1
    if counts is None:
        assert sum(low <= one <= high for one, (low, high) in zip(error, (each.floor_band for each in found))) >= 9
