"""The improved model survives its file: faults, effects and curves are read back, and the error with them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache

import pytest

from ema_model.actuator import load_actuator, save_actuator
from ema_model.commands import command
from ema_model.comparison import compare
from ema_model.discovery import discover, verified
from ema_model.discovery.words import verification
from ema_model.estimation.model_fit import with_effect
from ema_model.faults import vector
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()
RIG = Sensors(current_noise_A=0.3, encoder_bits=12)
FAULT, HIDDEN = {"k1": 0.3}, {"cogging_torque": {"amplitude_Nm": 0.02, "order": 12.0}}
CHIRP = Run(command("chirp"), 0.4)
SINE = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.4)
UNSEEN = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5.0}), 0.3)


def recorded(run, effects, seed=0, faults=FAULT):
    return RIG.record(simulate_reference(run, ACTUATOR, vector(faults), effects), seed)


@cache
def recordings():
    return tuple(recorded(run, HIDDEN, seed) for seed, run in enumerate((CHIRP, SINE, UNSEEN)))


@cache
def improved():
    *fitted, unseen = recordings()
    found = discover(fitted, ACTUATOR, holdout=[unseen], candidates=("cogging_torque",), most_effects=1)
    assert list(found.faults) == ["k1"] and [one.name for one in found.effects] == ["cogging_torque"]
    return found


@pytest.fixture
def saved(tmp_path):
    save_actuator(improved().actuator, tmp_path / "better.toml")
    return tmp_path / "better.toml"


@pytest.mark.long
def test_the_saved_model_reaches_the_last_rung_of_the_ladder(saved):
    found, again = improved(), load_actuator(saved)
    low, high = found.faults["k1"].interval90
    assert low < 0.3 < high and high - low < 0.2
    assert again.faults == {"k1": found.faults["k1"].value}
    # the file keeps tolerances relative to values, which may have moved by their last bits
    sigmas = {path: one.sigma for path, one in again.tolerances.items()}
    assert sigmas == pytest.approx({path: one.sigma for path, one in found.actuator.tolerances.items()}, rel=1e-12)
    assert replace(again, tolerances=found.actuator.tolerances) == found.actuator
    last = found.ladder[-1]
    compared = compare(recordings()[:2], again, calibrate=False)
    assert compared.adequate
    for name, error in compared.signals.items():
        if name in last.signals:
            assert error.rmse == pytest.approx(last.signals[name], rel=0.02)
    unseen = compare(recordings()[2:], again, calibrate=False)
    assert unseen.signals["current_A"].rmse == pytest.approx(last.holdout_signals["current_A"], rel=0.02)


def test_the_saved_tolerances_are_what_was_found(saved):
    """The fault has none: a k may be anywhere in 0 … 1 at the next fit, too."""
    found, again = improved(), load_actuator(saved)
    parameters = found.calibration.parameters
    amplitude = parameters["effects.cogging_torque.amplitude_Nm"]
    low, high = amplitude.interval90
    assert amplitude.sigma == pytest.approx((high - low) / 2 / 1.645) and amplitude.sigma < 0.1 * amplitude.value
    assert again.faults == {"k1": found.faults["k1"].value}
    told = 0
    for path, one in again.tolerances.items():
        before = ACTUATOR.tolerances.get(path)
        if before and (path not in parameters or parameters[path].sigma >= 0.9 * before.sigma):
            assert one.sigma == pytest.approx(before.sigma)
        else:
            told += 1
            assert one.sigma == pytest.approx(parameters[path].sigma)
    assert told >= 5 and "effects.cogging_torque.phase_rad" in again.tolerances


def test_a_fit_with_the_saved_tolerances_counts_what_was_known(tmp_path):
    """Twice the same information: each σ falls by √2; of a recording that tells nothing more, none would."""
    guessed = with_effect(replace(ACTUATOR, faults=FAULT), "cogging_torque", {"amplitude_Nm": 0.018, "order": 12.0})
    free = ["effects.cogging_torque.amplitude_Nm", "motor.inertia_kgm2", "transmission.backlash_rad"]
    first = compare(recordings()[:1], guessed, free=free).calibration
    assert first is not None
    save_actuator(first.actuator, tmp_path / "first.toml")
    again = load_actuator(tmp_path / "first.toml")
    second = compare(recordings()[:1], again, free=free).calibration
    assert second is not None
    for path in free:
        known, sigma = first.parameters[path], again.tolerances[path].sigma
        assert sigma == pytest.approx(known.sigma) and sigma < 0.5 * guessed.tolerances[path].sigma
        assert second.parameters[path].sigma == pytest.approx(sigma / 2**0.5, rel=0.1)
        assert abs(second.parameters[path].value - known.value) < 0.5 * sigma


@pytest.mark.long
def test_an_effect_that_the_file_knows_closely_is_found_at_another_strength(saved):
    stronger = {"cogging_torque": {"amplitude_Nm": 0.035, "order": 12.0}}
    given = [recorded(CHIRP, stronger, 10), recorded(SINE, stronger, 9)]
    found = discover(given, load_actuator(saved), candidates=("cogging_torque",), most_effects=1)
    assert found.verdict == "effects_found" and found.calibration.converged and not found.faults
    amplitude = found.effects[0].parameters["amplitude_Nm"]
    assert amplitude.value == pytest.approx(0.035, abs=3.0 * amplitude.sigma)
    assert found.actuator.tolerances["effects.cogging_torque.amplitude_Nm"].sigma == amplitude.sigma


@pytest.mark.long
def test_the_saved_model_is_verified_in_units_of_the_floor(saved):
    found = improved()
    told = verified(found, saved)
    assert told.rmse == pytest.approx(found.ladder[-1].rmse, rel=0.01) and not told.is_worse
    assert told.holdout_rmse == pytest.approx(found.ladder[-1].holdout_rmse, rel=0.01)
    said = verification(found, told)
    assert re.fullmatch(r"verified: [\d.]+ × the floor, [\d.]+ × on what was not fitted", said)


@pytest.mark.long
def test_json_is_whole_and_plain():
    document = json.loads(json.dumps(improved().to_dict(), allow_nan=False))
    assert document["verdict"] == "effects_found"
    assert {"name", "parameters", "rmse_before", "rmse_after", "holdout_rmse_after", "same_as"} <= set(
        document["effects"][0]
    )
    assert {(rung["label"], rung["kind"], *rung["names"]) for rung in document["ladder"]} == {
        ("calibrated", "calibrated"),
        ("fault k1 friction", "fault", "k1"),
        ("+ cogging_torque", "effect", "cogging_torque"),
    }
    assert document["candidates"][0]["tested"] is True


def test_a_file_that_lost_a_part_of_the_model_is_told(tmp_path):
    found = improved()
    save_actuator(replace(found.actuator, faults={}), tmp_path / "lost.toml")
    told = verified(found, tmp_path / "lost.toml")
    assert told.is_worse and told.rmse > 1.2 * found.ladder[-1].rmse
    assert "which is worse than the" in verification(found, told)


def test_known_faults_are_where_runs_comparisons_and_discoveries_start():
    worn = replace(ACTUATOR, faults=FAULT)
    recording = recorded(CHIRP, {})
    own = simulate_reference(CHIRP, worn)
    assert (own["current_A"] == simulate_reference(CHIRP, ACTUATOR, vector(FAULT))["current_A"]).all()
    assert (own["current_A"] != simulate_reference(CHIRP, ACTUATOR)["current_A"]).any()
    assert compare([recording], worn, calibrate=False).adequate
    assert not compare([recording], worn, k=vector({}), calibrate=False).adequate
    found = discover([recording], worn, candidates=("cogging_torque",))
    assert not found.faults and found.verdict == "adequate" and found.ladder[0].rmse < 1.1
    assert found.actuator.faults == FAULT, "what is known stays in the model"


def test_a_fault_that_went_on_is_found_from_where_it_is_known():
    worn = replace(ACTUATOR, faults={"k6": 0.2, "k7": 0.7})
    found = discover([recorded(CHIRP, {}, faults={"k6": 0.35, "k7": 0.7})], worn, candidates=("cogging_torque",))
    assert set(found.faults) == {"k6", "k7"} and found.faults["k6"].initial == 0.2
    assert found.actuator.faults["k6"] == pytest.approx(0.35, abs=0.04)
    assert found.actuator.faults["k7"] == pytest.approx(0.7, abs=0.04)
