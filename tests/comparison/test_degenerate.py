"""Recordings with nothing to divide by: no noise, no motion, one value, one unknown or none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.comparison import compare
from ema_model.comparison.words import errors, held_out
from ema_model.discovery import discover
from ema_model.estimation.floor import floor
from ema_model.identification.objective import Objective
from ema_model.identification.run import identify
from ema_model.models import ClosedLoop, InverseDynamics
from ema_model.recordings import Measurement, SideFile
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
    assert found.adequate is (errors.rmse <= errors.noise_floor)


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
def test_where_nothing_moves_the_model_is_right_and_k_is_healthy(simulate):
    still = simulate(STILL, ACTUATOR)
    found = compare([still], ACTUATOR)
    assert found.adequate and found.calibration is not None and found.calibration.converged
    answer = identify(Objective([still], ACTUATOR), population=10, iterations=5)
    assert answer.uncertainty.adequate and answer.uncertainty.healthy


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
    assert found.effects or found.unknown is not None


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
