"""A round of a search: all Terms beside one model, scored by algebra, and what refits made of the most probable."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ema_model.discovery.evidence import evidence_of, gains_of
from ema_model.discovery.fingerprints import Fingerprint, fingerprints
from ema_model.discovery.history import Story
from ema_model.discovery.refit import Trial
from ema_model.discovery.remaining import ratio
from ema_model.discovery.result import Candidate
from ema_model.discovery.terms import (
    AboutFit,
    Evident,
    ScoredTerm,
    Term,
    evidence_of_fit,
    hidden,
    noise_of,
    scored_terms,
    terms_of,
)
from ema_model.discovery.thresholds import ANY_MISSING, AS_WELL, FAR, HALF, NAMED
from ema_model.effects import CATALOGUE, catalogue_name
from ema_model.estimation.model_fit import Data, Fit
from ema_model.estimation.noise import NoiseModel

Progress = Callable[[str], None]

_MADE_ANEW, _AT_ORDERS = 16, 32  # candidates beside a further model, and Terms at whose orders, by what they tell there
_APART = 0.5  # orders, closer than which two are one


def are_told_apart(gain: float, density: float) -> bool:
    """Whether the recordings tell a model from a less probable one, by the logarithms of what that has more.

    Not from one that fits as well, and is less probable for its freedom alone.
    """
    return gain < -NAMED and density < -AS_WELL


@dataclass(frozen=True, eq=False)
class Contender:
    """A refitted trial, and how much more probable it makes the recordings than the model that it was tried beside."""

    trial: Trial
    gain: float  # logarithm, with what is known of it beforehand
    fitted: float  # the same by what was fitted alone
    density: float  # the logarithm of the probability density at its most probable parameters alone

    def is_told_apart_from(self, other: Contender) -> bool:
        """Whether the recordings tell this one from another that is less probable."""
        return are_told_apart(other.gain - self.gain, other.density - self.density)


@dataclass(frozen=True, eq=False)
class Round:
    """What was seen of all Terms beside one model."""

    beside: Fit
    noise: NoiseModel
    before: Evident  # of that model
    hidden: Sequence[Candidate]  # what the model has no place for, or these recordings cannot show
    best: Sequence[ScoredTerm]  # by algebra, the most probable first

    @property
    def prior(self) -> float:
        """Logarithm of the odds that any one of the Terms is missing."""
        return math.log(ANY_MISSING / max(1, len(self.best)))

    def contender(self, data: Data, held: Data | None, one: ScoredTerm, trial: Trial) -> Contender:
        """A Term that was refitted."""
        after, share = evidence_of_fit(data, held, trial.fit, self.noise), one.term.log_share
        fitted = after.fitted - self.before.fitted + share
        return Contender(trial, after.log - self.before.log + share, fitted, after.density + after.unseen)

    def probabilities(self, contenders: Sequence[Contender] = (), ruled_out: Collection[str] = ()) -> dict[str, float]:
        """How probable each candidate is, of all and none.

        Of what was refitted by that; of the others by algebra, as far as it kept its promise of any that was.
        """
        gains = {one.candidate.name: one.gain for one in self.best}
        refitted = {one.trial.candidate.name: one.gain for one in contenders}
        kept = [gain / gains[name] for name, gain in refitted.items() if gains.get(name, 0.0) > 0.0]
        trust = min(1.0, max(kept)) if kept and max(kept) > 0.0 else 1.0
        gains = {name: min(gain, trust * gain) for name, gain in gains.items()} | refitted
        odds = {name: gain + self.prior for name, gain in gains.items() if name not in ruled_out}
        whole = float(np.logaddexp.reduce([0.0, *odds.values()]))
        return {name: math.exp(one - whole) for name, one in odds.items()}

    def candidates(self, contenders: Sequence[Contender] = (), ruled_out: Collection[str] = ()) -> list[Candidate]:
        """All candidates, the most probable first, with what their refits gave; what cannot be shown says so.

        ruled_out: those that something speaks against, which are not probable, whatever they make of the recordings.
        """
        drops = {one.trial.candidate.name: one.trial.drop for one in contenders}
        probable = self.probabilities(contenders, ruled_out)
        found = {one.candidate.name: one.candidate for one in self.best}
        found |= {one.name: one for one in self.hidden if one.name not in drops}
        every = [
            replace(
                one, refitted_drop=drops.get(name), probability=None if name in ruled_out else probable.get(name, 0.0)
            )
            for name, one in found.items()
        ]
        return sorted(every, key=lambda one: -(one.probability or 0.0))


class Rounds:
    """Rounds beside the models of a story, the last one kept; it may outlast a search."""

    def __init__(self, candidates: Sequence[str] | None = None) -> None:
        self._names = candidates
        self._last: tuple[Fit, Data | None, Round] | None = None  # with what was held out
        self._made: list[Term] = []  # all Terms of effects, beside an earlier model
        self._left = math.inf  # floors, by that model
        self._hidden: Sequence[Candidate] = ()

    def beside(self, story: Story, tell: Progress = lambda text: None) -> Round:
        """All Terms beside the last model of a story."""
        found, held = story.current, story.held
        if self._last is None or self._last[0] is not found or self._last[1] is not held:
            noise = noise_of(story.data, found)
            tell("scoring the candidates")
            best = scored_terms(found, self._terms(story, noise), noise)
            before = evidence_of_fit(story.data, held, found, noise)
            self._last = found, held, Round(found, noise, before, self._hidden, best)
        return self._last[2]

    def begin(self, story: Story) -> None:
        """Beside a story's first model, as a search does: beside a later one, what it holds is no candidate."""
        if not self._made and len(story.steps) > 1:
            self.beside(Story(story.data, story.held, story.steps[:1]))

    def elsewhere(self) -> Rounds:
        """Rounds of another story of the same recordings, which begin with what these know."""
        other = Rounds(self._names)
        other._made, other._left, other._hidden = self._made, self._left, self._hidden
        return other

    def _terms(self, story: Story, noise: NoiseModel) -> list[Term]:
        """The Terms beside the last model: the first time all of them, then anew those that might tell most.

        What a Term changes depends little on what else is in the model, enough to know which are hopeless, unless the
        motion is another one: where the model left much, and leaves half of that.
        """
        found, known, shown = story.current, self._made, story.left().orders
        left = ratio(story.data, found)
        moves_alike = self._left <= FAR or left >= HALF * self._left
        are_of_this = known and moves_alike and len(known[0].columns) == len(found.residual)
        if not are_of_this or found.actuator.axes.motor == "linear":  # whose orders are the residual's
            prints, barred = story.fingerprints(self._names or None)
            unseen = [Candidate(name, 0.0, {}, reason) for name, reason in hidden(found, prints).items()]
            self._hidden = [*unseen, *barred]
            terms = terms_of(story.data, found, [*prints, *_further_orders(story, shown)], noise, shown)
            self._made, self._left = [one for one in terms if one.fingerprint and not one.fingerprint.frees], left
            return terms
        about = AboutFit.of(found, noise)
        own = evidence_of(noise, about.residual, about.unknowns)
        gains = gains_of(noise, own, about.unknowns, [one.unknowns for one in known])
        telling = [known[i] for i in np.argsort(-gains)]
        names = {*[*dict.fromkeys(one.name for one in telling)][:_MADE_ANEW]}
        its = [one.fingerprint.settings for one in telling[:_AT_ORDERS]]
        orders = sorted({settings["order"] for settings in its if "order" in settings})
        present = found.actuator.effects
        ours = [name for name in story.of_the_file if name in present]  # beyond their tolerances
        prints, _ = story.fingerprints([*(name for name in CATALOGUE if name in names), *ours], orders)
        terms = terms_of(story.data, found, [*prints, *_further_orders(story, orders)], noise, shown)
        return terms + [one for one in known if one.name not in names and one.name not in present]


@dataclass(frozen=True, eq=False)
class Refits:
    """What refits made of the most probable Terms of a round."""

    round: Round
    contenders: list[Contender]  # the most probable first
    spoken_against: dict[str, str]  # why what is so probable is not named, by the candidate's name

    @property
    def candidates(self) -> list[Candidate]:
        """All of the round, the most probable first."""
        return self.round.candidates(self.contenders, self.spoken_against)


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
