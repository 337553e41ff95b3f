"""Faults in the ranking of the effects: offered beside what looks alike, added by hand, taken out, taken back."""

from __future__ import annotations

import pytest
from support.representative import first_of

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.comparison.thresholds import BAND
from ema_model.discovery import begun, discover, result_of
from ema_model.discovery.next_experiment import next_experiment
from ema_model.discovery.result import Candidate, Change
from ema_model.discovery.snapshot import assessed
from ema_model.discovery.words import PAGES, candidates, effect_title, rung_label, rung_title, size, typical
from ema_model.faults import BY_NAME, CAUSES, vector
from ema_model.quantities import ROTARY
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.run import Run, simulate_reference

ACTUATOR = load_actuator()
RIG = Sensors(current_noise_A=0.45, encoder_bits=12)
CHIRP = Run(command("chirp"), 0.5)
SINE = Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5)
UNSEEN = Run(command("sine", {"amplitude_rad": 0.02, "frequency_Hz": 5.0}), 0.5)
FIRSTS = {names[0] for names in CAUSES}


def recorded(run, faults, seed):
    return RIG.record(simulate_reference(run, ACTUATOR, vector(faults), {}), seed)


def worn(faults):
    """The calibrated, healthy model beside an actuator with these faults."""
    recordings = [recorded(run, faults, seed) for seed, run in enumerate((CHIRP, SINE))]
    return begun(recordings, ACTUATOR, [recorded(UNSEEN, faults, 9)])


def card(assessment, name):
    return next(one for one in assessment.candidates if one.name == name)


@pytest.mark.long
@pytest.mark.parametrize(
    "faults", first_of([{"k1": 0.3}, {"k2": 0.3}, {"k3": 0.25}, {"k6": 0.3, "k7": 0.7}, {"k8": 0.8}])
)
def test_a_fault_is_a_card_that_is_added_taken_out_and_taken_back(faults):
    name, value = next(iter(faults.items()))
    story = worn(faults)
    healthy = story.ladder[0].rmse
    assessment = assessed(story)
    names = [one.name for one in assessment.candidates]
    assert FIRSTS <= set(names), "each fault is offered, an eccentricity once"
    probable = [one.probability for one in assessment.candidates]
    assert probable == sorted(probable, reverse=True)
    first = names[0]
    assert first == name or name in assessment.alike[first]
    one = card(assessment, name)
    left = story.current.residual + assessment.signatures[name]
    assert left @ left == pytest.approx(story.current.chi2 - one.predicted_drop, rel=0.1, abs=0.1 * one.predicted_drop)

    trial = story.trial(one)
    story.add(trial, assessment.alike.get(name, ()))
    story.finish()
    assert set(story.current.faults) == set(faults) and not story.added
    assert story.ladder[-1].rmse < BAND and story.ladder[-1].holdout_rmse < BAND < story.ladder[0].rmse
    found = result_of(story)
    low, high = found.faults[name].interval90
    assert low <= value <= high or found.faults[name].value == pytest.approx(value, abs=0.03)
    assert not {one.name for one in assessed(story).candidates} & set(faults), "it is offered once"

    story.remove(name)
    assert story.ladder[-1].change == Change("removed", tuple(faults)) and not story.current.faults
    assert story.ladder[-1].rmse == pytest.approx(story.ladder[0].rmse, rel=0.02)
    assert story.undo() and set(story.current.faults) == set(faults) and story.ladder[-1].rmse < BAND
    assert story.undo() and not story.current.faults
    assert story.ladder[-1].rmse == pytest.approx(healthy, rel=0.05), "by a floor that was measured beside the fault"


@pytest.mark.long
def test_a_step_after_a_fault_is_beside_it_and_the_fault_may_go_first():
    story = worn({"k2": 0.3})
    story.add(story.trial(card(assessed(story), "k2")))
    story.add(story.trial(Candidate("viscous_friction", 0.0, {"coefficient_Nms_rad": 1e-5})))
    assert story.current.faults == ("k2",) and [one.name for one in story.added] == ["viscous_friction"]
    story.remove("k2")
    assert not story.current.faults and [one.name for one in story.added] == ["viscous_friction"]
    assert story.ladder[-1].rmse > 10.0 * story.ladder[1].rmse
    labels = [rung_label(rung.change, ROTARY) for rung in story.ladder]
    assert labels == ["calibrated", "fault k2 backlash", "+ viscous_friction", "− fault k2 backlash"]


@pytest.mark.long
def test_the_command_line_ranks_faults_beside_effects():
    recordings = [recorded(run, {"k2": 0.3}, seed) for seed, run in enumerate((CHIRP, SINE))]
    found = discover(recordings, ACTUATOR, holdout=[recorded(UNSEEN, {"k2": 0.3}, 9)])
    assert list(found.faults) == ["k2"] and not found.effects
    ranked = found.to_dict()["candidates"]
    assert ranked[0]["name"] == "k2" and ranked[0]["family"] == "fault" and ranked[0]["tested"]
    assert ranked[0]["settings"].keys() == {"k2"}
    assert FIRSTS <= {one["name"] for one in ranked}
    table = candidates(found)
    assert table is not None and table.rows[0][0] == "Backlash (fault k2)"


@pytest.mark.long
def test_a_test_is_sought_between_a_fault_and_an_effect():
    story = worn({"k1": 0.3})
    assessment = assessed(story)
    found = next_experiment(story.data, *(story.trial(card(assessment, name)) for name in ("k1", "demagnetisation")))
    assert found is not None and found.separates == ("k1", "demagnetisation")


def test_names_and_sizes():
    assert effect_title("k2") == "Backlash (fault k2)" and effect_title("k6") == "Rotor eccentricity (fault k6)"
    assert rung_title(Change("removed", ("k6", "k7")), ROTARY) == "− Rotor eccentricity (fault k6)"
    assert rung_title(Change("fault", ("k6", "k7")), ROTARY) == "Fault k6 eccentricity"
    assert typical("k3", ACTUATOR) == "phase A: 75 % of turns to 25 % of turns (k3 0.25 to 0.75)"
    assert size(Candidate("k1", 0.0, {"k1": 0.3}), ACTUATOR) == "friction × 1.60, k1 ≈ 0.30"
    turned = size(Candidate("k6", 0.0, {"k6": 0.3, "k7": 0.7}), ACTUATOR)
    assert turned == "eccentricity ζ = 0.30, thinnest gap at +72°, k6 ≈ 0.30"
    assert typical("k8", ACTUATOR) == "gain × 0.75 to 1.25 (k8 0.25 to 0.75)"
    assert PAGES.keys() == FIRSTS and FIRSTS <= BY_NAME.keys()
