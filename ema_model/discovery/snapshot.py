"""What the page shows of a discovery at one moment: the model so far, what it leaves, and what may be missing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.explain import Explanation
from ema_model.comparison.residuals import Residuals, residuals_of
from ema_model.discovery.history import Step, Story
from ema_model.discovery.remaining import Left
from ema_model.discovery.result import Added, Candidate, Discovery
from ema_model.discovery.rounds import Refits, Rounds
from ema_model.discovery.search import refits_beside
from ema_model.discovery.thresholds import WORTH_A_LOOK
from ema_model.discovery.words import primary
from ema_model.effects import find
from ema_model.effects.user import Expression
from ema_model.effects.user.expression import Size, beginnings
from ema_model.estimation.model_fit import floor_ratio
from ema_model.faults import BY_NAME, causes
from ema_model.quantities import HALF_90

Array = NDArray[np.float64]
Known = TypeVar("Known")

_VARIABLES = {"t": "time", "theta": "motor_angle", "omega": "motor_speed", "q": "current", "user": "user_position"}
_USUAL_NM = 1e-3  # at a motor's shaft, where it cannot be said how much is left
_RIVAL = 25.0  # of χ², below which a candidate is too faint to be taken for another
_SAME_CHI2 = 25.0  # between two of them, below which they cannot be told apart
_SAME_DIRECTION = 1.0 - 0.98**2  # sin² between their signatures, likewise


@dataclass(frozen=True, eq=False)
class Assessment:
    """What a model leaves and what may be missing; it belongs to one step of a story."""

    left: Left
    candidates: Sequence[Candidate]
    signatures: Mapping[str, Array]  # (values,) over the floor
    alike: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    is_refined: bool = False  # whether the most probable are all refitted
    refitted: Mapping[str, float] = field(default_factory=dict)  # the error with those that are, in floors
    spoken_against: Mapping[str, str] = field(default_factory=dict)  # why what is so probable would not be named

    def probability(self, name: str) -> float:
        """That a candidate is missing, or what looks like it: by algebra, or by its refit once that is known."""
        names = {name, *self.alike.get(name, ())}
        return min(1.0, sum(one.probability or 0.0 for one in self.candidates if one.name in names))


@dataclass(frozen=True, eq=False)
class Look:
    """A story as it stands.  Without an assessment, the candidates are still being scored."""

    found: Discovery
    added: tuple[Added, ...]
    steps: int
    chi2: float  # of the last model's fit, the prior within it, of which candidates' falls are
    values: int  # that it is a sum of
    counts: Array  # (blocks,), how much each counts in the ladder's means
    residuals: Residuals
    weights: Sequence[Mapping[str, float]]  # of the fitted signals in each window, over the floor's σ
    sigmas: Sequence[Mapping[str, Array]]
    assessment: Assessment | None = None
    reach: tuple[str, ...] = ()  # names of recordings: fitted
    held: tuple[str, ...] = ()  # and held out
    explained_before: Sequence[Explanation] = ()  # the calibrated model's residual, before any step

    @property
    def rmse(self) -> float:
        """Error of the last model, in floors."""
        return self.found.ladder[-1].rmse

    @property
    def promising(self) -> list[Candidate]:
        """Candidates that are worth a refit, the best first; none where no more is left than a true model leaves."""
        if self.assessment is None or self.found.at_floor:
            return []
        return [one for one in self.assessment.candidates if not one.obstacle and self.is_worth(one)]

    def candidate(self, name: str) -> Candidate | None:
        """The candidate of that name."""
        known = self.assessment.candidates if self.assessment else ()
        return next((one for one in known if one.name == name), None)

    @staticmethod
    def is_worth(one: Candidate) -> bool:
        """Whether so much would hardly be chance."""
        return one.predicted_drop > WORTH_A_LOOK

    def probability(self, one: Candidate) -> float:
        """That a candidate is missing, or what looks like it; 0 while the candidates are still being scored."""
        return self.assessment.probability(one.name) if self.assessment else 0.0

    def predicted_rmse(self, one: Candidate) -> float:
        """The error with a candidate in the model, in floors: as refitted, else by algebra."""
        known = self.assessment.refitted.get(one.name) if self.assessment else None
        return min(self.error_with(one) if known is None else known, self.rmse)

    def error_with(self, one: Candidate) -> float:
        """The same of a candidate that may make it worse."""
        squared, counted = 0.0, 0.0
        for signal in self.weights[0]:
            left, change = self.residuals.values.get(signal), self.change(one, signal)
            if left is None or change is None or len(left) != len(change):
                return self.rmse
            squared += float(np.sum(self.counts * ((left - change) / self.residuals.sigma[signal]) ** 2))
            counted += float(np.sum(self.counts))
        return math.sqrt(squared / counted) if counted else self.rmse

    def share(self, one: Candidate) -> float:
        """Of the squared error in floors, that a candidate is predicted to take away, 0 … 1."""
        return 1.0 - (self.predicted_rmse(one) / self.rmse) ** 2

    def uncertainty(self, one: Candidate) -> float | None:
        """Half of the 90 % interval of the first parameter; None where that is no strength.

        A strength that explains d of χ² is known to 1/√d of itself, times what would then be left over the noise.
        """
        if one.name in BY_NAME:
            return None  # a fault is not straight in k: only a fit tells how well it is known
        first = find(one.name, self.found.actuator.axes).parameters[0]
        if first.low > 0.0 or one.predicted_drop <= 0.0:
            return None
        left = max(1.0, (self.chi2 - one.predicted_drop) / max(1, self.values))
        return HALF_90 * abs(one.settings[first.name]) * math.sqrt(left / one.predicted_drop)

    @property
    def removable(self) -> list[str]:
        """Keys of what was added, which can be taken out again: of the effects, then the first of each fault's."""
        return [*(one.key for one in self.added), *causes(self.found.faults)]

    @property
    def primary(self) -> str:
        """The signal whose residual tells most."""
        return primary(self.found)

    def change(self, one: Candidate, signal: str) -> Array | None:
        """What a candidate would change in a signal, (blocks,) beside `residuals`, in the signal's unit."""
        whole = self.assessment.signatures.get(one.name) if self.assessment else None
        if whole is None:
            return None
        parts, at = [], 0
        for weights, sigmas in zip(self.weights, self.sigmas):
            for name, weight in weights.items():
                blocks = len(sigmas[name])
                if name == signal:
                    parts.append(whole[at : at + blocks] * sigmas[name] / weight)
                at += blocks
        return np.concatenate(parts) if parts else None


def assessed(story: Story, rounds: Rounds | None = None) -> Assessment:
    """What the last model of a story leaves; takes a second or two, and the first time a compilation.

    rounds: those of it that are known.
    """
    left, seen = story.left(), (rounds or Rounds()).beside(story)
    candidates = seen.candidates()
    changes = {one.candidate.name: one.change for one in seen.best if one.change is not None}
    worth = {one.name for one in candidates if not one.obstacle and one.predicted_drop > _RIVAL}
    return Assessment(left, candidates, changes, _alike({name: its for name, its in changes.items() if name in worth}))


def refined(
    story: Story,
    seen: Assessment,
    rounds: Rounds,
    tell: Callable[[str], None],
    shown: Callable[[Assessment], None],
) -> tuple[Assessment, Refits]:
    """What the last model of a story leaves, once the most probable candidates are refitted; and these refits.

    shown is given it as it stands after each few of them; tell may raise to stop.
    """

    def with_refits(found: Refits) -> Assessment:
        data = story.data
        fits = {one.trial.candidate.name: one.trial.fit for one in found.contenders}
        errors = {name: floor_ratio(data, one.plant, one.calibration.signals) for name, one in fits.items()}
        return replace(seen, candidates=found.candidates, refitted=errors)

    found = refits_beside(story, rounds, tell, lambda so_far: shown(with_refits(so_far)))
    return replace(with_refits(found), is_refined=True, spoken_against=found.spoken_against), found


def _alike(signatures: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Effects and faults whose signatures no refit is expected to tell apart, by name."""
    return {
        name: tuple(other for other, its in signatures.items() if other != name and _same(own, its))
        for name, own in signatures.items()
    }


def _same(one: Array, other: Array) -> bool:
    first, second, shared = one @ one, other @ other, one @ other
    if min(first, second) == 0.0:
        return False
    apart = 1.0 - max(shared, 0.0) ** 2 / (first * second)
    return bool(apart < _SAME_DIRECTION or max(first, second) * apart < _SAME_CHI2)


def known_of(step: Step, known: Mapping[Step, Known]) -> Known | None:
    """What is known of a step, or of the one that it was settled from."""
    at: Step | None = step
    while at is not None and at not in known:
        at = at.settled_from
    return None if at is None else known[at]


def look_at(story: Story, found: Discovery, assessment: Assessment | None, first: Assessment | None = None) -> Look:
    """A picture of a story that later steps leave as it is; first: of its calibrated model."""
    fit, data = story.current, story.data
    known: list[dict[str, Array]] = [{} for _ in fit.plant.windows]
    weights, sigmas = [], []
    for window, one in zip(fit.plant.windows, data.floors):
        weights.append(data.fitted(window.measured))
        sigmas.append({name: np.broadcast_to(one.fit_sigma(name), (window.blocks,)) for name in weights[-1]})
    return Look(
        found=found,
        added=story.added,
        steps=len(story.steps),
        chi2=fit.chi2,
        values=fit.residual.size,
        counts=np.concatenate([one.counts for one in data.floors]),
        residuals=residuals_of(fit.plant, data.told_in, fit.calibration.signals, known, fit.calibration.actuator),
        weights=weights,
        sigmas=sigmas,
        assessment=assessment,
        reach=tuple(one.name for one in data.measurements),
        held=() if story.held is None else tuple(one.name for one in story.held.measurements),
        explained_before=first.left.explained if first is not None else (),
    )


def user_begins(look: Look, expression: Expression) -> dict[str, Size]:
    """Where a fit of a user's torque begins, for each of its parameters: as the last model's residual suggests."""
    left = look.residuals
    sizes = {name: _usual(left.variables[own]) for name, own in _VARIABLES.items() if own in left.variables}
    orders = (one.settings["order"] for one in look.promising if "order" in one.settings)
    order = next((one for one in orders if math.isfinite(one)), 1.0)
    return beginnings(expression, _torque_left(left), sizes, order)


def _torque_left(left: Residuals) -> float:
    """rms, N·m: of the torque where it was measured, else of the current."""
    if "motor_torque_Nm" in left.values:
        return _usual(left.values["motor_torque_Nm"])
    if "current_A" in left.values and left.torque_constant is not None:
        return left.torque_constant * _usual(left.values["current_A"])
    return _USUAL_NM


def _usual(values: Array) -> float:
    good = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(good**2))) if len(good) else 0.0
