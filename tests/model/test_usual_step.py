"""The model's step where a file does not say it, and how much of long recordings a fit simulates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ema_model.actuator import load_actuator
from ema_model.models.measured_motion import evaluation_stretches, fit_stretches
from ema_model.recordings import Measurement

DRIVE = """
[controller]
position_gain_1_s = 1500.0
speed_limit_rad_s = 300.0
speed_gain_Nms_rad = 0.011
integral_gain_Nm_rad = 0.4
derivative_gain_Nms2_rad = 0.0
integrator_window_rad = 10.0
torque_constant_Nm_A = 0.05
current_limit_A = 6.0
[inverter]
kind = "current"
current_limit_A = 6.0
[motor]
torque_constant_Nm_A = 0.05
torque_limit_Nm = 0.3
inertia_kgm2 = 4e-5
viscous_friction_Nms_rad = 3e-5
static_friction_Nm = 0.0
dynamic_friction_Nm = 0.02
[transmission]
gear_ratio = 0.02
backlash_rad = 0.0
viscous_friction_Nms_rad = 0.0
stop_low_rad = -3.0
stop_high_rad = 3.0
"""


def test_a_drive_that_has_its_current_at_once_takes_longer_steps(tmp_path):
    path = tmp_path / "drive.toml"
    path.write_text(DRIVE, encoding="utf-8")
    assert load_actuator(path).step_s == 5e-5
    path.write_text("[model]\nstep_s = 2e-5\n" + DRIVE, encoding="utf-8")
    assert load_actuator(path).step_s == 2e-5
    assert load_actuator().step_s == 1e-5, "chopping takes fine steps"


def test_a_fit_takes_no_more_blocks_than_tell_something():
    """48 s at 2.5 kHz are fitted on parts, though the model's steps are few; what is shown is still the whole."""
    actuator = replace(load_actuator(), step_s=1e-3)
    time = np.arange(0.0, 48.0, 4e-4)
    long = Measurement({"time_s": time, "command_rad": np.sin(time), "user_position_rad": np.sin(time)}, name="long")
    parts = fit_stretches([long], actuator)
    assert parts is not None and parts[0] is not None
    assert 10_000 < sum(one.stop - one.start for one in parts[0]) < 25_000
    assert evaluation_stretches([long], actuator) is None
