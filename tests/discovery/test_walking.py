"""When inverse dynamics is walked before the loop, and what is looked for where a score sees nothing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ema_model.actuator import load_actuator
from ema_model.discovery.fingerprints import Fingerprint, variants
from ema_model.discovery.refit import Trial
from ema_model.discovery.candidates.score import scored_all
from ema_model.discovery.result import Candidate
from ema_model.discovery.steps import walking
from ema_model.discovery.history import Story
from ema_model.effects import find


def walk_of(monkeypatch, ranked, floors=50.0, simulates=True, fault=0.0):
    """A walk whose model stands so many floors off, with these candidates, and a fault, for a χ² of 1000."""
    monkeypatch.setattr(walking, "ratio", lambda data, found: floors)
    play = Candidate("k2", fault, {"k2": 0.2})
    monkeypatch.setattr(
        walking, "with_faults", lambda story, effects: sorted([*effects, play], key=lambda one: -one.predicted_drop)
    )
    current = SimpleNamespace(chi2=1000.0, plant=SimpleNamespace(simulates_commands=simulates))
    story = SimpleNamespace(data=None, current=current, left=lambda: None, ranked=lambda names: ranked)
    return walking.Walk(story, lambda text: None, None, 3)


DELAY, COGGING = Candidate("computation_delay", 550.0, {}), Candidate("cogging_torque", 600.0, {})


@pytest.mark.parametrize(
    ("ranked", "given", "untold", "suspected"),
    [
        ([DELAY, COGGING], {}, True, True),
        ([COGGING, DELAY], {}, True, False),
        ([Candidate("dead_band", 900.0, {})], {}, False, True),
        ([DELAY], {"floors": 1.5}, False, False),
        ([DELAY], {"simulates": False}, False, False),
        ([DELAY], {"fault": 900.0}, False, True),
        ([], {}, False, False),
    ],
    ids=[
        "a little of several",
        "an effect first",
        "one thing tells it well",
        "near",
        "without a loop",
        "a fault",
        "none",
    ],
)
def test_a_far_loop_is_untold_and_its_drive_suspected_where_that_tells_a_little(
    monkeypatch, ranked, given, untold, suspected
):
    walk = walk_of(monkeypatch, ranked, **given)
    assert walk.is_untold() is untold and walk.suspects_drive() is suspected


@pytest.mark.parametrize(("fitted", "left"), [((0.3, 4.0), 0.3), ((9.0, 4.0), 4.0), ((9.0,), 9.0)])
def test_the_drives_own_effects_are_refitted_once_before_the_first_step(monkeypatch, fitted, left):
    """COGGING, though promising, waits for the step, which takes over what is known."""
    ranked = [DELAY, COGGING, Candidate("dead_band", 500.0, {})]
    walk = walk_of(monkeypatch, ranked)
    monkeypatch.setattr(walking, "ratio", lambda data, found: found if isinstance(found, float) else 50.0)
    errors = dict(zip(("computation_delay", "dead_band"), fitted))
    tried = []

    def trial(candidate, tell):
        tried.append(candidate.name)
        return SimpleNamespace(candidate=candidate, fit=errors[candidate.name])

    walk.story.promising = lambda ranked, share, most: [one for one in ranked if one.name in (*errors, COGGING.name)]
    walk.story.trial = trial
    assert walk.drive_leaves() == left
    assert tried == list(errors) == [one.candidate.name for one in walk._tried]


@pytest.mark.parametrize(
    ("added", "alike"),
    [
        ([("pendulum_load", ("hinge_moment",))], ["pendulum_load", "hinge_moment"]),
        ([("pendulum_load", ("hinge_moment", "friction_zone"))], ["pendulum_load", "hinge_moment", "friction_zone"]),
        ([("pendulum_load", ())], []),
        ([("inertia_error", ())], []),
        ([], []),
    ],
    ids=["one", "both", "told apart since", "replaced", "taken out"],
)
def test_a_test_is_sought_only_for_rivals_of_the_last_model(added, alike):
    story = SimpleNamespace(added=[SimpleNamespace(name=name, same_as=same) for name, same in added])
    rivals = [
        Trial(Candidate(name, 1.0, {}), {}, SimpleNamespace(), 1.0)
        for name in ("pendulum_load", "hinge_moment", "friction_zone")
    ]
    assert [one.candidate.name for one in walking._still_alike(story, rivals)] == alike
    assert walking._still_alike(story, []) == []


def test_candidates_are_scored_once_for_a_model(monkeypatch):
    asked = []
    walk = walk_of(monkeypatch, [DELAY])
    walk.story.ranked = lambda names: asked.append(names) or [DELAY]
    walk.suspects_drive()
    walk.suspects_drive()
    assert len(asked) == 1


def test_speeds_are_looked_for_at_shares_of_the_recordings_top_speed():
    effect = find("stribeck_friction")
    usual = [one["speed_rad_s"] for [one] in variants(effect, [])]
    slow = [one["speed_rad_s"] for [one] in variants(effect, [], 3.0)]
    assert usual == list(effect.severities)
    assert slow[: len(usual)] == usual and sorted(slow)[:2] == pytest.approx([0.3, 0.9])
    assert [one["torque_Nm"] for [one] in variants(find("constant_load"), [], 3.0)] == list(
        find("constant_load").severities
    )


def test_a_part_of_another_kind_is_a_column_of_its_own():
    """Friction may differ by direction in its viscous part alone."""
    effect = find("asymmetric_friction")
    assert variants(effect, [])[1] == [{"ratio": 0.12}, {"ratio": 0.0, "viscous_part_Nms_rad": pytest.approx(5e-5)}]
    random = np.random.default_rng(0)
    columns, own = random.normal(size=(400, 2)), random.normal(size=(400, 1))
    found = SimpleNamespace(
        residual=-(columns @ [0.5, 3.0]),
        actuator=load_actuator(),
        calibration=SimpleNamespace(room=np.array([[-9.0], [9.0]]), parameters=["p"], starts=[], weighted_jacobian=own),
    )
    [candidate] = scored_all(
        found, [Fingerprint(effect.name, {"ratio": 0.12}, columns, {"viscous_part_Nms_rad": 5e-5})]
    )
    assert candidate.settings == pytest.approx({"ratio": 0.06, "viscous_part_Nms_rad": 1.5e-4}, rel=1e-3)
    assert candidate.predicted_drop == pytest.approx(float(found.residual @ found.residual), rel=0.02)


def test_friction_that_falls_is_tried_from_where_its_whole_change_comes_nearest():
    """The residual asks for the change at 0.3 rad/s, whatever its slope there says."""
    shape = np.sin(np.linspace(0.0, 20.0, 400))
    prints = [
        Fingerprint("stribeck_friction", {"speed_rad_s": 3.0}, 9.0 * shape[:, None]),
        Fingerprint("stribeck_friction", {"speed_rad_s": 0.3}, 4.0 * shape[:, None]),
        Fingerprint("hinge_moment", {"stiffness_Nm_rad": 1.0}, 5.0 * shape[:, None]),
    ]
    story = SimpleNamespace(prints=prints, current=SimpleNamespace(residual=-5.0 * shape), trial=lambda one, tell: one)
    ranked = [Candidate("hinge_moment", 9.0, {}), Candidate("stribeck_friction", 0.0, {"speed_rad_s": 3.0})]
    [tried] = Story.tried_whole(story, ranked, lambda text: None)
    assert tried.name == "stribeck_friction" and tried.settings == {"speed_rad_s": 0.3}


def test_a_stop_while_a_fault_is_tried_first_leaves_the_model_that_was_walked_to(monkeypatch):
    def stopped(candidate, tell):
        raise KeyboardInterrupt

    walk = walk_of(monkeypatch, [])
    story = walk.story
    story.steps, story.bare, story.refused = ["calibrated", "zone", "load"], 1, {"hinge_moment": "unsteady"}
    story.restart = lambda: story.steps.__delitem__(slice(story.bare, None))
    story.trial = stopped
    with pytest.raises(KeyboardInterrupt):
        walk._begin_with(SimpleNamespace(candidate=Candidate("k1", 1.0, {"k1": 0.4})))
    assert story.steps == ["calibrated", "zone", "load"] and story.refused
    story.trial, story.add = lambda candidate, tell: candidate.name, story.steps.append
    walk._near, walk._going = {"zone": []}, False
    walk._begin_with(SimpleNamespace(candidate=Candidate("k1", 1.0, {"k1": 0.4})))
    assert story.steps == ["calibrated", "k1"] and walk._going and not walk._near and not story.refused
