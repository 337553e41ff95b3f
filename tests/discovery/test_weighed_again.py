"""Of two effects that are alike, the one is told from the other once what both left is in the model as well."""

from __future__ import annotations

import json

import pytest
from support.hidden_effects import ACTUATOR, recorded

from ema_model.discovery import as_dict, begun, result_of
from ema_model.discovery.result import Change
from ema_model.discovery.steps.weighed_again import near, weigh_again
from ema_model.discovery.words import rung_label, rung_title
from emaviz.session.discover.history import steps_of, take_again

COMMANDS = [("chirp", {}, 0.5), ("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}, 1.0)]
HIDDEN = {"stribeck_friction": {"speed_rad_s": 10.0}, "screw_lead_error": {"amplitude_rad": 1e-5}}
ALIKE = ("screw_lead_error", "encoder_eccentricity")


@pytest.fixture(scope="module")
def wrong():
    """A model with the wrong one of the two, then what both left; and the right one, as it was tried beside it."""
    story = begun(recorded(90, commands=COMMANDS, effects=HIDDEN), ACTUATOR)
    trials = [story.trial(one) for one in story.ranked(ALIKE)]
    best = next(one for one in trials if one.candidate.name == "encoder_eccentricity")
    rivals = near(best, trials)
    story.add(best, ties=[one.candidate.name for one in rivals])
    story.add(story.trial(next(one for one in story.ranked(("stribeck_friction",)))))
    return story, rivals


def bare(story):
    """The same calibrated model, without any step."""
    other = begun(story.data.measurements, ACTUATOR)
    assert other.base.chi2 == pytest.approx(story.base.chi2, rel=1e-3)
    return other


@pytest.mark.long
def test_the_right_one_comes_into_its_place(wrong):
    story, rivals = wrong
    assert [one.candidate.name for one in rivals] == ["screw_lead_error"], "at first they cannot be told apart"
    before = story.ladder[-1].rmse
    weigh_again(story, {"encoder_eccentricity": rivals}, lambda text: None)
    assert [one.name for one in story.added] == ["screw_lead_error", "stribeck_friction"]
    assert story.ladder[-1].rmse < before and story.added[0].same_as == ()
    change = story.ladder[-1].change
    assert change == Change("replaced", ("encoder_eccentricity", "screw_lead_error"))
    assert rung_title(change, ACTUATOR.axes) == "Screw lead error in place of encoder eccentricity"
    assert rung_label(change, ACTUATOR.axes) == "screw_lead_error in place of encoder_eccentricity"
    told = json.loads(json.dumps(as_dict(result_of(story))))
    assert told["ladder"][-1]["kind"] == "replaced"
    again = bare(story)
    take_again(again, steps_of(story), lambda text: None, lambda: None)
    assert [one.name for one in again.added] == [one.name for one in story.added], "a session takes the step again"
    weigh_again(story, {"screw_lead_error": []}, lambda text: None)
    assert story.ladder[-1].change == change


@pytest.mark.long
def test_the_one_that_is_right_stays_and_is_no_longer_named_beside_the_other(wrong):
    story = bare(wrong[0])
    trials = [story.trial(one) for one in story.ranked(ALIKE)]
    best = next(one for one in trials if one.candidate.name == "screw_lead_error")
    story.add(best, ties=["encoder_eccentricity"])
    story.add(story.trial(next(one for one in story.ranked(("stribeck_friction",)))))
    weigh_again(story, {"screw_lead_error": near(best, trials)}, lambda text: None)
    assert story.added[0].name == "screw_lead_error" and story.added[0].same_as == ()
    assert len(story.ladder) == 3
