"""Faults of the actuator beside missing physics: a worn actuator is no missing effect, and hides none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.comparison.thresholds import BAND
from ema_model.discovery import discover
from ema_model.discovery.discover import result_of
from ema_model.discovery.history import begun
from ema_model.discovery.result import Change
from ema_model.discovery.search import Search
from ema_model.discovery.terms import noise_of, terms_of
from ema_model.estimation.model_fit import holdout_error
from ema_model.faults import CAUSES, vector
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()
RIG = Sensors(current_noise_A=0.45, encoder_bits=12)
CHIRP = Run(command("chirp"), 0.5)
SINE = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5)
UNSEEN = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5.0}), 0.5)


def recorded(run, faults, effects=None, seed=0):
    return RIG.record(simulate_reference(run, ACTUATOR, vector(faults), effects or {}), seed)


def found_in(faults, effects=None):
    recordings = [recorded(run, faults, effects, seed) for seed, run in enumerate((CHIRP, SINE))]
    return discover(recordings, ACTUATOR, holdout=[recorded(UNSEEN, faults, effects, 9)])


LONG = [
    pytest.param(one, marks=pytest.mark.long)
    for one in ({"k2": 0.02}, {"k1": 0.3}, {"k3": 0.25}, {"k8": 0.3}, {"k8": 0.8})
]


@pytest.mark.parametrize("fault", [{"k2": 0.4}, *LONG])
def test_a_fault_is_named_and_no_physics_beside_it(fault):
    [(name, value)] = fault.items()
    found = found_in(fault)
    assert found.verdict == "adequate" and list(found.faults) == [name] and not found.parameters_outside_tolerance
    low, high = found.faults[name].interval90
    assert low <= value <= high or found.faults[name].value == pytest.approx(value, abs=0.03)
    last = found.ladder[-1]
    assert last.rmse < BAND and last.holdout_rmse is not None and last.holdout_rmse < BAND < found.ladder[0].rmse


@pytest.mark.long
def test_missing_physics_is_found_beside_two_faults():
    found = found_in({"k1": 0.3, "k2": 0.2}, {"stribeck_friction": {"speed_rad_s": 10.0}})
    assert [one.name for one in found.effects] == ["stribeck_friction"] and set(found.faults) == {"k1", "k2"}
    speed = found.effects[0].parameters["speed_rad_s"]
    assert speed.value == pytest.approx(10.0, rel=0.15)
    assert found.ladder[-1].rmse < BAND and found.ladder[-1].holdout_rmse < BAND


@pytest.mark.long
def test_an_effect_stays_one_where_a_fault_tells_less():
    found = found_in({}, {"cogging_torque": {"amplitude_Nm": 0.012, "order": 12.0}})
    assert [one.name for one in found.effects] == ["cogging_torque"] and not found.faults


@pytest.mark.long
def test_an_eccentric_rotor_comes_before_a_ripple_of_few_periods_which_is_said():
    found = found_in({"k6": 0.3, "k7": 0.7})
    assert set(found.faults) == {"k6", "k7"} and not found.effects
    assert found.faults["k6"].value == pytest.approx(0.3, abs=0.03)
    assert found.faults["k7"].value == pytest.approx(0.7, abs=0.03)
    assert "Torque ripple would explain as much as the fault k6 eccentricity." in found.warnings
    found = found_in({}, {"torque_ripple": {"ratio": 0.2, "order": 12.0}})
    assert [one.name for one in found.effects] == ["torque_ripple"] and not found.faults


@pytest.mark.long
def test_a_fault_stays_in_the_model_that_is_judged_shown_and_taken_back():
    recordings = [recorded(run, {"k2": 0.2}, seed=seed) for seed, run in enumerate((CHIRP, SINE))]
    story = begun(recordings, ACTUATOR, [recorded(UNSEEN, {"k2": 0.2}, seed=9)])
    healthy = story.current
    search = Search(story)
    search.step()
    assert story.current.faults == ("k2",) and story.ladder[-1].change == Change("fault", ("k2",)) and not story.added
    assert story.held is not None
    assert holdout_error(story.held, story.current) < 1.1 < holdout_error(story.held, healthy)
    search.step()
    assert len(story.steps) == 2, "there is no second one"
    told = result_of(story).to_dict()
    assert told["faults"]["k2"]["value"] == pytest.approx(0.2, abs=0.02)
    story.restart()
    assert story.current.faults == ("k2",), "effects are taken back, faults are not effects"
    assert story.undo() and story.current is healthy


def test_other_actuators_have_no_such_faults():
    story = begun([recorded(CHIRP, {"k2": 0.2})], ACTUATOR)
    servo = replace(story.current, actuator=load_actuator("assets/actuators/xl330.toml"))
    noise = noise_of(story.data, story.current)
    assert {one.name for one in terms_of(story.data, story.current, [], noise, [])} == {names[0] for names in CAUSES}
    assert terms_of(story.data, servo, [], noise, []) == []
    assert np.all(story.current.calibration.k == vector({}))
