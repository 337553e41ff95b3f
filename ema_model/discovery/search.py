"""The search for what is missing: all Terms scored by algebra, the best few refitted, the most probable model kept.

Each round makes the columns of all Terms at the model as it is, looks by algebra at what adding, exchanging and leaving
out would give, refits the few that might be best, and goes on from the one with the greatest evidence, as long as there
is any that is far more probable than what is there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ema_model.comparison.explain import Explanation
from ema_model.comparison.verdict import most_of_floor
from ema_model.discovery.curve import is_a_shape
from ema_model.discovery.evidence import evidence_of, gains_of
from ema_model.discovery.history import Story
from ema_model.discovery.inverse import Opinion, compared, second_opinion, taken_over
from ema_model.discovery.objections import (
    contradictions,
    goes_by_angle,
    implausible,
    put_right,
    unmeasured,
    unsteady,
    within,
)
from ema_model.discovery.refit import Trial, fitted_to_the_end, refitted
from ema_model.discovery.remaining import at_floor, ratio, told_ratio, within_band
from ema_model.discovery.result import Added, Candidate
from ema_model.discovery.rounds import Contender, Refits, Round, Rounds, are_told_apart
from ema_model.discovery.terms import AboutFit, ScoredTerm, evidence_of_fit, places_of
from ema_model.discovery.thresholds import (
    FAR,
    HALF,
    LARGEST_GROUP,
    LEAST_FALL,
    LOOP_TOLD,
    MIGHT,
    NAMED,
    SHAPES,
    TOLD_WELL,
    WORTH_A_REFIT,
)
from ema_model.discovery.transmission import transmission_seen, two_masses_seen
from ema_model.effects import CATALOGUE, catalogue_name, find
from ema_model.estimation.model_fit import Data, Fit, fit, holdout_fit
from ema_model.faults import NAMES, causes
from ema_model.side_by_side import fits

Progress = Callable[[str], None]

_REFITTED = 4  # Terms of a round that keep what the algebra promised of them
_MOST_REFITTED = 8  # Terms of a round
_SLIGHT = "beside what is left it tells too little"
_IDLE = "the error does not fall with it"
_TINY = 1e-9
_FOLLOWED = 2  # alternatives
NO_LIMIT = 100  # of effects


@dataclass(frozen=True)
class Found:
    """What a search saw besides the story's own steps."""

    candidates: Sequence[Candidate]  # of its first round, the best first
    rivals: Sequence[Trial]  # that could not be told apart, the chosen one first
    unknown: Explanation | None  # what the last model leaves, or what the curve stands for


def search(
    story: Story,
    tell: Progress = lambda text: None,
    *,
    candidates: Sequence[str] | None = None,
    most_effects: int = NO_LIMIT,
    rounds: Rounds | None = None,
    refits: Refits | None = None,
) -> Found:
    """Goes on by itself from where a story stands: adds what is missing, takes out what is not, draws what is unknown.

    Where a closed loop is left unexplained, inverse dynamics is asked as well, and takes over if the controller is to
    blame, or if the loop names nothing, or little of what is left.  tell is told after each step, too, and may raise
    to stop; the story then stands at its last whole step.  rounds, refits: those of this story that are known.
    """
    own = Search(story, candidates, most_effects, tell, rounds, refits)
    beside = _Beside(story, tell, candidates, most_effects)
    left = max(FAR, LOOP_TOLD * ratio(story.data, story.base))
    # A loop whose drive is another one is searched in vain; one that lacks a limit, which is not straight, tells so
    # only once that is refitted.
    if own.is_untold():
        in_vain = own.drive_leaves() > left and (own.suspects_drive() or beside.blames_controller())
    else:
        in_vain = own.suspects_drive() and beside.blames_controller() and own.drive_leaves() > left
    if in_vain and beside.settles():
        found = beside.taken_over()
    else:
        own.step()
        if ratio(story.data, story.current) > left and beside.blames_controller() and beside.settles():
            found = beside.taken_over()
        else:
            found = own.ended()
            opinion = beside.asked()
            if opinion is not None:
                wanted = opinion.blames_controller or not story.named or ratio(story.data, story.current) > FAR
                if wanted and beside.explains_better():
                    found = beside.taken_over()
                else:
                    compared(story, opinion, tell)
    if not story.current.plant.simulates_commands:
        seen = story.data.measurements, story.current.calibration.actuator
        story.transmission_seen = transmission_seen(*seen)
        story.two_masses_seen = None if at_floor(story.data, story.current) else two_masses_seen(*seen)
    story.disagreements = [*story.turned, *contradictions(story, tell)]
    return found


# --- a round: all Terms beside one model, and the few that are refitted -----------------------------------------------


@dataclass(frozen=True, eq=False)
class Alternative:
    """A Term that took about as much of a model's error as the one that was added to it."""

    before: Fit  # that model
    key: str  # of what was added
    trial: Trial


def refits_beside(
    story: Story,
    rounds: Rounds,
    tell: Progress = lambda text: None,
    shown: Callable[[Refits], None] = lambda so_far: None,
) -> Refits:
    """The most probable Terms beside the last model, refitted, as a search would begin; the story stays as it is.

    shown is given those that are known, after each few.
    """
    apart = Story(story.data, story.held, [*story.steps])
    seen = rounds.beside(apart, tell)
    own = Search(apart, None, NO_LIMIT, tell, rounds, shown=lambda found: shown(Refits(seen, [*found], {})))
    contenders = own._contenders()
    own._named(contenders)
    return Refits(seen, contenders, dict(apart.refused))


class Search:
    """A story that goes on by one evidence; each of its models is looked at once."""

    def __init__(
        self,
        story: Story,
        candidates: Sequence[str] | None = None,
        most_effects: int = NO_LIMIT,
        tell: Progress = lambda text: None,
        rounds: Rounds | None = None,
        refits: Refits | None = None,
        shown: Callable[[Sequence[Contender]], None] = lambda found: None,
    ) -> None:
        """refits: that are known beside the story's last model; shown is given a round's contenders after each few."""
        self.story, self._tell, self._shown = story, tell, shown
        self._names, self._most = candidates, most_effects
        self._rounds = rounds or Rounds(candidates)
        self._first: list[Candidate] = []
        self._rivals: list[Trial] = []
        self._curve: Trial | None = None
        self._going = True
        self._refitted = (refits.round, refits.contenders) if refits is not None else None
        self._objections: dict[Contender, str] = {}  # to contenders, by identity
        self._exchanges: set[tuple[str, str]] = set()  # that were tried
        self._barred: set[str] = set()  # effects that were added, and spoken against once all was there
        self._alternatives: list[Alternative] = []  # not followed yet
        self._prior = -math.inf  # logarithm of the odds that one of the Terms is missing, as of the last round

    # --- whether a closed loop is worth a search ----------------------------------------------------------------------

    def is_untold(self) -> bool:
        """Whether the loop is far off, and nothing would tell most of it."""
        most = TOLD_WELL * self.story.current.chi2
        return self._is_far() and all(one.candidate.predicted_drop < most for one in self._round().best)

    def suspects_drive(self) -> bool:
        """Whether the loop is far off, and what is most probable is of the drive."""
        best = self._round().best if self._is_far() else []
        return bool(best) and _of_drive(best[0].candidate)

    def drive_leaves(self) -> float:
        """What the best contenders of the drive leave, in floors."""
        trials = [one.trial for one in self._contenders() if _of_drive(one.trial.candidate)]
        return min((ratio(self.story.data, trial.fit) for trial in trials), default=math.inf)

    def _is_far(self) -> bool:
        story = self.story
        return ratio(story.data, story.current) > FAR and story.current.plant.simulates_commands

    # --- to the end ---------------------------------------------------------------------------------------------------

    def ended(self) -> Found:
        """Goes on to the end, draws what is unknown, and settles."""
        story, tell = self.story, self._tell
        self._go_to_the_end()
        self._follow_alternatives()
        self._curve_instead()
        if not story.current.calibration.is_final:
            story.finish(tell)
        unknown = story.left().explanation
        if unknown is not None and not story.named:
            unknown = _with_curve(story, self._curve, unknown, tell)
        story.settle(tell)  # last: beside a settled model any refit falls that only goes back to the sensors' noise
        while story.named and story.ladder[-1].change.kind == "effect":
            last = story.added[-1]
            reason = _IDLE if not _falls(story) else _SLIGHT if self._is_slight(last) else ""
            if not reason:
                break
            self._take_back(last, reason)
            unknown = story.left().explanation
        first = [replace(one, probability=None) if one.name in self._barred else one for one in self._first]
        first.sort(key=lambda one: -(one.probability or 0.0))
        return Found(first, _still_alike(story, self._rivals), unknown)

    def _go_to_the_end(self) -> None:
        """Adds, exchanges and takes out what makes the model more probable."""
        while self._going or self._exchanged() or self._doubtful() or self._slight():
            while self._going:
                self.step()

    def step(self) -> None:
        """The most probable Term into the model; beside as many effects as are asked for, a fault alone.

        Where none is far more probable than the model as it is, the search has come to its end.
        """
        self._going = not self._is_lost() and self._added()

    # --- what is seen beside the last model ---------------------------------------------------------------------------

    def _round(self) -> Round:
        """All Terms beside the last model."""
        return self._rounds.beside(self.story, self._tell)

    def _contenders(self) -> list[Contender]:
        """The few Terms that might be the best beside the last model, refitted, the most probable first."""
        story, seen = self.story, self._round()
        if self._refitted is None or self._refitted[0] is not seen:
            is_full = len({one.name for one in story.added}) >= self._most
            room = [one for one in self._open(seen) if one.term.fingerprint is None or not is_full]
            might = 0.0 if self._is_far() else MIGHT  # so far off, what is straight tells little
            found: list[Contender] = []
            standing: list[Contender] = []  # those that are named, if they are the best
            best = -math.inf
            is_told = self._is_told()
            while not is_told and len(standing) < _REFITTED and len(found) < _MOST_REFITTED:
                left = [one for one in room[len(found) :] if one.gain > max(WORTH_A_REFIT, best)]
                chosen = [one for one in left if one.gain > might * left[0].gain][: _REFITTED - len(standing)]
                if not chosen:
                    break
                found += self._refits(chosen)
                self._shown(found)
                standing = self._named(found)
                # What promises more than this is refitted, too.
                best = MIGHT * max((one.gain for one in standing), default=-math.inf)
            if standing:  # what a short travel shows of it, or a narrow range, may be all that there is
                leading = max(standing, key=lambda one: one.gain)
                trial = leading.trial
                tried = {one.trial.candidate.name for one in found}
                terms = () if trial.faults else find(trial.candidate.name).terms
                found += self._refits([one for one in room if one.candidate.name in {*terms} - tried])
                if not trial.faults and (self._is_near() or within_band(story.data, trial.fit)):
                    found = _best_of_each([*found, *self._laws_instead(leading, room)])
            self._refitted = seen, sorted(found, key=lambda one: -one.gain)
        return self._refitted[1]

    def _is_told(self) -> bool:
        """Whether nothing more is looked for: beside an effect or a fault, the model leaves no more than a true one.

        What the law of an effect has otherwise than the real one is no cause of its own.  A bare model is searched
        there, too: its parameters may have taken up what is missing.
        """
        return self._is_near() and bool(self.story.added or self.story.current.faults)

    def _is_near(self) -> bool:
        """Whether the last model leaves no more than a true one does."""
        return within_band(self.story.data, self.story.current)

    def _laws_instead(self, first: Contender, room: Sequence[ScoredTerm]) -> list[Contender]:
        """Other laws of the same place or speed, each fitted from where that one ended.

        Beside a model that is far off, two curves of one speed look less alike than they are.  What a true model may
        leave has a shape of its own, that one of two wrong laws may meet better: there all are asked.
        """
        seen, found, name = self._round(), first.trial.fit, first.trial.candidate.name
        (key,) = first.trial.effects
        whole = AboutFit.of(found, seen.noise)
        about = whole.without(places_of(found, key))
        own = evidence_of(seen.noise, about.residual, about.unknowns)
        told = evidence_of(seen.noise, whole.residual, whole.unknowns).log - own.log
        start = {path: x for path, x in found.starts.items() if not path.startswith(f"effects.{key}.")}
        instead: list[ScoredTerm] = []
        for one in (one for one in room if _is_of_one_law(one.candidate.name, name)):
            term = one.term
            other = evidence_of(seen.noise, about.residual, about.unknowns.beside([term.unknowns]), own.levels)
            if self._is_near() or other.log + term.log_share - own.log > MIGHT * told:
                candidate = term.candidate(other.amounts[-len(term.unknowns.mean) :], found)
                instead.append(replace(one, candidate=candidate, start=start))
        return self._refits(instead, to_the_end=True)

    def _refits(self, chosen: Sequence[ScoredTerm], to_the_end: bool = False) -> list[Contender]:
        """Terms in the last model, each refitted."""
        story, trials = self.story, fits(self._refit, chosen, self._tell)
        if to_the_end:
            trials = [self._ended(one, self._tell) for one in trials]
        seen = self._round()
        return [seen.contender(story.data, story.held, one, trial) for one, trial in zip(chosen, trials)]

    def _is_beyond(self, one: Contender | ScoredTerm) -> bool:
        """Whether a Term is so probable that it is named, if nothing speaks against it."""
        return one.gain + self._round().prior > NAMED

    def _open(self, seen: Round) -> list[ScoredTerm]:
        """The Terms of a round that may be added, the most probable first."""
        return [one for one in seen.best if one.candidate.name not in self._barred]

    def _refit(self, one: ScoredTerm, tell: Progress) -> Trial:
        """A Term in the last model, refitted from where the algebra has it; far off, what tells most, to its end."""
        story = self.story
        trial = refitted(story.data, story.current, one.candidate, one.start, tell, key=one.term.name)
        if not self._is_far() or trial.drop < TOLD_WELL * story.current.chi2:
            return trial
        return self._ended(trial, tell)

    def _ended(self, trial: Trial, tell: Progress) -> Trial:
        """A trial, fitted to its end."""
        ended = fitted_to_the_end(self.story.data, trial.fit, True, tell)
        return replace(trial, fit=ended, drop=self.story.current.chi2 - ended.chi2)

    # --- one step -----------------------------------------------------------------------------------------------------

    def _named(self, contenders: Sequence[Contender]) -> list[Contender]:
        """Those that are far more probable than the model as it is, and that nothing speaks against."""
        return [one for one in contenders if self._is_beyond(one) and not self._objection(one)]

    def _added(self) -> bool:
        story, seen, contenders = self.story, self._round(), self._contenders()
        named = self._named(contenders)
        beyond = {one.trial.candidate.name for one in contenders if self._is_beyond(one)}
        if self._is_told():
            beyond |= {one.candidate.name for one in seen.best if self._is_beyond(one)}
        ruled_out = beyond - {one.trial.candidate.name for one in named}
        self._first = self._first or seen.candidates(contenders, ruled_out)
        if not named:
            return self._turned_back(contenders) and self._added()
        near = self._is_near()
        if near:
            named += self._as_good(named[0], [one for one in contenders if one not in named])
        first = _simplest(named, near)
        name = first.trial.candidate.name
        alike = [one.trial for one in named if one is not first and (near or not first.is_told_apart_from(one))]
        as_probable = {one.candidate.name for one in [first.trial, *alike]}
        # What it is a term of is the same, seen over a short travel: told where nothing else is.
        alike = [trial for trial in alike if trial.faults or name not in find(trial.candidate.name).terms] or alike
        faults = [trial for trial in alike if trial.faults]
        effects = _without_series([trial for trial in alike if not trial.faults])
        others = [*effects, *faults]
        apart = [*(effects if first.trial.faults else _of_other_parts(first.trial, effects)), *faults]
        if len(apart) >= LARGEST_GROUP:
            story.refused[name] = f"{len(apart)} others tell as much"
            return False
        if others and not self._rivals:
            self._rivals = [first.trial, *others]
        before = story.current
        story.add(first.trial, ties=[trial.candidate.name for trial in others])
        story.finish(self._tell)
        if not first.trial.faults and not _falls(story):  # fitted to its end, as it did when fitted roughly
            self._take_back(story.added[-1], _IDLE)
            return True
        if not first.trial.faults:
            probable = seen.probabilities(contenders, ruled_out)
            story.set_probability(story.added[-1].key, min(1.0, sum(probable[name] for name in as_probable)))
            self._alternatives += [
                Alternative(before, story.added[-1].key, one.trial)
                for one in named
                if one.trial.candidate.name not in as_probable and self._takes_as_much(one.trial, first.trial)
            ]
        return True

    def _as_good(self, first: Contender, others: Sequence[Contender]) -> list[Contender]:
        """Laws of the same place or speed that nothing speaks against, where the model leaves no more than a true one.

        What a true model may leave has a shape of its own, that one of two wrong laws may meet better: there a law is
        not told from another by how probable it is, where it is more probable than that nothing is missing.
        """
        likely = [one for one in others if one.gain + self._round().prior > 0.0]
        laws = [one for one in likely if not (one.trial.faults or first.trial.faults)]
        name = first.trial.candidate.name
        return [one for one in laws if _is_of_one_law(one.trial.candidate.name, name) and not self._objection(one)]

    # --- alternatives -------------------------------------------------------------------------------------------------

    def _takes_as_much(self, other: Trial, best: Trial) -> bool:
        """Whether another trial leaves about as little, where both leave more than a model may."""
        return _shapes_between(self.story.data, self.story.held, other.fit, best.fit) < NAMED

    def _follow_alternatives(self) -> None:
        """Searches on from what took about as much of the error as something that was added.

        Beside a large rest a difference says little.  Where the model leaves more than it may in the end, an
        alternative is as good a name, unless it led to less.
        """
        for other in sorted(self._alternatives, key=lambda one: one.trial.fit.chi2)[:_FOLLOWED]:
            gain = self._follow(other)
            if gain is not None and abs(gain) <= NAMED:
                self.story.tie(other.key, other.trial.candidate.name, True)
            elif gain is not None and gain < 0.0:
                self._alternatives = [one for one in self._alternatives if one is not other]
        if within_band(self.story.data, self.story.current):
            return
        for one in self.story.added:
            alike = {other.trial.candidate.name for other in self._alternatives if other.key == one.key} - {
                *self.story.named
            }
            if len(alike) >= LARGEST_GROUP:
                self._take_back(one, f"{len(alike)} others tell as much")
                return
            for name in alike:
                self.story.tie(one.key, name, True)

    def _follow(self, alternative: Alternative) -> float | None:
        """How much more probable the model is that a search from an alternative ends at, as a logarithm.

        Far more probable, it is the story's.  At the floor by its evidence, elsewhere by what its rest says.  None
        where the model holds it already, or what it was an alternative to no more.
        """
        story, key, name = self.story, alternative.key, alternative.trial.candidate.name
        place = next((i for i, step in enumerate(story.steps) if step.fit is alternative.before), None)
        added = {one.key: one for one in story.added}
        known = {*story.named, *causes(story.current.faults)}
        if place is None or name in known or key not in added or name in added[key].same_as:
            return None
        self._tell(f"going on from {name} in place of {added[key].name}")
        branch = replace(story, steps=story.steps[: place + 1], ties={}, refused={}, warnings=[])
        branch.add(alternative.trial)
        branch.finish(self._tell)
        most = min(self._most, 1 + len({one.name for one in story.added}))
        other = Search(branch, self._names, most, self._tell, self._rounds.elsewhere())
        other._barred = {*self._barred}
        other._go_to_the_end()
        if not branch.added:
            return -math.inf
        data, held = story.data, story.held
        there = branch.current
        if not branch.data.weighs_as(data):
            there = fit(data, there.actuator, there.starts, self._tell, there.faults)
        gain = story.gain(there)
        if not within_band(data, there) and not within_band(data, story.current):
            rest = _shapes_between(data, held, story.current, there)
            gain = math.copysign(min(abs(gain), abs(rest)), gain) if gain * rest > 0.0 else 0.0
        if gain > NAMED:
            for new in alternative.trial.effects:
                branch.set_probability(new, 1.0 / (1.0 + math.exp(-gain)))
            story.take_over(branch)
            self._rivals, self._refitted, self._alternatives = [], None, []
            self._barred = other._barred
        return gain

    def _objection(self, one: Contender) -> str:
        """What speaks against a contender, "" if nothing does: a value that no such part has, or recordings disagree.

        Beside what else is missing, recordings may ask for another value each: it counts at the floor, and at the end.
        """
        if one not in self._objections:
            self._objections[one] = reason = self._spoken_against(one)
            if reason:
                self.story.refused[one.trial.candidate.name] = reason
        return self._objections[one]

    def _spoken_against(self, one: Contender) -> str:
        story, found = self.story, one.trial.fit
        reason = "" if found.calibration.converged else "the fit with it did not converge"
        for key in one.trial.effects:
            reason = reason or unmeasured(story.data, key) or within(story.current, found, key)
            reason = reason or implausible(found, key) or self._idle(found) or self._denied(one)
            if not reason and at_floor(story.data, found):
                reason = unsteady(story.data, found, key)
        return reason

    def _idle(self, found: Fit) -> str:
        """Whether the error that is told does not fall: a verdict says no more than its ladder."""
        first, last = (told_ratio(self.story.data, one) for one in (self.story.current, found))
        return "" if last < (1.0 - LEAST_FALL) * first else _IDLE

    def _denied(self, one: Contender) -> str:
        """Whether what was held out is far less probable with it."""
        return "what was held out speaks against it" if one.gain < one.fitted - NAMED else ""

    def _turned_back(self, contenders: Sequence[Contender]) -> bool:
        """Turns back the encoder of held-out recordings that deny what the fitted ones show; whether any was."""
        story, prior = self.story, self._round().prior
        by_angle = [one for one in contenders if any(goes_by_angle(key) for key in one.trial.effects)]
        if story.held is None or story.turned or not any(one.fitted + prior > NAMED for one in by_angle):
            return False
        alone = Story(story.data, None, [*story.steps])
        Search(alone, self._names, self._most, self._tell)._go_to_the_end()
        keys = [one.key for one in alone.added if goes_by_angle(one.key)]
        if not keys or not put_right(story, alone.current, keys, self._tell):
            return False
        return True

    # --- what is taken out again, or put in the place of another ------------------------------------------------------

    def _doubtful(self) -> bool:
        """Goes back to before an effect of which, in the last model, each recording asks for another value.

        What was added after it was found beside a wrong one.
        """
        story = self.story
        for one in story.added:
            reason = implausible(story.current, one.key) or unsteady(story.data, story.current, one.key)
            if reason and one.name in CATALOGUE:
                self._take_back(one, reason)
                self._going = True
                return True
        return False

    def _slight(self) -> bool:
        """Goes back to before an effect that tells too little beside what is left, however long that was recorded."""
        self._prior = self._round().prior
        for one in self.story.added:
            if self._is_slight(one):
                self._take_back(one, _SLIGHT)  # what is less probable beside the same model tells no more
                return True
        return False

    def _is_slight(self, one: Added) -> bool:
        return one.name in CATALOGUE and _shapes_told(self.story, one) + self._prior < NAMED

    def _take_back(self, one: Added, reason: str) -> None:
        """Goes back to before an effect, which is not looked at again."""
        self.story.refused[one.name] = reason
        self._barred.add(one.name)
        self._rivals, self._refitted = [], None
        if self._is_lost():
            self.story.restart()
        else:
            self.story.back_to_before(one.key)

    def _is_lost(self) -> bool:
        """Whether so many effects were added, and spoken against afterwards, that what is missing is none of them.

        Each took what a law that is not there leaves to be taken; the next would, too.
        """
        return len(self._barred) > LARGEST_GROUP

    def _curve_instead(self) -> None:
        """Takes the residual's own curve in place of all effects, where it is more probable than they are together.

        Or where several low orders are one shape within the turn, and no teeth.
        """
        story, seen = self.story, self._round()
        effects = story.current.calibration.actuator.effects
        orders = [effects[one.key]["order"] for one in story.added if "order" in effects[one.key]]
        if not story.added or (self._is_near() and not is_a_shape(orders)):
            return
        added = story.steps[story.bare :]
        story.restart()
        try:
            curve = story.curve(story.left().explanation, self._tell)
        finally:  # also when it was stopped
            story.steps += added
        if curve is None:
            return
        log = evidence_of_fit(story.data, story.held, curve.fit, seen.noise).log
        if is_a_shape(orders) or log > seen.before.log + (len(story.added) - 1) * seen.prior:
            story.restart()
            self._curve = curve

    def _exchanged(self) -> bool:
        """Takes out what the last model does not need, or puts in its place what makes it more probable."""
        story, tell = self.story, self._tell
        members = [*(one.key for one in story.added), *causes(story.current.faults)]
        if not members:
            return False
        seen = self._round()
        whole = AboutFit.of(seen.beside, seen.noise)
        straight = evidence_of(seen.noise, whole.residual, whole.unknowns).log
        for key in members if len(members) > 1 else ():
            smaller = whole.without(places_of(seen.beside, key))
            if evidence_of(seen.noise, smaller.residual, smaller.unknowns).log < straight - 2.0 * NAMED:
                continue
            tell(f"trying without {key}")
            found = story.without(key, tell)
            if evidence_of_fit(story.data, story.held, found, seen.noise).log > seen.before.log - NAMED:
                story.remove(key, found)
                return True
        # The last was chosen beside the model that it is in, unless that was far off, where algebra tells little.
        rungs = story.ladder[-2:]
        chosen = members if len(rungs) > 1 and rungs[0].rmse > FAR else members[:-1]
        return any(self._replaced(key, seen, whole, straight) for key in chosen)

    def _replaced(self, key: str, seen: Round, whole: AboutFit, straight: float) -> bool:
        """Puts the best other Term in the place of an effect or a fault where that makes the model more probable.

        straight: the logarithm of the whole model's evidence, by algebra.
        """
        story, tell = self.story, self._tell
        terms = [one.term for one in self._open(seen)]
        if not terms:
            return False
        about = whole.without(places_of(seen.beside, key))
        own = evidence_of(seen.noise, about.residual, about.unknowns)
        rough = gains_of(seen.noise, own, about.unknowns, [one.unknowns for one in terms])
        term = terms[int(np.argmax(rough + [one.log_share for one in terms]))]
        other = evidence_of(seen.noise, about.residual, about.unknowns.beside([term.unknowns]), own.levels)
        if other.log + term.log_share - own.log < MIGHT * (straight - own.log) or (key, term.name) in self._exchanges:
            return False
        self._exchanges |= {(key, term.name), (term.name, key)}
        tell(f"weighing {term.name} against {key} again")
        smaller = story.without(key, tell)
        candidate = term.candidate(other.amounts[-len(term.unknowns.mean) :], story.current)
        trial = refitted(story.data, smaller, candidate, smaller.starts, tell, key=term.name)
        after, before = evidence_of_fit(story.data, story.held, trial.fit, seen.noise), seen.before
        gain = after.log + term.log_share - before.log
        density = after.density + after.unseen - before.density - before.unseen
        is_its_term = not trial.faults and catalogue_name(key) in find(candidate.name).terms
        if gain < 0.0 or (is_its_term and not are_told_apart(-gain, -density)):
            if key not in NAMES:
                story.tie(key, candidate.name, not are_told_apart(gain, density))
            return False
        if trial.faults or key in NAMES:
            story.remove(key, smaller)
            story.add(trial)
        else:
            place = next(i for i, one in enumerate(story.added) if one.key == key)
            was = story.added[place]
            story.swap(key, trial)
            self._is_instead(story.added[place], was, gain)
        return True

    def _is_instead(self, new: Added, was: Added, gain: float) -> None:
        """An effect is as probable as what it took the place of, which is less so by that logarithm."""
        story, key, whole = self.story, new.key, was.probability
        if gain < NAMED:
            story.tie(key, was.name, True)
        if whole is None:
            return
        share = 1.0 / (1.0 + math.exp(-gain))
        story.set_probability(key, whole if gain < NAMED else share * whole)
        now = {new.name: share * whole, was.name: (1.0 - share) * whole}
        self._first = [replace(one, probability=now.get(one.name, one.probability)) for one in self._first]


# --- inverse dynamics beside a closed loop ----------------------------------------------------------------------------


class _Beside:
    """Inverse dynamics beside a story: asked where it is wanted, and searched once."""

    def __init__(self, story: Story, tell: Progress, candidates: Sequence[str] | None, most_effects: int) -> None:
        self._story, self._tell, self._names, self._most = story, tell, candidates, most_effects
        self._opinion: Opinion | None = None
        self._found: Found | None = None

    def asked(self) -> Opinion | None:
        """Its opinion of the story as it stands now."""
        self._opinion = second_opinion(self._story, self._tell, self._opinion)
        return self._opinion

    def blames_controller(self) -> bool:
        """Whether the drive's current is not what the file's controller makes of the motion."""
        opinion = self.asked()
        return opinion is not None and opinion.blames_controller

    def settles(self) -> bool:
        """Whether, searched to its end, it explains enough of what flowed, and no torque tells the loop's error."""
        opinion = self._ended()
        may_be_faulty = self._story.current.actuator.has_reference_model
        return opinion is not None and opinion.settles(self._story, may_be_faulty) and not self._bends()

    def explains_better(self) -> bool:
        """Whether, searched to its end, it explains what flowed better than the loop."""
        opinion = self._ended()
        return opinion is not None and opinion.explains_better(self._story)

    def taken_over(self) -> Found:
        """The story goes on without the controller."""
        assert self._opinion is not None and self._found is not None
        taken_over(self._story, self._opinion)
        return self._found

    def _ended(self) -> Opinion | None:
        opinion = self.asked()
        if opinion is not None and self._found is None:
            self._found = Search(opinion.story, self._names, self._most, self._tell).ended()
        return opinion

    def _bends(self) -> bool:
        """Whether a curve of the residual takes half of what the loop leaves, or all: a torque, no controller's."""
        story = self._story
        curve = story.curve(story.left().explanation, self._tell)
        if curve is None:
            return False
        return at_floor(story.data, curve.fit) or curve.fit.error() < HALF * story.current.error()


# --- what belongs together --------------------------------------------------------------------------------------------


def _shapes_told(story: Story, one: Added) -> float:
    """The most that an effect may add to the logarithm of the evidence, beside what the last model leaves.

    What is left beyond the floor counts as `SHAPES` values of each recording; at the floor there is no such limit.
    """
    last, most = story.ladder[-1], most_of_floor(story.data.floor_spread)
    beyond = 1.0 - (most / last.rmse) ** 2
    if beyond <= 0.0:
        return math.inf
    told = len(story.data.measurements) * _fall(one.rmse_before, one.rmse_after, last.rmse)
    before, after, left = one.holdout_before, one.holdout_after, last.holdout_rmse
    if story.held is not None and before is not None and after is not None and left is not None:
        told += len(story.held.measurements) * _fall(before, after, left)
    return 0.5 * SHAPES * told / beyond


def _fall(before: float, after: float, left: float) -> float:
    """How much more of an error there would be without what made it fall, beside what is left: as a logarithm."""
    return math.log(max(_TINY, 1.0 + (before**2 - after**2) / left**2))


def _shapes_between(data: Data, held: Data | None, other: Fit, best: Fit) -> float:
    """How much more probable a fit is than another, whose rest beyond the floor counts as `_shapes_told` has it."""
    beyond = 1.0 - (most_of_floor(data.floor_spread) / told_ratio(data, best)) ** 2
    if beyond <= 0.0:
        return math.inf
    told = len(data.measurements) * math.log(told_ratio(data, other) / told_ratio(data, best))
    if held is not None:
        told += len(held.measurements) * math.log(holdout_fit(held, other)[0] / holdout_fit(held, best)[0])
    return SHAPES * told / beyond


def _falls(story: Story) -> bool:
    """Whether the error that is told fell with the last step."""
    before, after = (rung.rmse for rung in story.ladder[-2:])
    return after < (1.0 - LEAST_FALL) * before


def _best_of_each(contenders: Sequence[Contender]) -> list[Contender]:
    """Of contenders of one name, the most probable."""
    best: dict[str, Contender] = {}
    for one in sorted(contenders, key=lambda one: one.gain):
        best[one.trial.candidate.name] = one
    return [*best.values()]


def _is_of_one_law(one: str, other: str) -> bool:
    """Whether two effects are different ones that go by the same place or speed, in the same way."""
    if one == other or one in NAMES:
        return False
    first, second = find(one), find(other)
    return (first.family, first.against, first.is_load) == (second.family, second.against, second.is_load)


def _simplest(named: Sequence[Contender], near: bool) -> Contender:
    """The most probable, or a term of its series that is not far less: the motion shows no more than that.

    near: whether the recordings' noise tells no law from another.
    """
    first = named[0]
    terms = () if first.trial.faults else find(first.trial.candidate.name).terms
    its = [one for one in named if one.trial.candidate.name in terms and (near or not first.is_told_apart_from(one))]
    return its[0] if its else first


def _without_series(others: Sequence[Trial]) -> list[Trial]:
    """Those of which no term of the series is among them: what a constant does, an arm's weight does at some angle."""
    names = {trial.candidate.name for trial in others}
    return [trial for trial in others if names.isdisjoint(find(trial.candidate.name).terms)]


def _of_other_parts(best: Trial, others: Sequence[Trial]) -> list[Trial]:
    """Those that are of another part than the best: a drive's delays are alike, and any of them names the drive.

    What has the best as a term of its series is the same, seen over a short travel.
    """
    name, is_drive = best.candidate.name, find(best.candidate.name).family == "drive"
    apart = [trial for trial in others if name not in find(trial.candidate.name).terms]
    return [trial for trial in apart if find(trial.candidate.name).family != "drive"] if is_drive else apart


def _of_drive(one: Candidate) -> bool:
    return one.name not in NAMES and find(one.name).family == "drive"


def _still_alike(story: Story, rivals: Sequence[Trial]) -> list[Trial]:
    """An effect and its rivals, where the last model still has it and cannot tell it from them."""
    known = {one.name: one.same_as for one in story.added}
    names = known.get(rivals[0].candidate.name, ()) if rivals else ()
    alike = [rival for rival in rivals[1:] if rival.candidate.name in names]
    return [rivals[0], *alike] if alike else []


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
