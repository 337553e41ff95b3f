"""How a discovery goes by itself: a closed loop step by step, and inverse dynamics beside it where the loop fails."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ema_model.comparison.explain import Explanation
from ema_model.discovery.candidates.paid_for import pays
from ema_model.discovery.candidates.refit import Trial, with_drops
from ema_model.discovery.candidates.unknown import curve_instead, is_a_shape
from ema_model.discovery.criteria import FAR, HALF, LOOP_TOLD, TOLD_WELL
from ema_model.discovery.evidence.objections import ratio
from ema_model.discovery.evidence.remaining import Left, at_floor
from ema_model.discovery.observed.transmission import transmission_seen
from ema_model.discovery.observed.two_masses import two_masses_seen
from ema_model.discovery.result import Candidate
from ema_model.discovery.steps.beside_a_fault import beside_a_fault
from ema_model.discovery.steps.claim import claimed, simplest
from ema_model.discovery.steps.contradiction import contradictions
from ema_model.discovery.steps.dropped import drop_doubtful, drop_idle
from ema_model.discovery.steps.path import Story
from ema_model.discovery.steps.ranking import with_faults
from ema_model.discovery.steps.second_opinion import Opinion, compared, second_opinion, taken_over
from ema_model.discovery.steps.turned import put_right
from ema_model.discovery.steps.weighed_again import fault_instead, near, weigh_again
from ema_model.effects import CATALOGUE, find
from ema_model.estimation.model_fit import Fit
from ema_model.faults import NAMES as FAULTS

Progress = Callable[[str], None]

_REFITTED_SHARE, _MOST_REFITTED = 0.25, 6  # of the best score; of candidates


@dataclass(frozen=True)
class Walked:
    """What a walk saw besides the story's own steps."""

    candidates: Sequence[Candidate]  # of its first round, the best first
    rivals: Sequence[Trial]  # that could not be told apart, the chosen one first
    unknown: Explanation | None  # what the last model leaves, or what the curve stands for


def walk(
    story: Story,
    tell: Progress = lambda text: None,
    *,
    candidates: Sequence[str] | None = None,
    most_effects: int = 3,
    engine: type[Walk] | None = None,
) -> Walked:
    """Goes on by itself from where a story stands: adds what pays, takes out what became idle, draws what is unknown.

    Where a closed loop is left unexplained, inverse dynamics is asked as well, and takes over if the controller is to
    blame, or if the loop names nothing, or little of what is left.  tell is told after each step, too, and may raise
    to stop; the story then stands at its last whole step.  engine: how each of them goes on.
    """
    engine = engine or Walk
    own = engine(story, tell, candidates, most_effects)
    beside = _Beside(story, tell, candidates, most_effects, engine)
    left = max(FAR, LOOP_TOLD * ratio(story.data, story.base))
    # A loop whose drive is another one is walked in vain; one that lacks a limit, which is not straight, tells so
    # only once that is refitted.
    if own.is_untold():
        in_vain = own.drive_leaves() > left if own.suspects_drive() else beside.blames_controller()
    else:
        in_vain = own.suspects_drive() and beside.blames_controller() and own.drive_leaves() > left
    if in_vain and beside.settles():
        walked = beside.taken_over()
    else:
        own.go()
        if ratio(story.data, story.current) > left and beside.blames_controller() and beside.settles():
            walked = beside.taken_over()
        else:
            walked = own.ended()
            opinion = beside.asked()
            if opinion is not None:
                wanted = opinion.blames_controller or not named_in(story) or ratio(story.data, story.current) > FAR
                if wanted and beside.explains_better():
                    walked = beside.taken_over()
                else:
                    compared(story, opinion, tell)
    if not story.current.plant.simulates_commands:
        seen = story.data.measurements, story.current.calibration.actuator
        story.transmission_seen = transmission_seen(*seen)
        story.two_masses_seen = None if at_floor(story.data, story.current) else two_masses_seen(*seen)
    story.disagreements = [*story.turned, *contradictions(story, tell)]
    return walked


class Walk:
    """A story that goes on step by step."""

    def __init__(self, story: Story, tell: Progress, candidates: Sequence[str] | None, most_effects: int) -> None:
        self.story, self._tell, self._names, self._most = story, tell, candidates, most_effects
        self._first: list[Candidate] = []
        self._rivals: list[Trial] = []
        self._near: dict[str, list[Trial]] = {}  # that told nearly as much as an effect when it was added, by its key
        self._curve: Trial | None = None
        self._going = True
        self._ranked: tuple[Fit, Left, list[Candidate]] | None = None
        self._tried: list[Trial] = []  # before the first step

    def is_untold(self) -> bool:
        """Whether the loop is far off, and nothing would tell most of it."""
        best, most = self._best(), TOLD_WELL * self.story.current.chi2
        if best is None or best.predicted_drop >= most:
            return False
        return with_faults(self.story, [best])[0].predicted_drop < most  # play is a fault, and no effect tells as much

    def suspects_drive(self) -> bool:
        """Whether the loop is far off, and what would tell most of it is of the drive."""
        best = self._best()
        return best is not None and of_drive(best)

    def drive_leaves(self) -> float:
        """What the best of the drive's candidates leaves, refitted, in floors."""
        ranked = self._scored()[1]
        promising = self.story.promising(ranked, _REFITTED_SHARE, _MOST_REFITTED)
        for one in promising:
            if of_drive(one):
                self._tried.append(self.story.trial(one, self._tell))
        if not self._tried:  # a score takes for straight what is not
            self._tried += self.story.tried_whole([one for one in ranked if of_drive(one)], self._tell)
        return min((ratio(self.story.data, trial.fit) for trial in self._tried), default=math.inf)

    def go(self) -> None:
        """One step, of a fault or an effect; where nothing pays, it has come to its end."""
        self._going = len({one.name for one in self.story.added}) < self._most and self._step()

    def ended(self) -> Walked:
        """Goes on to the end, draws what is unknown, and settles."""
        story, tell = self.story, self._tell
        self._go_to_the_end()
        unknown = story.left().explanation
        if unknown is not None and not named_in(story):
            unknown = _with_curve(story, self._curve, unknown, tell)
        story.settle(tell)  # last: beside a settled model any refit falls that only goes back to the sensors' noise
        return Walked(self._first, _still_alike(story, self._rivals), unknown)

    def _go_to_the_end(self) -> None:
        """Adds what pays; takes out what became idle or doubtful."""
        # Each round looks whether or not anything is seen to be left: a fingerprint knows better what to look for.
        story, tell = self.story, self._tell
        while self._going:
            self.go()
            fault = None if self._going else fault_instead(story, self._near, tell)
            if fault:
                self._begin_with(fault)
        weigh_again(story, self._near, tell)
        drop_idle(story, tell)
        drop_doubtful(story, tell)

    def _begin_with(self, fault: Trial) -> None:
        """Walks anew beside a fault in whose place an effect stood."""
        story = self.story
        walked = story.steps[story.bare :]
        story.restart()
        try:
            trial = story.trial(fault.candidate, self._tell)
        except BaseException:  # it was stopped
            story.steps += walked
            raise
        story.refused.clear()
        story.add(trial)
        self._rivals, self._near, self._going = [], {}, True

    def _best(self) -> Candidate | None:
        """What would tell most of a loop that is far off."""
        story = self.story
        if ratio(story.data, story.current) <= FAR or not story.current.plant.simulates_commands:
            return None
        return next(iter(self._scored()[1]), None)

    def _scored(self) -> tuple[Left, list[Candidate]]:
        """What the last model leaves, and all candidates for it."""
        if self._ranked is None or self._ranked[0] is not self.story.current:
            self._tell("scoring the candidates")
            left = self.story.left()
            self._ranked = self.story.current, left, self.story.ranked(self._names)
        return self._ranked[1:]

    def _step(self) -> bool:
        story, tell = self.story, self._tell
        if story.current.actuator.leaves_out_reversals and named_in(story) and at_floor(story.data, story.current):
            return False  # without a controller no twin says which faint rest is the model's own
        left, ranked = self._scored()
        trials = story.tried(ranked, _REFITTED_SHARE, _MOST_REFITTED, tell, self._tried)
        faults = story.faults(ranked, tell)
        self._first = self._first or with_drops(with_faults(story, ranked), [*trials, *faults])
        fault = story.fault(faults, lambda: trials)
        if fault:
            story.add(fault)
            return True
        accepted = [trial for trial in trials if pays(story.current, trial, story.data, story.held)]
        if put_right(story, trials[: 1 + _leading(trials, accepted)], tell):
            accepted = [trial for trial in trials if pays(story.current, trial, story.data, story.held)]
        if not accepted and ratio(story.data, story.current) > FAR:
            trials = story.tried_whole([one for one in ranked if one not in [t.candidate for t in trials]], tell)
            accepted = [trial for trial in trials if pays(story.current, trial, story.data, story.held)]
        claim = claimed(story, accepted, tell)
        leader = next(iter(simplest(story, trials)), None)
        if leader and (claim is None or (claim.best.drop < leader.drop and leader not in claim.others)):
            fault = beside_a_fault(story, leader, tell)
            if fault:
                story.add(leader)
                story.add(fault)
                return True
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
        self._near[best.candidate.name] = near(best, [*trials, *faults])
        if more:
            story.add(more)
        return True


class _Beside:
    """Inverse dynamics beside a story: asked where it is wanted, and walked once."""

    def __init__(
        self, story: Story, tell: Progress, candidates: Sequence[str] | None, most_effects: int, engine: type[Walk]
    ) -> None:
        self._story, self._tell, self._names, self._most = story, tell, candidates, most_effects
        self._engine = engine
        self._opinion: Opinion | None = None
        self._walked: Walked | None = None

    def asked(self) -> Opinion | None:
        """Its opinion of the story as it stands now."""
        self._opinion = second_opinion(self._story, self._tell, self._opinion)
        return self._opinion

    def blames_controller(self) -> bool:
        """Whether the drive's current is not what the file's controller makes of the motion."""
        opinion = self.asked()
        return opinion is not None and opinion.blames_controller

    def settles(self) -> bool:
        """Whether, walked to its end, it explains enough of what flowed, and no torque tells the loop's error."""
        opinion = self._ended()
        may_be_faulty = self._story.current.actuator.has_reference_model
        return opinion is not None and opinion.settles(self._story, may_be_faulty) and not self._bends()

    def explains_better(self) -> bool:
        """Whether, walked to its end, it explains what flowed better than the loop."""
        opinion = self._ended()
        return opinion is not None and opinion.explains_better(self._story)

    def taken_over(self) -> Walked:
        """The story goes on without the controller."""
        assert self._opinion is not None and self._walked is not None
        taken_over(self._story, self._opinion)
        return self._walked

    def _ended(self) -> Opinion | None:
        opinion = self.asked()
        if opinion is not None and self._walked is None:
            self._walked = self._engine(opinion.story, self._tell, self._names, self._most).ended()
        return opinion

    def _bends(self) -> bool:
        """Whether a curve of the residual takes half of what the loop leaves, or all: a torque, no controller's."""
        story = self._story
        curve = story.curve(story.left().explanation, self._tell)
        if curve is None:
            return False
        return at_floor(story.data, curve.fit) or curve.fit.error() < HALF * story.current.error()


def _leading(trials: Sequence[Trial], accepted: Sequence[Trial]) -> int:
    """How many of the trials tell more than the first that is accepted; all but one where none is."""
    return trials.index(accepted[0]) if accepted else len(trials) - 1


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


def _still_alike(story: Story, rivals: Sequence[Trial]) -> list[Trial]:
    """An effect and its rivals, where the last model still has it and cannot tell it from them."""
    known = {one.name: one.same_as for one in story.added}
    names = known.get(rivals[0].candidate.name, ()) if rivals else ()
    alike = [rival for rival in rivals[1:] if rival.candidate.name in names]
    return [rivals[0], *alike] if alike else []


def of_drive(one: Candidate) -> bool:
    return one.name not in FAULTS and find(one.name).family == "drive"


def named_in(story: Story) -> list[str]:
    """The library's effects in the model that are no parameters outside their tolerance."""
    return [one.name for one in story.added if one.name in CATALOGUE and not one.stands_for]
