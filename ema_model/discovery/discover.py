"""Which physical effects are missing: calibrate, ask whether anything is left, score, refit, accept, repeat.

The method and what was measured on a prototype: no verdict without a converged calibration; an effect is accepted
when the data pay for its parameters (ΔBIC), on most stretches of time, materially, and on what was held out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison.explain import Explanation
from ema_model.discovery.begin import begun
from ema_model.discovery.claim import claimed
from ema_model.discovery.contradiction import contradictions
from ema_model.discovery.criteria import FAR, HALF
from ema_model.discovery.dropped import drop_doubtful, drop_idle
from ema_model.discovery.next_experiment import next_experiment
from ema_model.discovery.objections import ratio
from ema_model.discovery.path import Story, refreshed, with_drops
from ema_model.discovery.refit import Trial, pays
from ema_model.discovery.remaining import at_floor
from ema_model.discovery.repeated import repeated
from ema_model.discovery.result import Candidate, Discovery, Experiment
from ema_model.discovery.second_opinion import compared, second_opinion, support_of, taken_over
from ema_model.discovery.sentences import as_well, held_back, masked, mismatch, untold
from ema_model.discovery.transmission_seen import transmission_seen
from ema_model.discovery.uncertainty import with_intervals
from ema_model.discovery.unknown import curve_instead, is_a_shape
from ema_model.discovery.verdict import verdict_of
from ema_model.effects import CATALOGUE
from ema_model.recordings import Measurement

Progress = Callable[[str], None]

_REFITTED_SHARE, _MOST_REFITTED = 0.25, 6  # of the best score; of candidates


def discover(
    measurements: Sequence[Measurement],
    actuator: Actuator | None = None,
    *,
    holdout: Sequence[Measurement] = (),
    signals: Sequence[str] | None = None,
    candidates: Sequence[str] | None = None,
    most_effects: int = 3,
    on_progress: Progress | None = None,
) -> Discovery:
    """The missing effects of recordings of one actuator, added to its model one after another.

    holdout: recordings that are not fitted and must improve as well; candidates: effects to consider, all of the
    catalogue's without it.  on_progress is told what goes on, and may raise to stop.
    Raises InputError for recordings that cannot be compared.
    """
    tell = on_progress or (lambda text: None)
    story = begun(measurements, actuator or load_actuator(), holdout, signals, tell)
    if not story.repeatable:
        return result_of(story)
    walked = walk(story, tell, candidates=candidates, most_effects=most_effects)
    experiment = None
    if walked.rivals:
        tell("looking for a test that tells the rivals apart")
        experiment = next_experiment(story.data, walked.rivals[0].fit, walked.rivals[1].fit)
        if experiment is None:
            story.warnings.append(untold(*(trial.candidate.name for trial in walked.rivals[:2])))
    return result_of(story, walked.candidates, walked.unknown, experiment)


@dataclass(frozen=True)
class Walked:
    """What a walk saw besides the story's own steps."""

    candidates: Sequence[Candidate]  # of its first round, the best first
    rivals: Sequence[Trial]  # that could not be told apart, the chosen one first
    unknown: Explanation | None  # what the last model leaves, or what the curve stands for


def walk(
    story: Story, tell: Progress = lambda text: None, *, candidates: Sequence[str] | None = None, most_effects: int = 3
) -> Walked:
    """Goes on by itself from where a story stands: adds what pays, takes out what became idle, draws what is unknown.

    Where a closed loop is left unexplained, inverse dynamics is asked as well, and takes over if the controller is to
    blame, or if the loop names nothing, or little of what is left.  tell is told after each step, too, and may raise
    to stop; the story then stands at its last whole step.
    """
    own = _Walk(story, tell, candidates, most_effects)
    own.go()
    opinion, other = None, None
    if story.ladder[-1].rmse > HALF * story.ladder[0].rmse:  # a loop whose controller is another one is walked in vain
        opinion = second_opinion(story, tell)
        if opinion is not None and opinion.blames_controller:
            other = _Walk(opinion.story, tell, candidates, most_effects).ended()
    if opinion is not None and other is not None and opinion.settles(story) and not _bends(story, tell):
        taken_over(story, opinion)
        walked = other
    else:
        walked = own.ended()
        opinion = second_opinion(story, tell, opinion)
        if opinion is not None:
            asked = opinion.blames_controller or not _named(story) or story.ladder[-1].rmse > FAR
            if asked and other is None:
                other = _Walk(opinion.story, tell, candidates, most_effects).ended()
            if asked and other is not None and opinion.explains_better(story):
                taken_over(story, opinion)
                walked = other
            else:
                compared(story, opinion, tell)
    if not story.current.plant.simulates_commands:
        story.transmission_seen = transmission_seen(story.data.measurements, story.current.calibration.actuator)
    story.disagreements = contradictions(story, tell)
    return walked


def _bends(story: Story, tell: Progress) -> bool:
    """Whether a curve of the residual takes half of what the loop leaves, or all: a torque, no controller's."""
    curve = story.curve(story.left().explanation, tell)
    if curve is None:
        return False
    return at_floor(story.data, curve.fit) or curve.fit.error() < HALF * story.current.error()


class _Walk:
    """A story that goes on step by step."""

    def __init__(self, story: Story, tell: Progress, candidates: Sequence[str] | None, most_effects: int) -> None:
        self.story, self._tell, self._names, self._most = story, tell, candidates, most_effects
        self._first: list[Candidate] = []
        self._rivals: list[Trial] = []
        self._curve: Trial | None = None
        self._going = True

    def go(self) -> None:
        """One step, of a fault or an effect; where nothing pays, it has come to its end."""
        self._going = len({one.name for one in self.story.added}) < self._most and self._step()

    def ended(self) -> Walked:
        """Goes on to the end; takes out what became idle or doubtful, draws what is unknown, and settles."""
        # Each round looks whether or not anything is seen to be left: a fingerprint knows better what to look for.
        while self._going:
            self.go()
        story, tell = self.story, self._tell
        drop_idle(story, tell)
        drop_doubtful(story, tell)
        unknown = story.left().explanation
        if unknown is not None and not _named(story):
            unknown = _with_curve(story, self._curve, unknown, tell)
        story.settle(tell)  # last: beside a settled model any refit falls that only goes back to the sensors' noise
        return Walked(self._first, self._rivals, unknown)

    def _step(self) -> bool:
        story, tell = self.story, self._tell
        tell("scoring the candidates")
        left = story.left()
        ranked = story.ranked(self._names, left)
        trials = story.tried(ranked, _REFITTED_SHARE, _MOST_REFITTED, tell)
        fault = story.fault(ranked, lambda: trials, tell)
        if fault:
            story.add(fault)
            return True
        self._first = self._first or with_drops(ranked, trials)
        accepted = [trial for trial in trials if pays(story.current, trial, story.data, story.held)]
        if not accepted and ratio(story.data, story.current) > FAR:
            trials = story.tried_whole([one for one in ranked if one not in [t.candidate for t in trials]], tell)
            accepted = [trial for trial in trials if pays(story.current, trial, story.data, story.held)]
        claim = claimed(story, accepted, tell)
        if claim is None:
            return False
        best, others, more = claim
        self._curve = curve_instead(story.data, story.held, story.current, best, left.explanation, tell)
        orders = [settings["order"] for settings in more.effects.values()] if more else []
        if self._curve or is_a_shape([best.candidate.settings.get("order", 0.0), *orders]):
            return False
        if others and not self._rivals:
            self._rivals = [best, *others]
        story.add(best, ties=[trial.candidate.name for trial in others])
        if more:
            story.add(more)
        return True


def _with_curve(story: Story, curve: Trial | None, unknown: Explanation, tell: Progress) -> Explanation:
    """Adds the curve of what is unknown, and tells what it stands for.

    Parameters that only bent toward it go back: the curve is drawn beside the calibrated model, if one can be.
    """
    bent = story.steps[story.bare :]
    whole = None
    if bent:
        try:
            story.restart()
            whole = story.left().explanation
            curve = story.curve(whole, tell)
        finally:  # also when it was stopped
            story.steps += bent
    if bent and curve and whole:
        story.restart()
        unknown = whole
    curve = curve or story.curve(unknown, tell)
    if curve:
        story.add(curve)
    return unknown


def _named(story: Story) -> list[str]:
    """The library's effects in the model that are no parameters outside their tolerance."""
    return [one.name for one in story.added if one.name in CATALOGUE and not one.stands_for]


def result_of(
    story: Story,
    candidates: Sequence[Candidate] = (),
    unknown: Explanation | None = None,
    experiment: Experiment | None = None,
) -> Discovery:
    """What a story comes to; unknown: what its last model leaves."""
    calibration = with_intervals(story.data, story.current)
    names = _named(story)
    added = [replace(refreshed(one, calibration), supported_by=support_of(story, one.name)) for one in story.added]
    named = [one for one in added if one.name in names]
    faults = {name: calibration.parameters[name] for name in story.current.faults}
    outside = [name for name in calibration.outside_tolerance if "." in name and not name.startswith("effects.")]
    stand_ins = [one.stands_for for one in story.added if one.stands_for]
    told = {*names, *(rival for one in named for rival in one.same_as)}  # refused at an earlier step, or not
    return Discovery(
        verdict=verdict_of(story, named, unknown),
        calibration=calibration,
        effects=named,
        ladder=story.ladder,
        candidates=candidates,
        faults=faults,
        parameters_outside_tolerance=list(dict.fromkeys([*stand_ins, *outside])),
        actuator=calibration.actuator,
        plant=story.current.plant,
        floors=story.data.floors,
        data=story.data,
        at_floor=at_floor(story.data, story.current),
        held=story.held,
        unknown=unknown,
        curve=next((one for one in added if one.name not in CATALOGUE), None),
        next_experiment=experiment,
        not_claimed={name: why for name, why in story.refused.items() if name not in told},
        warnings=[
            *story.warnings,
            *mismatch(story.controller_seen, calibration.actuator.axes),
            *([story.transmission_seen.sentence(calibration.actuator)] if story.transmission_seen else ()),
            *(one.sentence for one in story.disagreements),
            *held_back(story.current.held, calibration.actuator.axes),
            *masked(story.added, calibration.actuator.axes),
            *as_well(story.ties, story.added, story.current.faults),
        ],
        controller_seen=story.controller_seen,
        transmission_seen=story.transmission_seen,
        disagreements=story.disagreements,
        repeated=repeated(story.data, story.held, calibration.actuator),
    )


def settings_of(found: Discovery) -> Mapping[str, Mapping[str, float]]:
    """The effects of the improved model, as `compare` and `simulate` take them."""
    return {one.key: found.actuator.effects[one.key] for one in found.effects}
