"""The search for what is missing: all Terms scored by algebra, the best few refitted, the most probable model kept.

Each round makes the columns of all Terms at the model as it is, looks by algebra at what adding, exchanging and leaving
out would give, refits the few that might be best, and goes on from the one with the greatest evidence, as long as there
is any that is far more probable than what is there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ema_model.discovery.candidates.faults import fault_trial
from ema_model.discovery.candidates.fingerprints import Fingerprint, fingerprints
from ema_model.discovery.candidates.refit import Trial, held_back, weakened
from ema_model.discovery.candidates.score import hidden
from ema_model.discovery.candidates.unknown import is_a_shape
from ema_model.discovery.criteria import FAR, LARGEST_GROUP, LEAST_FALL
from ema_model.discovery.evidence.objections import implausible, ratio, unmeasured, unsteady, within
from ema_model.discovery.evidence.remaining import at_floor
from ema_model.discovery.result import Candidate
from ema_model.discovery.search.evidence import evidence_at, evidence_of, gains_of
from ema_model.discovery.search.terms import AboutFit, Term, noise_of, places_beside, places_of, terms_of
from ema_model.discovery.steps.claim import of_other_parts, without_series
from ema_model.discovery.steps.path import Story
from ema_model.discovery.steps.walking import Walk, of_drive
from ema_model.effects import CATALOGUE, catalogue_name, find
from ema_model.estimation.calibrate import problem_of
from ema_model.estimation.model_fit import Data, Fit, fit, floor_ratio, holdout_signals, with_effect
from ema_model.estimation.noise import NoiseModel
from ema_model.faults import NAMES, causes
from ema_model.side_by_side import fits

Progress = Callable[[str], None]

_ANY_MISSING = 0.5  # probability that anything of the catalogue is missing
_RECENTRED = 3  # times that a refit begins anew from where its first guess held it back
_CLOSER = 12  # Terms that are looked at with the noise that each leaves
_MADE_ANEW = 32  # Terms beside a further model, by what those of the first one tell beside it
_REFITTED = 4
_LEAST_SCORE = 2.0  # logarithm of the evidence, by algebra, from which on a refit may make it enough
_NAMED = math.log(99.0)  # odds of 99 to 1
_AS_WELL = math.log(10.0)  # odds of 10 to 1, by their best fits alone
_APART = 0.5  # orders, closer than which two are one
_MIGHT = 0.6  # of the greatest gain by algebra, from which on a Term may be the best once it is refitted


@dataclass(frozen=True, eq=False)
class ScoredTerm:
    """A Term beside a model, by algebra."""

    term: Term
    gain: float  # of the logarithm of the evidence, with what is known of the Term beforehand
    candidate: Candidate
    start: Mapping[str, float]  # of a refit: where the model's own unknowns go beside it, in σ


def probability_of_fit(data: Data, held: Data | None, found: Fit, noise: NoiseModel) -> tuple[float, float]:
    """Logarithms of a refitted model's evidence, and of the probability density at its most probable parameters.

    They are taken where the fit ended, or where the algebra would go from there if that, simulated, is more probable.
    A further parameter of an effect, that does nothing by default, is as likely not there.  Recordings that were not
    fitted count by how probable the model makes them.
    """
    whole = AboutFit.of(found, noise)
    problem = problem_of(found.plant, data.floors, free=found.calibration.free, signals=data.signals)

    def about(left_out: Sequence[int]) -> tuple[float, float]:
        own = whole.without(left_out)
        best = evidence_of(noise, own.residual, own.unknowns)
        moved = whole.to_mean(left_out)
        there = moved.copy()
        there[np.setdiff1d(np.arange(len(there)), left_out)] = best.amounts
        points = problem.clip(found.calibration.x + np.array([moved, there]))
        shown = problem.residuals(points)[:, : problem.values]
        amounts = np.array([np.zeros(len(best.amounts)), best.amounts])
        return max(evidence_at(noise, noise.coefficients(one), own.unknowns, a) for one, a in zip(shown, amounts))

    log, density = about([])
    beside = places_beside(found)
    if beside:
        plain = about(beside)
        log, density = float(np.logaddexp(log, plain[0])) - math.log(2.0), max(density, plain[1])
    unseen = 0.0 if held is None else log_predictive(held, found)
    return log + unseen, density + unseen


def evidence_of_fit(data: Data, held: Data | None, found: Fit, noise: NoiseModel) -> float:
    """Logarithm of a refitted model's evidence."""
    return probability_of_fit(data, held, found, noise)[0]


def log_predictive(held: Data, found: Fit) -> float:
    """Logarithm of the probability of recordings that were not fitted."""
    plant = held.plant(found.calibration.actuator)
    shown = held.over_floor(plant, holdout_signals(held, found))
    measured = held.over_floor(plant, [window.measured for window in plant.windows])
    noise = noise_of(held, replace(found, plant=plant))
    left = noise.coefficients(np.nan_to_num(shown - measured, nan=1e6, posinf=1e6, neginf=-1e6))
    return noise.log_likelihood(left, noise.levels(left))


def scored_terms(found: Fit, terms: Sequence[Term], noise: NoiseModel) -> list[ScoredTerm]:
    """The best variant of each Term beside a model, the most probable first."""
    if not terms:
        return []
    about = AboutFit.of(found, noise)
    own = evidence_of(noise, about.residual, about.unknowns)
    names = [*found.calibration.parameters, *found.calibration.starts]

    def roughly(term: Term, gain: float) -> ScoredTerm:
        start = dict(zip(names, map(float, found.calibration.x)))
        return ScoredTerm(term, gain, term.candidate(np.zeros(len(term.unknowns.mean)), found), start)

    def closer(term: Term) -> ScoredTerm:
        whole = evidence_of(noise, about.residual, about.unknowns.beside([term.unknowns]), own.levels)
        moved, amounts = np.split(whole.amounts, [len(names)])
        drop = float(own.residual @ own.residual - whole.residual @ whole.residual)
        start = dict(zip(names, map(float, found.calibration.x + moved)))
        return ScoredTerm(term, whole.log - own.log + term.log_share, term.candidate(amounts, found, drop), start)

    rough = gains_of(noise, own, about.unknowns, [one.unknowns for one in terms]) + [one.log_share for one in terms]
    variants: dict[str, list[int]] = {}
    for i in np.argsort(-rough):
        variants.setdefault(terms[i].name, []).append(int(i))
    scored = []
    for place, its in enumerate(variants.values()):
        looked_at = [closer(terms[i]) for i in its[:2]] if place < _CLOSER else [roughly(terms[its[0]], rough[its[0]])]
        scored.append(max(looked_at, key=lambda one: one.gain))
    return sorted(scored, key=lambda one: -one.gain)


def refitted(data: Data, current: Fit, one: ScoredTerm, tell: Progress = lambda text: None) -> Trial:
    """A Term in a model, refitted from where the algebra has it."""
    candidate = one.candidate
    if one.term.fingerprint is None:
        return fault_trial(data, current, candidate, tell, one.start)
    tell(f"trying {candidate.name}")
    key, settings, start = one.term.name, candidate.settings, one.start
    best = None
    for _ in range(_RECENTRED):
        actuator = with_effect(current.actuator, key, settings)
        found = fit(data, actuator, start, tell, current.faults, rough=True)
        if best is not None and found.chi2 > best.chi2:
            break
        best = found
        if found.chi2 > current.chi2:  # it began too strong to find back
            settings, start = weakened(find(key, current.actuator.axes), settings), current.starts
        elif held_back(found, [key]):
            settings = dict(found.calibration.actuator.effects[key])
            start = {name: x for name, x in found.starts.items() if not name.startswith(f"effects.{key}.")}
        else:
            break
    assert best is not None
    return Trial(candidate, {key: candidate.settings}, best, current.chi2 - best.chi2)


@dataclass(frozen=True, eq=False)
class Contender:
    """A refitted trial, and how much more probable it makes the recordings than the model that it was tried beside."""

    trial: Trial
    gain: float  # logarithm, with what is known of it beforehand
    density: float  # the same at its most probable parameters alone

    def is_told_apart_from(self, other: Contender) -> bool:
        """Whether the recordings tell this one from another that is less probable.

        Not from one that fits as well, and is less probable for its freedom alone.
        """
        return other.gain < self.gain - _NAMED and other.density < self.density - _AS_WELL


@dataclass(frozen=True, eq=False)
class Round:
    """What was seen of all Terms beside one model."""

    beside: Fit
    noise: NoiseModel
    before: float  # logarithm of that model's evidence
    hidden: Sequence[Candidate]  # what the model has no place for, or these recordings cannot show
    best: Sequence[ScoredTerm]  # by algebra, the most probable first

    @property
    def prior(self) -> float:
        """Logarithm of the odds that any one of the Terms is missing."""
        return math.log(_ANY_MISSING / max(1, len(self.best)))


class Search(Walk):
    """A story that goes on by one evidence."""

    def __init__(self, story: Story, tell: Progress, candidates: Sequence[str] | None, most_effects: int) -> None:
        super().__init__(story, tell, candidates, most_effects)
        self._known: Round | None = None
        self._refitted: tuple[Round, list[Contender]] | None = None
        self._exchanges: set[tuple[str, str]] = set()  # that were tried
        self._made: list[Term] | None = None  # all Terms of effects, beside an earlier model
        self._hidden: Sequence[Candidate] = ()

    def _go_to_the_end(self) -> None:
        """Adds, exchanges and takes out what makes the model more probable."""
        story, tell = self.story, self._tell
        while self._going:
            self.go()
        while self._exchanged() or self._doubtful():
            pass
        self._curve_instead()
        story.finish(tell)

    def go(self) -> None:
        """One step; beside as many effects as are asked for, of a fault alone."""
        self._going = self._step()

    def drive_leaves(self) -> float:
        """What the best contenders of the drive leave, in floors."""
        trials = [one.trial for one in self._contenders() if of_drive(one.trial.candidate)]
        return min((ratio(self.story.data, trial.fit) for trial in trials), default=math.inf)

    def _best(self) -> Candidate | None:
        """What would tell most of a loop that is far off."""
        story = self.story
        if ratio(story.data, story.current) <= FAR or not story.current.plant.simulates_commands:
            return None
        best = self._round().best
        return best[0].candidate if best else None

    def _round(self) -> Round:
        """All Terms beside the last model."""
        story, found = self.story, self.story.current
        if self._known is None or self._known.beside is not found:
            noise = noise_of(story.data, found)
            self._tell("scoring the candidates")
            best = scored_terms(found, self._terms(noise), noise)
            before = evidence_of_fit(story.data, story.held, found, noise)
            self._known = Round(found, noise, before, self._hidden, best)
        return self._known

    def _terms(self, noise: NoiseModel) -> list[Term]:
        """The Terms beside the last model: the first time all of them, then anew those that might tell most.

        What a Term changes depends little on what else is in the model: enough to know which are hopeless.
        """
        story, found = self.story, self.story.current
        known, shown = self._made, story.left().orders
        if known is None or found.actuator.axes.motor == "linear":  # whose orders are the residual's
            barred = story.looked_for(self._names or None)
            unseen = [Candidate(name, 0.0, {}, reason) for name, reason in hidden(found, story.prints).items()]
            self._hidden = [*unseen, *barred]
            prints = [*story.prints, *_further_orders(story, shown)]
            terms = terms_of(story.data, found, prints, noise, shown)
            self._made = [one for one in terms if one.fingerprint and not one.fingerprint.frees]
            return terms
        about = AboutFit.of(found, noise)
        own = evidence_of(noise, about.residual, about.unknowns)
        gains = gains_of(noise, own, about.unknowns, [one.unknowns for one in known])
        telling = [known[i] for i in np.argsort(-gains)[:_MADE_ANEW]]
        names = {one.name for one in telling}
        orders = sorted({one.fingerprint.settings["order"] for one in telling if "order" in one.fingerprint.settings})
        present = found.actuator.effects
        ours = [name for name in story.of_the_file if name in present]  # beyond their tolerances
        story.looked_for([*(name for name in CATALOGUE if name in names), *ours], orders)
        terms = terms_of(story.data, found, [*story.prints, *_further_orders(story, orders)], noise, shown)
        return terms + [one for one in known if one.name not in names and one.name not in present]

    def _contenders(self) -> list[Contender]:
        """The few Terms that might be the best beside the last model, refitted, the most probable first."""
        story, seen = self.story, self._round()
        if self._refitted is None or self._refitted[0] is not seen:
            is_full = len({one.name for one in story.added}) >= self._most
            room = [one for one in seen.best if one.term.fingerprint is None or not is_full]
            found: list[Contender] = []
            best = -math.inf
            while len(found) < _REFITTED:
                left = [one for one in room[len(found) :] if one.gain > max(_LEAST_SCORE, best)]
                chosen = [one for one in left if one.gain > _MIGHT * left[0].gain][: _REFITTED - len(found)]
                if not chosen:
                    break
                trials = fits(lambda one, tell: refitted(story.data, seen.beside, one, tell), chosen, self._tell)
                for one, trial in zip(chosen, trials):
                    log, density = probability_of_fit(story.data, story.held, trial.fit, seen.noise)
                    found.append(Contender(trial, log - seen.before + one.term.log_share, density))
                best = max(one.gain for one in found)  # what promises more than this is refitted, too
            self._refitted = seen, sorted(found, key=lambda one: -one.gain)
        return self._refitted[1]

    def _step(self) -> bool:
        story, seen, contenders = self.story, self._round(), self._contenders()
        self._first = self._first or _candidates(seen, contenders)
        named = [one for one in contenders if one.gain + seen.prior > _NAMED and not self._objection(one)]
        if not named:
            return False
        first = _simplest(named)
        name = first.trial.candidate.name
        alike = [one.trial for one in named if one is not first and not first.is_told_apart_from(one)]
        as_probable = {one.candidate.name for one in [first.trial, *alike]}  # terms of a series among them
        alike = [trial for trial in alike if trial.faults or name not in find(trial.candidate.name).terms]
        faults = [trial for trial in alike if trial.faults]
        effects = without_series([trial for trial in alike if not trial.faults])
        others = [*effects, *faults]
        apart = [*(effects if first.trial.faults else of_other_parts(first.trial, effects)), *faults]
        if len(apart) >= LARGEST_GROUP:
            story.refused[first.trial.candidate.name] = f"{len(apart)} others tell as much"
            return False
        if others and not self._rivals:
            self._rivals = [first.trial, *others]
        story.add(first.trial, ties=[trial.candidate.name for trial in others])
        story.finish(self._tell)
        if not first.trial.faults:
            probable = _probabilities(seen, contenders)
            story.set_probability(min(1.0, sum(probable[name] for name in as_probable)))
        return True

    def _objection(self, one: Contender) -> bool:
        """Whether a value that no such part has, or another one in each recording, speaks against a contender.

        Beside what else is missing, recordings may ask for another value each: it counts at the floor, and at the end.
        """
        story, found = self.story, one.trial.fit
        reason = "" if found.calibration.converged else "the fit with it did not converge"
        for key in one.trial.effects:
            reason = reason or unmeasured(story.data, key) or within(story.current, found, key)
            reason = reason or implausible(found, key) or self._idle(found)
            if not reason and at_floor(story.data, found):
                reason = unsteady(story.data, found, key)
        if reason:
            story.refused[one.trial.candidate.name] = reason
        return bool(reason)

    def _idle(self, found: Fit) -> str:
        """Whether the error that is told does not fall: a verdict says no more than its ladder."""
        data, current = self.story.data, self.story.current
        first, last = (floor_ratio(data, one.plant, one.calibration.signals) for one in (current, found))
        if first <= 1.0:
            return "without it no more than the floor is left"
        return "" if last < (1.0 - LEAST_FALL) * first else "the error does not fall with it"

    def _doubtful(self) -> bool:
        """Takes out an effect of which, in the last model, each recording asks for another value."""
        story = self.story
        for one in reversed(story.added):
            reason = implausible(story.current, one.key) or unsteady(story.data, story.current, one.key)
            if reason and one.name in CATALOGUE:
                story.refused[one.name] = reason
                story.remove(one.key)
                return True
        return False

    def _curve_instead(self) -> None:
        """Takes the residual's own curve in place of all effects, where it is more probable than they are together.

        Or where several low orders are one shape within the turn, and no teeth.
        """
        story, seen = self.story, self._round()
        effects = story.current.calibration.actuator.effects
        orders = [effects[one.key]["order"] for one in story.added if "order" in effects[one.key]]
        if not story.added or (at_floor(story.data, story.current) and not is_a_shape(orders)):
            return
        added = story.steps[story.bare :]
        story.restart()
        try:
            curve = story.curve(story.left().explanation, self._tell)
        finally:  # also when it was stopped
            story.steps += added
        if curve is None:
            return
        log = evidence_of_fit(story.data, story.held, curve.fit, seen.noise)
        if is_a_shape(orders) or log > seen.before + (len(story.added) - 1) * seen.prior:
            story.restart()
            self._curve = curve

    def _exchanged(self) -> bool:
        """Takes out what the last model does not need, or puts in its place what makes it more probable."""
        story, tell = self.story, self._tell
        members = [*(one.key for one in story.added), *causes(story.current.faults)]
        if len(members) < 2:
            return False
        seen = self._round()
        whole = AboutFit.of(seen.beside, seen.noise)
        straight = evidence_of(seen.noise, whole.residual, whole.unknowns).log
        for key in members:
            smaller = whole.without(places_of(seen.beside, key))
            if evidence_of(seen.noise, smaller.residual, smaller.unknowns).log < straight - 2.0 * _NAMED:
                continue
            tell(f"trying without {key}")
            found = story.without(key, tell)
            if evidence_of_fit(story.data, story.held, found, seen.noise) > seen.before - _NAMED:
                story.remove(key, found)
                return True
        return any(self._replaced(key, seen, whole, straight) for key in members[:-1])

    def _replaced(self, key: str, seen: Round, whole: AboutFit, straight: float) -> bool:
        """Puts the best other Term in the place of an effect or a fault where that makes the model more probable.

        straight: the logarithm of the whole model's evidence, by algebra.
        """
        story, tell = self.story, self._tell
        if not seen.best:
            return False
        about = whole.without(places_of(seen.beside, key))
        own = evidence_of(seen.noise, about.residual, about.unknowns)
        terms = [one.term for one in seen.best]
        rough = gains_of(seen.noise, own, about.unknowns, [one.unknowns for one in terms])
        term = terms[int(np.argmax(rough + [one.log_share for one in terms]))]
        other = evidence_of(seen.noise, about.residual, about.unknowns.beside([term.unknowns]), own.levels)
        if other.log + term.log_share < straight - _NAMED or (key, term.name) in self._exchanges:
            return False
        self._exchanges.add((key, term.name))
        self._exchanges.add((term.name, key))
        tell(f"weighing {term.name} against {key} again")
        smaller = story.without(key, tell)
        candidate = term.candidate(other.amounts[-len(term.unknowns.mean) :], story.current)
        trial = refitted(story.data, smaller, ScoredTerm(term, 0.0, candidate, smaller.starts), tell)
        gain = evidence_of_fit(story.data, story.held, trial.fit, seen.noise) + term.log_share - seen.before
        if gain < 0.0:
            if key not in NAMES:
                story.tie(key, candidate.name, gain > -_NAMED)
            return False
        if trial.faults or key in NAMES:
            story.remove(key, smaller)
            story.add(trial)
        else:
            story.swap(key, trial)
        return True


def _simplest(named: Sequence[Contender]) -> Contender:
    """The most probable, or a term of its series that is not far less: the motion shows no more than that."""
    first = named[0]
    terms = () if first.trial.faults else find(first.trial.candidate.name).terms
    near = [one for one in named if one.trial.candidate.name in terms and not first.is_told_apart_from(one)]
    return near[0] if near else first


def _further_orders(story: Story, orders: Sequence[float]) -> list[Fingerprint]:
    """Fingerprints of the model's periodic effects at further orders, of these."""
    found = story.current
    present = found.actuator.effects
    names = {name for key in present if (name := catalogue_name(key)) in CATALOGUE and CATALOGUE[name].is_periodic}
    prints = []
    for name in sorted(names):
        known = [values["order"] for key, values in present.items() if catalogue_name(key) == name]
        apart = [one for one in orders if all(abs(one - other) >= _APART for other in known)]
        prints += fingerprints(story.data, found, [f"{name}_{len(known) + 1}"], apart)
    return prints


def _probabilities(seen: Round, contenders: Sequence[Contender]) -> dict[str, float]:
    """How probable each candidate is, of all and none: of what was refitted by that, of the others by algebra."""
    gains = {one.candidate.name: one.gain for one in seen.best}
    gains |= {one.trial.candidate.name: one.gain for one in contenders}
    odds = {name: gain + seen.prior for name, gain in gains.items()}
    whole = float(np.logaddexp.reduce([0.0, *odds.values()]))
    return {name: math.exp(one - whole) for name, one in odds.items()}


def _candidates(seen: Round, contenders: Sequence[Contender]) -> list[Candidate]:
    """All candidates, the most probable first, with what their refits gave; what cannot be shown says so."""
    drops = {one.trial.candidate.name: one.trial.drop for one in contenders}
    probable = _probabilities(seen, contenders)
    found = {one.candidate.name: one.candidate for one in seen.best}
    found |= {one.name: one for one in seen.hidden if one.name not in drops}
    every = [
        replace(one, refitted_drop=drops.get(name), probability=probable.get(name, 0.0)) for name, one in found.items()
    ]
    return sorted(every, key=lambda one: -(one.probability or 0.0))
