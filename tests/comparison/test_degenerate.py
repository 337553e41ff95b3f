"""Recordings with nothing to divide by: no noise, no motion, one value, one unknown or none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.unknown_drive import drive_of, logged

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.comparison import compare
from ema_model.comparison.result import errors, held_out, verdict
from ema_model.discovery import discover
from ema_model.estimation.noise import floor
from ema_model.identification.run import identify
from ema_model.identification.search import Objective
from ema_model.models import ClosedLoop, InverseDynamics
from ema_model.recordings import Measurement, SideFile
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference

ACTUATOR = load_actuator()
LOOSE = replace(ACTUATOR, controller=replace(ACTUATOR.controller, kind="unknown"))
FIXED = replace(LOOSE, tolerances={})
STILL = Run(command("step", {"initial_rad": 0.0, "final_rad": 0.0}), 0.1)
TIME = np.asarray(np.arange(1500) * 1e-3, float)
ANGLE = np.linspace(0.0, 4.0 * np.pi, 400)


@cache
def noiseless() -> Measurement:
    return replace(simulate_monitor(Run(command("chirp"), 0.1), ACTUATOR), name="noiseless")


def turning(current):
    return Measurement({"time_s": TIME, "motor_position_rad": np.sin(6.0 * TIME), "current_A": current}, name="turning")


def chart(current):
    signals = {"time_s": np.arange(400.0), "motor_position_rad": ANGLE, "current_A": current}
    return Measurement(signals, name="map", side=SideFile(kind="map"))


@pytest.mark.parametrize(
    "recording",
    [
        turning(np.zeros(1500)),
        turning(np.ones(1500)),
        turning(np.sin(6.0 * TIME)),
        turning(np.round(3.0 * np.sin(6.0 * TIME))),
        chart(np.zeros(400)),
        chart(np.ones(400)),
    ],
    ids=["nothing", "one value", "no noise", "coarse steps", "empty map", "constant map"],
)
def test_a_motion_with_a_current_that_has_no_noise_is_compared(recording):
    found = compare([recording], LOOSE, calibrate=False)
    errors = found.signals["current_A"]
    assert errors.noise_floor > 0.0 and found.sentences
    constant = bool(np.ptp(recording["current_A"]) == 0.0)
    assert found.uninformative is constant
    assert found.adequate is (not constant and errors.rmse <= errors.noise_floor)


def test_a_noiseless_recording_of_a_perfect_model_is_searched_for_effects():
    # Its third differences say 1e-9 rad: JᵀJ alone does not hold the prior beside such weights.
    found = discover([noiseless()], ACTUATOR, candidates=("constant_load",))
    assert found.verdict == "adequate" and found.ladder[-1].rmse < 1.0


@pytest.mark.long
def test_a_current_at_its_limit_throughout_has_an_answer():
    limit = np.full(noiseless().samples, ACTUATOR.controller.current_limit_A)
    saturated = noiseless().with_signals(current_A=limit)
    assert not compare([saturated], ACTUATOR, calibrate=False).adequate
    assert discover([saturated], ACTUATOR, candidates=("constant_load",)).ladder[0].rmse > 10.0


def test_a_hundred_samples_have_an_answer():
    short = noiseless().selected((0.0, 0.01))
    assert short.samples == 101 and compare([short], ACTUATOR).sentences
    assert discover([short], ACTUATOR, candidates=("constant_load",)).ladder[0].rmse < 1.0


@pytest.mark.parametrize("simulate", [simulate_reference, simulate_monitor])
def test_where_nothing_moves_nothing_is_told_of_model_or_k(simulate):
    still = simulate(STILL, ACTUATOR)
    found = compare([still], ACTUATOR)
    assert found.verdict == "uninformative" and found.over_floor < 1.0
    assert found.calibration is not None and found.calibration.converged
    sure = identify(Objective([still], ACTUATOR), population=10, iterations=5).uncertainty
    assert sure.uninformative and not sure.healthy and not sure.alarms


def test_a_sensor_that_is_said_to_have_no_noise_still_has_a_floor():
    plant = ClosedLoop([noiseless()], ACTUATOR)
    found = floor(plant, 0, stated={"current_A": {"noise": 0.0}})
    assert found.noise["current_A"] > 0.0


@pytest.mark.parametrize("free", [["motor.inertia_kgm2"], []], ids=["one", "none"])
def test_one_unknown_or_none_is_left(free):
    recording = turning(np.sin(6.0 * TIME) + 0.1 * np.random.default_rng(0).standard_normal(1500))
    found = compare([recording], LOOSE, free=free).calibration
    assert found is not None and list(found.parameters) == free and found.converged


def test_a_held_out_recording_of_which_only_the_start_is_unknown():
    rigid = replace(ACTUATOR, transmission=replace(ACTUATOR.transmission, backlash_rad=0.0))
    recording = replace(simulate_monitor(Run(command("chirp"), 0.1), rigid), name="rigid")
    found = discover([recording], rigid, holdout=[without_the_end(recording)], candidates=("constant_load",))
    assert found.ladder[0].holdout_rmse is not None and found.ladder[0].holdout_rmse < 1.0


def test_nothing_to_calibrate_at_all_is_searched_for_effects():
    plant = InverseDynamics([turning(np.ones(1500))], FIXED)
    assert not plant.simulates_commands
    needed = plant.signals(0)["current_A"][0]
    offset = turning(np.ones(1500)).with_signals(current_A=_filled(plant, needed) + 0.2)
    found = discover(
        [offset], FIXED, holdout=[without_the_end(offset)], candidates=("current_sensor_bias", "constant_load")
    )
    assert found.effects or found.unknown is not None or found.parameters_outside_tolerance


def without_the_end(recording: Measurement) -> Measurement:
    """The same but for its last samples: what is fitted is not held out."""
    return recording.selected((0.0, recording.time_s[-10]))


def _filled(plant: InverseDynamics, needed: np.ndarray) -> np.ndarray:
    """What the motion needs at each sample, from its blocks."""
    return np.interp(TIME, plant.windows[0].time_s, needed)


@pytest.mark.parametrize(("noise_rad_s", "told"), [(0.0, False), (0.5, True)])
def test_an_error_is_counted_in_floors_only_where_the_recording_tells_its_noise(noise_rad_s, told):
    """A drive that tells a speed of 0 at rest, and rests, tells nothing of that signal's noise."""
    still = simulate_reference(STILL, ACTUATOR)
    noise = np.random.default_rng(0).standard_normal(still.samples)
    speed, current = still["motor_speed_rad_s"] + noise_rad_s * noise, still["current_A"] + 0.1 * noise
    seen = still.with_signals(current_A=current, motor_speed_rad_s=speed)
    table = errors(compare([seen], ACTUATOR))
    rows = {row[0]: row[-1] for row in table.rows}
    assert rows["Equivalent current"] != "–" and (rows["Motor speed"] != "–") is told
    [unseen] = compare([seen], ACTUATOR, holdout=[without_the_end(seen)]).holdout
    [speed] = [part for part in held_out(unseen).split(", ") if part.startswith("motor speed")]
    assert ("(floor " in speed) is told


# --- recordings that tell nothing of the model -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def healthy() -> Measurement:
    return simulate_reference(Run(duration_s=0.2), load_actuator())


def silenced(recording: Measurement, **signals: float) -> Measurement:
    """With these signals constant."""
    return recording.with_signals(**{name: np.full(recording.samples, value) for name, value in signals.items()})


STANDING = dict.fromkeys(
    ("command_rad", "user_position_rad", "motor_position_rad", "motor_speed_rad_s", "current_A"), 0.0
)


@pytest.mark.parametrize(
    "made",
    [
        lambda one: silenced(one, **STANDING),
        lambda one: silenced(one, **{**STANDING, "current_A": 1.3}),
        lambda one: silenced(one, current_A=0.0),
        lambda one: Sensors(current_noise_A=0.2).record(silenced(one, **STANDING), 1),
        lambda one: Sensors(current_noise_A=12.0).record(one, 1),
    ],
    ids=["all zeros", "constant", "a dead current sensor", "noise at rest", "noise above the current"],
)
def test_a_recording_that_tells_nothing_is_uninformative(healthy, made):
    """Whatever the model: it is not adequate by what was never measured."""
    result = compare([made(healthy)])
    told = result.to_dict()
    assert told["verdict"] == "uninformative" and not told["adequate"]
    assert not told["explained_by"] and not told["worst_regions"] and not told["events"]
    assert told["signals"]["current_A"]["informative"] is False
    assert told["sentences"][0].startswith("These recordings tell nothing of the model: the equivalent current ")
    assert "explains" not in str(result) and verdict(result) == "uninformative"


def test_a_motion_differentiated_to_more_than_the_current_is_uninformative(tmp_path):
    """A coarse encoder's floor, some amperes, beside a current that is smaller."""
    found = compare([logged(1, noise_A=0.05, counts=1.0)], drive_of(tmp_path, leaves_out_reversals=False))
    error = found.signals["current_A"]
    print(error)
    assert error.noise_floor > error.signal_rms * 0.9 and found.verdict == "uninformative"


def test_one_recording_of_two_that_tells_nothing_is_named(healthy):
    """The other one decides."""
    sensors = Sensors(current_noise_A=0.1, encoder_bits=16)
    still = replace(sensors.record(silenced(healthy, **STANDING), 2), name="parked")
    both = compare([replace(sensors.record(healthy, 1), name="moves"), still]).to_dict()
    assert both["verdict"] == "adequate"
    assert [one["signals"]["current_A"]["informative"] for one in both["recordings"]] == [True, False]
    assert any(one.startswith("parked tells nothing of the model: the equivalent current") for one in both["warnings"])


@pytest.mark.long
def test_neither_a_discovery_nor_an_identification_calls_it_adequate(healthy):
    noisy = Sensors(current_noise_A=12.0).record(healthy, 1)
    found = discover([noisy], candidates=["cogging_torque"], most_effects=1)
    assert found.verdict == "uninformative" and "tell nothing" in str(found)
    sure = identify(Objective([silenced(healthy, current_A=0.0)], load_actuator())).uncertainty
    assert sure.uninformative and not sure.adequate and not sure.healthy and not sure.alarms
