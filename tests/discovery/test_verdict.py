"""The verdict is bound to the ladder: what is said, in every kind of answer, is what the error bears out."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from support.discovered import with_cogging, with_unknown
from support.hidden_effects import ACTUATOR, SINE, recorded

from ema_model.comparison.residuals import Residuals
from ema_model.comparison.result import SignalError
from ema_model.comparison.thresholds import BAND
from ema_model.comparison.verdict import judge, most_of_floor
from ema_model.discovery import begun, result_of
from ema_model.discovery.history import Step, rung_of
from ema_model.discovery.result import VERDICTS, Candidate, Contradiction
from ema_model.discovery.snapshot import known_of
from ema_model.discovery.words import VERDICT_WORDS as IN_WORDS
from ema_model.discovery.words import headline, sentences, so_far
from ema_model.estimation.model_fit import floor_ratio

CLEAR = {"load_dependent_friction": {"ratio": 0.25}}
SURE = ("adequate", "effects_found")


def sharper(story, times: float):
    """The same steps beside sensors so many times finer: as much more is left, in floors."""
    floors, after = ([_finer(one, times) for one in some] for some in (story.data.floors, story.data.after_fit))
    data = replace(story.data, floors=floors, after_fit=after)
    fits = [replace(one.fit, calibration=_counted(one.fit.calibration, times)) for one in story.steps]
    steps = [Step(fit, rung_of(one.rung.change, fit, data, None), one.added) for fit, one in zip(fits, story.steps)]
    return replace(story, data=data, held=None, steps=steps, calm={})


def _finer(floor, times: float):
    noise, model, left = (
        {name: part[name] / times for name in part} for part in (floor.noise, floor.model, floor.left)
    )
    return replace(floor, noise=noise, model=model, left=left)


def _counted(calibration, times: float):
    return replace(
        calibration,
        residual=times * calibration.residual,
        weighted_sensitivities=[
            {name: times * values for name, values in part.items()} for part in calibration.weighted_sensitivities
        ],
    )


@pytest.fixture(scope="module")
def healthy():
    return begun(recorded(31, commands=[SINE]), ACTUATOR)


@pytest.fixture(scope="module")
def lacking():
    """The calibrated model of a plant with a hidden effect, and the same with it."""
    story = begun(recorded(31, effects=CLEAR), ACTUATOR)
    bare = replace(story, steps=list(story.steps))
    story.add(story.trial(Candidate(*CLEAR, 0.0, next(iter(CLEAR.values())))))
    return bare, story


def error(data, found):
    return floor_ratio(data, found.plant, found.calibration.signals)


def answers(healthy, lacking):
    for story in (healthy, *lacking):
        for times in (1.0, 4.0, 30.0):
            yield result_of(sharper(story, times))
    yield from (with_cogging(), with_unknown())


@pytest.mark.long
def test_verdict_and_ladder_never_contradict(healthy, lacking):
    seen = set()
    for found in answers(healthy, lacking):
        seen.add(found.verdict)
        rest = found.ladder[-1].rmse
        assert found.verdict in VERDICTS and (found.verdict not in SURE or found.at_floor)
        assert found.at_floor == (rest <= most_of_floor(found.data.floor_spread) < BAND)
        assert not found.effects or found.verdict == ("effects_found" if found.at_floor else "partly_explained")
        told = json.loads(json.dumps(found.to_dict(), allow_nan=False))
        within = found.is_within_band
        assert told["remaining"] == {"rmse": rest, "at_floor": found.at_floor, "within_band": within}
    assert seen >= {"adequate", "effects_found", "partly_explained", "unknown_effect"}


def test_what_remains_is_told_in_every_place(healthy, lacking):
    part = result_of(sharper(lacking[1], 4.0))
    assert headline(part).startswith("Found in part: load-dependent friction; ") and "cause unknown" in headline(part)
    assert str(part).startswith("partly explained: ") and "times the floor remains, cause unknown" in str(part)
    nothing = result_of(sharper(healthy, 30.0))
    assert "times the floor remains, cause unknown" in headline(nothing) and not nothing.effects
    assert set(IN_WORDS) == set(VERDICTS)


def test_without_a_verdict_yet_it_says_what_the_model_has(lacking):
    bare, added = (so_far(result_of(story)) for story in lacking)
    assert added.startswith("So far: load-dependent friction. With it the error falls from ")
    assert bare.startswith("The calibrated model's error is ")


def test_one_that_was_cut_off_says_so_with_what_it_has(lacking):
    bare, added = (result_of(story, interrupted=True) for story in lacking)
    assert headline(bare) == "The search was cut off before it had added anything."
    assert headline(added) == "The search was cut off. Found so far: load-dependent friction."
    assert added.to_dict()["verdict"] == "interrupted" and len(added.ladder) == len(bare.ladder) + 1
    assert str(added).startswith("interrupted: The search was cut off.")


@pytest.mark.parametrize(
    ("unseen", "how", "at_floor"),
    [(1.4, None, True), (4.8, None, False), (4.8, "unknown", False), (4.8, "sign", True), (None, None, True)],
    ids=["not far", "far", "far, cause unknown", "its own sign", "nothing held out"],
)
def test_nothing_is_sure_that_misses_what_was_not_fitted(healthy, unseen, how, at_floor):
    last = healthy.steps[-1]
    step = replace(last, rung=replace(last.rung, holdout_rmse=unseen))
    told = [] if how is None else [Contradiction("unseen", None, how, "It is missed.", 4.8, 4.8)]
    story = replace(healthy, steps=[*healthy.steps[:-1], step])
    story.disagreements = told
    found = result_of(story)
    assert found.at_floor == at_floor and found.verdict == ("adequate" if at_floor else "unknown_effect")
    assert ("what was not fitted is missed by 4.80 times the floor" in headline(found)) != at_floor


def test_what_is_not_claimed_is_told_with_the_reason(healthy):
    found = replace(result_of(healthy), not_claimed={"torsional_compliance": "the fit with it did not converge"})
    line = "Torsional compliance is not claimed: the fit with it did not converge."
    assert line in sentences(found) and line in str(found)
    rest = replace(found.ladder[-1], rmse=1.083)
    unknown = replace(found, verdict="unknown_effect", at_floor=False, ladder=[rest])
    said = "Something is missing, and nothing that was tried can be claimed for it: 1.08 times the floor remains"
    assert headline(unknown).startswith(said)
    assert "none of the known effects explains" in headline(replace(unknown, not_claimed={}))
    assert found.to_dict()["not_claimed"] == {"torsional_compliance": "the fit with it did not converge"}


def test_what_stands_in_a_group_is_not_told_to_be_refused(lacking):
    """An effect may be refused at one step and be a rival of the one that is named at the next."""
    story = replace(lacking[1], steps=list(lacking[1].steps), refused={"constant_load": "no", "hinge_moment": "no"})
    last = story.steps[-1]
    story.steps[-1] = replace(last, added=tuple(replace(one, same_as=("constant_load",)) for one in last.added))
    assert result_of(story).not_claimed == {"hinge_moment": "no"}


def test_the_rungs_of_a_ladder_are_of_one_kind(lacking):
    """A settled model may leave more than the bent one before it, which would read as an effect that does harm."""
    story = sharper(lacking[1], 4.0)
    story.settle()
    assert story.added and all(story.settled(step.fit) is step.fit for step in story.steps)
    assert all(step.rung.rmse == pytest.approx(error(story.data, step.fit)) for step in story.steps)


def test_a_stop_while_the_rungs_settle_leaves_the_ladder_as_it_was(lacking):
    story = sharper(lacking[1], 4.0)
    before, said = list(story.steps), []

    def second_time(text):
        said.append(text)
        if len(said) > 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        story.settle(second_time)
    assert story.steps == before
    story.settle()
    assert [one.settled_from for one in story.steps] == before
    ended = {before[0]: "what was known of the calibrated model"}
    assert known_of(story.steps[0], ended) == ended[before[0]] and known_of(story.steps[1], ended) is None


def test_compare_is_bound_by_the_same_band():
    """A fast error of three floors follows no variable and vanishes in means over 25 ms; yet it is no noise."""
    n = 4000
    random = np.random.default_rng(3)
    values = 3.0 * np.where(np.arange(n) % 2, 1.0, -1.0) * random.uniform(0.5, 1.5, n)
    left = Residuals(
        time_s=np.arange(n) * 5e-4,
        values={"current_A": values},
        sigma={"current_A": np.ones(n)},
        noise={"current_A": np.ones(n)},
        white={"current_A": np.ones(n)},
        variables={"motor_speed": 50.0 + random.uniform(-1.0, 1.0, n)},
        recording=np.zeros(n, np.intp),
        run=np.zeros(n, np.intp),
        saturated=np.zeros(n, np.bool_),
        block_s=5e-4,
    )
    errors = {"current_A": SignalError(3.1, 3.1, 0.1, 1.0, 3.0)}
    assert not judge(left, errors, None, ACTUATOR).adequate
    assert judge(replace(left, values={"current_A": values / 3.2}), errors, None, ACTUATOR).adequate


def test_parameters_that_an_unknown_error_drives_to_their_bounds_stay_as_the_file_says(lacking):
    story = sharper(lacking[0], 4.0)
    driven = {name for name, one in story.current.calibration.parameters.items() if one.at_bound}
    assert driven
    story.settle()
    found = result_of(story)
    assert not any(one.at_bound for one in found.calibration.parameters.values())
    for path in story.current.held:
        assert path not in found.calibration.parameters
        assert found.actuator.value(path) == ACTUATOR.value(path)
    assert bool(story.current.held) == any(line.startswith("Kept as the file says") for line in found.warnings)
    before = story.current
    story.settle()
    assert story.current is before


def test_finer_sensors_make_nothing_surer_that_the_model_cannot_follow(lacking):
    path = "effects.load_dependent_friction.ratio"
    near, far = (result_of(sharper(lacking[1], times)).calibration.parameters[path] for times in (1.0, 30.0))
    width = [one.interval90[1] - one.interval90[0] for one in (near, far)]
    assert near.value == far.value and 0.3 * width[0] < width[1] < 2.0 * width[0]
