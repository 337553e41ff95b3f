"""Without a controller one scale holds all torques: what lies outside its tolerance, and how sure the rest is."""

from __future__ import annotations

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.discovery.history import calibrated_story
from ema_model.discovery.uncertainty import outside_tolerance, with_intervals
from ema_model.recordings import Measurement

INERTIA, CONSTANT, FRICTION = 1e-4, 0.05, 0.01  # kg m², N·m/A, N·m
FILE = f"""
[model]
leaves_out_reversals = true
[controller]
kind = "unknown"
[motor]
torque_constant_Nm_A = {{ value = {CONSTANT}, tolerance = 0.04 }}
inertia_kgm2 = {{ value = {INERTIA}, tolerance = 0.08 }}
viscous_friction_Nms_rad = 0.0
static_friction_Nm = {FRICTION}
dynamic_friction_Nm = {{ value = {FRICTION}, tolerance = 0.15 }}
[sensors]
apparent_inertia = {{ value = 0.05, sigma = 0.05 }}
"""


@pytest.fixture
def story(tmp_path):
    """Of a motor whose inertia is so many times the file's."""
    (tmp_path / "motor.toml").write_text(FILE, encoding="utf-8")
    actuator = load_actuator(tmp_path / "motor.toml")

    def of(times: float):
        time, rng = np.arange(0.0, 3.0, 5e-4), np.random.default_rng(3)
        rate = 2.0 * np.pi * np.array([[0.7], [1.9], [4.3]])
        size = np.array([[40.0], [12.0], [4.0]])
        angle = np.sum(size * np.sin(rate * time), axis=0)
        speed = np.sum(size * rate * np.cos(rate * time), axis=0)
        acceleration = -np.sum(size * rate**2 * np.sin(rate * time), axis=0)
        current = (times * INERTIA * acceleration + FRICTION * np.sign(speed)) / CONSTANT
        signals = {"time_s": time, "motor_position_rad": angle + 1e-5 * rng.standard_normal(time.size)}
        recorded = Measurement(signals | {"current_A": current + 0.01 * rng.standard_normal(time.size)}, name="spin")
        return calibrated_story([recorded], actuator, (), None, lambda told: None)

    return of


def test_what_several_share_is_told_of_the_one_that_is_drawn_most(story):
    heavy = story(1.5)
    z = {path: one.z for path, one in heavy.current.calibration.parameters.items()}
    assert max(abs(one) for one in z.values()) < 3.0, "no one of them by itself"
    assert outside_tolerance(heavy.data, heavy.current) == ["motor.inertia_kgm2"]


@pytest.mark.parametrize("times", [0.95, 1.05, 1.2])  # the file allows 1.05 ± 0.1
def test_what_the_file_allows_is_not_told(story, times):
    allowed = story(times)
    assert outside_tolerance(allowed.data, allowed.current) == []


def test_what_the_file_alone_tells_is_told_to_two_sigmas(story):
    plain = story(1.05)
    told = with_intervals(plain.data, plain.current).parameters
    low, high = told["motor.torque_constant_Nm_A"].interval90
    by_file = (0.04**-2 + (0.08**2 + 0.05**2) ** -1 + 0.15**-2) ** -0.5  # itself, by the inertia, by friction
    assert 0.5 * (high - low) == pytest.approx(2.0 * by_file * CONSTANT, rel=0.02)
    ratio = told["motor.dynamic_friction_Nm"].value / told["motor.torque_constant_Nm_A"].value
    assert ratio == pytest.approx(FRICTION / CONSTANT, rel=0.02), "which is what the motion tells"
    for path, true in (("motor.inertia_kgm2", 1.05 * INERTIA), ("motor.dynamic_friction_Nm", FRICTION)):
        low, high = told[path].interval90
        assert low < true < high
