"""The model running freely, in the signal's unit: on motions made by other code, and beside another integration."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from support.unknown_drive import drive_of, logged

from ema_model.actuator import load_actuator
from ema_model.comparison import compare
from ema_model.comparison.free_simulation import _scores
from ema_model.discovery import discover
from ema_model.models.open_loop import FreeMotion, free_motion
from ema_model.recordings import Measurement
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

TRUE = {
    "motor.inertia_kgm2": 1.05e-4,
    "motor.viscous_friction_Nms_rad": 2.5e-5,
    "motor.dynamic_friction_Nm": 0.011,
    "motor.static_friction_Nm": 0.011,
}


def by_hand(recording, inertia: float, viscous: float, dry: float, offset_A: float, start) -> np.ndarray:
    """The angle that the recorded current brings about, integrated here: J a = k_t (i + offset) − B ω − T sgn ω."""
    time, torque = recording.time_s, 0.05 * (recording["current_A"] + offset_A)
    fine = np.arange(0.0, time[-1], 5e-5)
    pushed = np.interp(fine, time, torque)
    angle, speed = start
    angles = np.empty(fine.size)
    for i, push in enumerate(pushed):
        angles[i] = angle
        after = speed + 5e-5 * (push - viscous * speed - dry * np.sign(speed)) / inertia
        if after * speed < 0.0:  # dry friction stops what it turns over, and holds it below its limit
            after = 0.0 if abs(push) <= dry else after
        speed = after
        angle += 5e-5 * speed
    return np.interp(time, fine, angles)


@pytest.fixture
def actuator(tmp_path):
    return drive_of(tmp_path, leaves_out_reversals=False)


def test_an_error_that_a_trifle_changes_is_no_number(actuator):
    """Where a motor stops and starts, a hundred-thousandth of the current decides when: any of many errors might be."""
    measured = np.sin(np.linspace(0.0, 20.0, 400))
    window = SimpleNamespace(measured={"motor_position_rad": measured})

    def of(*apart: float):
        here, less, more = ([{"motor_position_rad": measured + one}] for one in apart)
        return _scores(FreeMotion([window], here, [0.0], [less, more]), actuator)["motor_position_rad"]

    assert of(0.2, 0.2005, 0.1995).rmse == pytest.approx(0.2)
    assert (
        np.isnan(of(0.2, 0.15, 0.2).rmse)
        and "a hundred-thousandth more or less put in leads elsewhere" in of(0.2, 0.2, 0.3).reason
    )
    assert np.isnan(of(0.2, np.nan, 0.2).rmse)


def test_true_parameters_follow_the_motion_from_the_recorded_current(actuator):
    """Begun in mid-motion, with a current sensor whose zero is off, which alone adds up to a great deal."""
    recording, other = logged(1, noise_A=0.01, counts=None), logged(2, noise_A=0.01, counts=None)
    biased, unseen = (one.with_signals(current_A=one["current_A"] - 0.04) for one in (recording, other))
    found = compare([biased], actuator.varied(TRUE), calibrate=False, holdout=[unseen]).simulation
    assert set(found) == {"motor_position_rad"}
    one = found["motor_position_rad"]
    print(one)
    assert one.fitted.percent_of_range < 0.5 and one.holdout is not None and one.holdout.percent_of_range < 0.5
    assert one.fitted.mae <= one.fitted.rmse < 0.5
    assert one.at_fitted_offset is not None and one.at_fitted_offset.rmse < 3.0
    assert free_motion([biased], actuator.varied(TRUE)).offsets[0] == pytest.approx(0.04, abs=0.01)


def test_wrong_parameters_are_off_by_what_another_integration_says(actuator):
    recording = logged(3, noise_A=0.01, counts=None)
    wrong = {**TRUE, "motor.inertia_kgm2": 1.3e-4, "motor.viscous_friction_Nms_rad": 8e-5}
    free = free_motion([recording], actuator.varied(wrong))
    window, shown = free.windows[0], free.signals[0]["motor_position_rad"]
    there = by_hand(recording, 1.3e-4, 8e-5, 0.011, free.offsets[0], (window.user_rad, window.speed_rad_s))
    error = recording["motor_position_rad"][1:] - there[1:]
    one = compare([recording], actuator.varied(wrong), calibrate=False).simulation["motor_position_rad"].fitted
    print(one, np.sqrt(np.mean(error**2)), np.abs(shown - there[1:]).max())
    assert one.rmse == pytest.approx(np.sqrt(np.mean(error**2)), rel=0.03)
    assert one.mae == pytest.approx(np.mean(np.abs(error)), rel=0.03)
    assert one.percent_of_range == pytest.approx(100.0 * one.rmse / np.ptp(recording["motor_position_rad"]), rel=1e-2)


def test_what_adds_up_to_as_much_as_the_motion_has_no_number_but_a_reason(actuator):
    """A third of the inertia and no friction: nothing holds back what the torque is off by."""
    recording = logged(4, noise_A=0.01, counts=None)
    bare = {**dict.fromkeys(TRUE, 1e-6), "motor.inertia_kgm2": 0.35e-4}
    result = compare([recording], actuator.varied(bare), calibrate=False)
    told = json.loads(json.dumps(result.to_dict()))["simulation"]["motor_position_rad"]
    assert told["rmse"] is None and told["mae"] is None and told["percent_of_range"] is None
    assert "adds up" in told["reason"] and "rms" in told["reason"]
    assert f"No free simulation of the motor position: {told['reason']}." in str(result)


def test_a_closed_loop_s_free_simulation_is_what_its_table_of_errors_says():
    """One number in every place: the model follows the command, and nothing else was ever put in."""
    noise = Sensors(current_noise_A=0.1, encoder_bits=16)
    made = [noise.record(simulate_reference(Run(duration_s=0.2), load_actuator()), seed) for seed in (1, 2)]
    result = compare(made[:1], holdout=made[1:])
    told = result.to_dict()
    assert set(told["simulation"]) == set(told["signals"])
    for name, one in told["simulation"].items():
        assert one["rmse"] == told["signals"][name]["rmse"] and one["mae"] == told["signals"][name]["mean_absolute"]
        assert one["holdout_rmse"] == told["holdout"][0]["signals"][name]["rmse"]
        assert one["unit"] == {"current_A": "A", "motor_speed_rad_s": "rad/s"}.get(name, "rad")
        assert one["holdout_rmse_at_fitted_offset"] is None and one["reason"] == ""
    assert "free simulation" in str(result)


@pytest.fixture
def axis(tmp_path):
    (tmp_path / "axis.toml").write_text(
        """
[axes]
motor = "linear"
user = "linear"
[controller]
kind = "unknown"
[motor]
force_constant_N_A = 50.0
mass_kg = { value = 90.0, sigma = 10.0 }
viscous_friction_Ns_m = { value = 200.0, sigma = 50.0 }
static_friction_N = 20.0
dynamic_friction_N = { value = 18.0, sigma = 5.0 }
""",
        encoding="utf-8",
    )
    return load_actuator(tmp_path / "axis.toml")


def stroke(seed: int, asymmetry_N: float = 3.0) -> Measurement:
    """A force-driven table of 95 kg: its motion in closed form, its force from it, with noise on what is recorded."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, 6.0, 2e-3)
    rates, sizes = 2.0 * np.pi * np.array([[0.45], [0.8]]), np.array([[0.08], [0.03]])
    phases = rates * time + random.uniform(0.0, 2.0 * np.pi, (2, 1))
    position, speed = np.sum(sizes * np.sin(phases), axis=0), np.sum(sizes * rates * np.cos(phases), axis=0)
    force = -95.0 * np.sum(sizes * rates**2 * np.sin(phases), axis=0) + 210.0 * speed
    force += 20.0 * np.sign(speed) + asymmetry_N
    signals = {
        "time_s": time,
        "motor_position_m": position + 1e-6 * random.standard_normal(time.size),
        "motor_force_N": force + 0.5 * random.standard_normal(time.size),
    }
    return Measurement(signals, name=f"stroke {seed}")


def test_a_force_driven_axis_is_scored_in_metres(axis):
    """Calibrated by inverse dynamics; what it lacks, a constant force, is the offset that is estimated."""
    result = compare([stroke(1)], axis, holdout=[stroke(2)])
    told = result.to_dict()["simulation"]["motor_position_m"]
    one = result.simulation["motor_position_m"]
    print(told)
    assert told["unit"] == "m" and told["rmse"] == one.fitted.rmse < 2e-3 and one.fitted.percent_of_range < 1.0
    assert one.holdout is not None and told["holdout_rmse"] == one.holdout.rmse < 2e-3
    assert "Motor force" in str(result)  # a force has a least noise as well


@pytest.mark.long
def test_a_discovery_scores_its_last_model_as_a_comparison_does(actuator):
    def hidden(angle, speed):
        return 0.004 * np.sin(angle)

    recordings = [logged(seed, noise_A=0.02, counts=None, hidden=hidden) for seed in (5, 6)]
    found = discover(recordings[:1], actuator, holdout=recordings[1:], candidates=["cogging_torque"], most_effects=1)
    told = found.to_dict()["simulation"]["motor_position_rad"]
    again = compare(recordings[:1], found.actuator, calibrate=False, holdout=recordings[1:])
    its = again.to_dict()["simulation"]["motor_position_rad"]
    print(told, its)
    assert [one.name for one in found.effects] == ["cogging_torque"]
    assert told["rmse"] == pytest.approx(its["rmse"], rel=1e-3)
    assert told["holdout_rmse"] == pytest.approx(its["holdout_rmse"], rel=1e-3)
    assert "free simulation" in str(found)
