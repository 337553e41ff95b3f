"""How probable models are: fitted ones, and by algebra what each Term would make of one.

About a fitted model its signals are straight in its parameters and in the amounts of Terms, in the noise model's
coefficients; the evidence of either is a few solves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.evidence import Unknowns, evidence_at, evidence_of, gains_of
from ema_model.discovery.result import Candidate
from ema_model.discovery.terms import Term, noise_of, strong_case
from ema_model.effects import CATALOGUE, catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation.calibrate import problem_of
from ema_model.estimation.model_fit import Data, Fit, holdout_signals
from ema_model.estimation.noise import NoiseModel
from ema_model.faults import NAMES, cause_of

Array = NDArray[np.float64]

_FURTHER = 3  # steps of a fitted model by algebra, each from what the one before it gave
_WORTH_A_RUN = 0.5  # of the logarithm of a probability, that a step promises
_CLOSER = 12  # Terms that are looked at with the noise that each leaves


@dataclass(frozen=True, eq=False)
class AboutFit:
    """A fitted model, straight about where it ended, in the noise model's coefficients."""

    unknowns: Unknowns  # steps from there, in σ of the tolerances
    residual: Array  # (values,)

    @classmethod
    def of(cls, found: Fit, noise: NoiseModel) -> AboutFit:
        """Of a fit; what is known of its effects' parameters is the catalogue's, not a refit's tolerance."""
        calibration = found.calibration
        names = [*calibration.parameters, *calibration.starts]
        mean, sigma = -calibration.x.copy(), np.ones(len(names))
        for i, name in enumerate(names):
            if name.startswith("effects."):
                mean[i], sigma[i] = _of_catalogue(found, name)
        low, high = calibration.room
        columns = np.nan_to_num(noise.coefficients(calibration.weighted_jacobian), posinf=0.0, neginf=0.0)
        unknowns = Unknowns(columns, mean, sigma, np.minimum(low, 0.0), np.maximum(high, 0.0))
        return cls(unknowns, noise.coefficients(found.residual))

    def to_mean(self, places: Sequence[int]) -> Array:
        """The step that takes some unknowns to what is expected of them beforehand, (unknowns,)."""
        steps = np.zeros(len(self.unknowns.mean))
        steps[places] = self.unknowns.mean[places]
        return steps

    def without(self, places: Sequence[int]) -> AboutFit:
        """The model with some unknowns held at what is expected of them: an effect at nothing."""
        moved = self.residual + self.unknowns.columns @ self.to_mean(places)
        return AboutFit(self.unknowns.without(places), moved)


def places_of(found: Fit, key: str) -> list[int]:
    """Where the unknowns of one of a fit's effects, or of a fault, stand."""
    names = [*found.calibration.parameters, *found.calibration.starts]
    own = cause_of(key) if key in NAMES else ()
    return [i for i, name in enumerate(names) if name in own or name.startswith(f"effects.{key}.")]


def places_beside(found: Fit) -> list[int]:
    """Where the unknowns stand of further parameters of effects, which do nothing by default."""
    places = []
    for i, name in enumerate([*found.calibration.parameters, *found.calibration.starts]):
        if name.startswith("effects."):
            _, key, own = name.split(".")
            if own in find(key, found.actuator.axes).beside:
                places.append(i)
    return places


def _of_catalogue(found: Fit, path: str) -> tuple[float, float]:
    """What the catalogue says of an effect's parameter: mean and σ, as steps from the fit in its own σ."""
    _, key, own = path.split(".")
    effect = find(key, found.actuator.axes)
    parameter = next(one for one in effect.parameters if one.name == own)
    value, unit = found.calibration.parameters[path].value, found.actuator.tolerances[path].sigma
    if key not in CATALOGUE and catalogue_name(key) not in CATALOGUE:  # a curve's own knots
        return -value / unit, 1.0
    half = 0.5 * (parameter.high - parameter.low)
    half = half if math.isfinite(half) else max(abs(parameter.default), abs(value))
    if own in ANGLES:
        about, spread = value, math.pi / math.sqrt(3.0)
    elif parameter is effect.parameters[0]:
        about = effect.nothing if math.isfinite(effect.nothing) else parameter.default
        spread = max(strong_case(found, effect), abs(effect.severities[2] - about))
    else:
        about, spread = parameter.default, half
    return (about - value) / unit, max(spread / unit, 1e-6)


class Evident(NamedTuple):
    """Of a fitted model, logarithms: how probable it makes the recordings."""

    fitted: float  # those that it was fitted to
    unseen: float  # given these, those that were held out
    density: float  # those that it was fitted to, at its most probable parameters alone

    @property
    def log(self) -> float:
        """All of them."""
        return self.fitted + self.unseen


def evidence_of_fit(data: Data, held: Data | None, found: Fit, noise: NoiseModel) -> Evident:
    """The evidence of a refitted model.

    It is taken where the fit ended, or where the algebra would go from there if that, simulated, is more probable; and
    where it would go from what was simulated, as long as that promises more: two unknowns that count by their product,
    as an inertia and its share, are far from straight.

    A further parameter of an effect, that does nothing by default, is as likely not there.
    """
    whole = AboutFit.of(found, noise)
    problem = problem_of(found.plant, data.floors, free=found.calibration.free, signals=data.signals)

    def about(left_out: Sequence[int]) -> tuple[float, float]:
        own = whole.without(left_out)
        moved = whole.to_mean(left_out)
        free = np.setdiff1d(np.arange(len(moved)), left_out)

        def simulated(amounts: Array) -> Array:
            points = np.tile(found.calibration.x + moved, (len(amounts), 1))
            points[:, free] += amounts
            shown = problem.residuals(problem.clip(points))[:, : problem.values]
            return np.array([noise.coefficients(one) for one in shown])

        there = evidence_of(noise, own.residual, own.unknowns).amounts
        first = np.array([np.zeros(len(there)), there])
        residuals = simulated(first)
        best = max(evidence_at(noise, one, own.unknowns, a) for one, a in zip(residuals, first))
        for _ in range(_FURTHER):
            promised = evidence_of(noise, residuals[-1] - own.unknowns.columns @ there, own.unknowns)
            if promised.log < best[0] + _WORTH_A_RUN:
                break
            there = promised.amounts
            residuals = simulated(there[None, :])
            best = max(best, evidence_at(noise, residuals[-1], own.unknowns, there))
        return best

    log, density = about([])
    beside = places_beside(found)
    if beside:
        plain = about(beside)
        log, density = float(np.logaddexp(log, plain[0])) - math.log(2.0), max(density, plain[1])
    return Evident(log, 0.0 if held is None else log_predictive(held, found), density)


def log_predictive(held: Data, found: Fit) -> float:
    """Logarithm of the probability of recordings that were not fitted."""
    plant = held.plant(found.calibration.actuator)
    shown = held.over_floor(plant, holdout_signals(held, found))
    measured = held.over_floor(plant, [window.measured for window in plant.windows])
    noise = noise_of(held, replace(found, plant=plant))
    left = noise.coefficients(np.nan_to_num(shown - measured, nan=1e6, posinf=1e6, neginf=-1e6))
    return noise.log_likelihood(left, noise.levels(left))


@dataclass(frozen=True, eq=False)
class ScoredTerm:
    """A Term beside a model, by algebra."""

    term: Term
    gain: float  # of the logarithm of the evidence, with what is known of the Term beforehand
    candidate: Candidate
    start: Mapping[str, float]  # of a refit: where the model's own unknowns go beside it, in σ
    change: Array | None = None  # of the model's signals with it, all that follows included, over the floor: (values,)


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
        change = found.calibration.weighted_jacobian @ moved + term.columns @ amounts
        gain = whole.log - own.log + term.log_share
        return ScoredTerm(term, gain, term.candidate(amounts, found, drop), start, change)

    rough = gains_of(noise, own, about.unknowns, [one.unknowns for one in terms]) + [one.log_share for one in terms]
    variants: dict[str, list[int]] = {}
    for i in np.argsort(-rough):
        variants.setdefault(terms[i].name, []).append(int(i))
    scored = []
    for place, its in enumerate(variants.values()):
        looked_at = [closer(terms[i]) for i in its[:2]] if place < _CLOSER else [roughly(terms[its[0]], rough[its[0]])]
        scored.append(max(looked_at, key=lambda one: one.gain))
    return sorted(scored, key=lambda one: -one.gain)
