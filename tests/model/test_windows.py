"""Parts of recordings that a model simulates: their steps, where they begin, and how much of long ones a fit takes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.models import ClosedLoop
from ema_model.models.loop_window import cut
from ema_model.models.measured_motion import evaluation_stretches, fit_stretches
from ema_model.recordings import Measurement
from ema_model.simulation.run import Run, simulate_reference

SERVO = load_actuator(Path(__file__).parents[2] / "assets" / "actuators" / "xl330.toml")
ENCODER_STEP = 2.0 * np.pi / 4096.0  # of an encoder at the output


@pytest.mark.parametrize("rate", [100.0, 500.0, 2000.0])
@pytest.mark.parametrize("has_motor", [False, True])
def test_the_speed_is_that_of_the_position(rate, has_motor):
    """A servo's output encoder is coarse: its speed is that of 10 ms on either side, however fast it is logged."""
    time = np.arange(0.0, 4.0, 1.0 / rate)
    true = 0.6 * np.sin(2.0 * np.pi * 0.5 * time)
    speed = 0.6 * 2.0 * np.pi * 0.5 * np.cos(2.0 * np.pi * 0.5 * time)
    tau = SERVO.transmission.gear_ratio
    signals = {"time_s": time, "command_rad": true, "user_position_rad": np.round(true / ENCODER_STEP) * ENCODER_STEP}
    if has_motor:
        signals["motor_position_rad"] = true / tau
    first = time.size // 5
    plant = ClosedLoop([Measurement(signals)], SERVO, stretches=[[slice(0, first), slice(first, time.size)]])
    begins, later = (window.speed_rad_s * tau for window in plant.windows)
    assert begins == pytest.approx(speed[0], rel=0.05), "a recording may begin in mid motion"
    assert later == pytest.approx(speed[first], abs=0.05)


# --- a window at longer steps: the same inputs, thinned, and the same kernel ------------------------------------------


def test_its_inputs_are_those_of_the_own_steps_thinned_and_in_one_piece():
    """A kernel is compiled anew, for seconds, for an array that is not in one piece."""
    actuator = load_actuator()
    (own,) = cut(simulate_reference(Run(), actuator), actuator)
    longer = own.at_longer_steps(2e-5)
    times = round(longer.step_s / own.step_s)
    assert times == 2 and longer.steps_per_sample * times == own.steps_per_sample
    for name in ("command", "load", "supply"):
        thinned = getattr(longer, name)
        np.testing.assert_array_equal(thinned, getattr(own, name)[::times])
        assert thinned.flags.c_contiguous


# --- the model's step where a file does not say it, and how much of long recordings a fit simulates -------------------

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
