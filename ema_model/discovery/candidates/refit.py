"""A candidate in the model, refitted."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ema_model.discovery.criteria import HALF, LEAST_BIC
from ema_model.discovery.result import Candidate
from ema_model.effects import CATALOGUE, Effect, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation import default_free
from ema_model.estimation.model_fit import Data, Fit, fit, with_effect
from ema_model.quantities.axes import Axes

Progress = Callable[[str], None]

LEAST_FALL = 0.004  # of the error: what is less is immaterial
_SCORE = 0.4  # of what a refit gives, that a score may have fallen short of predicting
_RECENTRED = 4  # times that a refit begins anew from where its first guess held it back
_HELD_BACK = 2.0  # σ of that guess, from which on it did
_FOUND = (*ANGLES, "order")  # what no guess holds back: any angle is as likely, a pitch is as exact as the travel
_UNMOVED = 1.0  # σ
_NEAR = 5.0  # of the floor
_ALIKE = 0.9  # cosine of two parameters' columns, from which on they do the same
_STRAINED = 2.0  # σ, from which on a parameter may be what holds an effect's place
_AS_IN_THE_FILE: Mapping[str, float] = {}  # a start
_BENT = 0.2  # of the greatest fall of χ² that is predicted
_FAINT = 0.1  # of the suggested strength, from which a fit that went astray begins anew


@dataclass(frozen=True)
class Trial:
    """Effects in the model: settings by name."""

    candidate: Candidate
    effects: Mapping[str, Mapping[str, float]]
    fit: Fit
    drop: float  # of χ²
    faults: tuple[str, ...] = ()  # k1 … k8 that it frees, in place of effects
    same_as: str = ""  # of a fault: the effect that tells as much
    yields: bool = False  # to that effect


def tried(
    data: Data, current: Fit, candidate: Candidate, effects: Mapping[str, Mapping[str, float]], tell: Progress
) -> Trial:
    """The effects in the model, refitted together with all that it holds."""
    best = _refitted(data, current, effects, current.starts, tell)
    if best.chi2 > current.chi2:  # it began too strong to find back
        faint = {name: weakened(find(name, current.actuator.axes), settings) for name, settings in effects.items()}
        best = _better(best, _refitted(data, current, faint, current.starts, tell))
    best = _recentred(data, current, best, effects, tell)
    if best.error() > HALF * current.error() and is_near(current) and _is_strained(current):
        best = _better(best, _refitted(data, current, _sized(data, current, effects, tell), _AS_IN_THE_FILE, tell))
    return Trial(candidate, effects, best, current.chi2 - best.chi2)


def again(data: Data, current: Fit, trial: Trial, tell: Progress) -> Trial:
    """A trial refitted from the file's values, too, beside the effects as it has them; the better of both.

    Its own way began where the smaller model ended, which may be held there by the start of a recording.
    """
    best = _better(trial.fit, _refitted(data, current, settings_in(trial.fit, trial.effects), _AS_IN_THE_FILE, tell))
    return replace(trial, fit=best, drop=current.chi2 - best.chi2)


def _recentred(data: Data, current: Fit, best: Fit, effects: Mapping[str, Mapping[str, float]], tell: Progress) -> Fit:
    """A refit that began anew from where its first guess held it back."""
    for _ in range(_RECENTRED):
        if best.chi2 > current.chi2 - LEAST_BIC or not held_back(best, effects):
            break
        other = _refitted(data, current, settings_in(best, effects), current.starts, tell)
        if other.chi2 > best.chi2:
            break
        best = other
    return best


def is_near(current: Fit) -> bool:
    """Whether so little is left that the last of what a descent might still find decides anything."""
    return current.error() < _NEAR


def _is_strained(current: Fit) -> bool:
    """Whether a parameter stands so far from the file's value that it may stand in for what is missing."""
    return any(abs(one.z) > _STRAINED for one in current.calibration.parameters.values())


def _sized(
    data: Data, current: Fit, effects: Mapping[str, Mapping[str, float]], tell: Progress
) -> Mapping[str, Mapping[str, float]]:
    """The effects as large as the recordings ask for where all else is held at the file's values.

    Beside parameters that have long taken up what an effect does, the way to it leads up first.
    """
    held = tuple(default_free(current.actuator))
    for _ in range(_RECENTRED):
        found = _refitted(data, current, effects, _AS_IN_THE_FILE, tell, held)
        effects = settings_in(found, effects)
        if not held_back(found, effects):
            break
    return effects


def _better(one: Fit, other: Fit) -> Fit:
    return min(one, other, key=lambda found: found.chi2)


def settings_in(found: Fit, effects: Iterable[str]) -> dict[str, Mapping[str, float]]:
    """Of these effects, as a fit found them."""
    return {name: dict(found.calibration.actuator.effects[name]) for name in effects}


def stands_for(before: Fit, trial: Trial) -> str:
    """The path of the base parameter outside its tolerance that an effect beside this fit would be; "" for none.

    A parameter that is free, and stays where the file has it, is not what is missing, nor is one that moves the signals
    otherwise, though a reading alone would not tell the two apart: a constant load moves the axis, the bias of a
    logger's current does not.
    """
    name = trial.candidate.name
    path = find(name).duplicates
    if not path:
        return ""
    free = before.calibration.parameters.get(path)
    if free is not None and not free.at_bound and abs(free.z) < _UNMOVED:
        return ""
    return path if _moves_alike(trial.fit, path, f"effects.{name}.{find(name).parameters[0].name}") else ""


def _moves_alike(found: Fit, *paths: str) -> bool:
    """Whether two parameters move the fitted signals in the same way, as far as both are free."""
    names = [*found.calibration.parameters]
    if any(path not in names for path in paths):
        return True
    one, other = (found.calibration.weighted_jacobian[:, names.index(path)] for path in paths)
    return abs(float(one @ other)) > _ALIKE * float(np.linalg.norm(one) * np.linalg.norm(other))


def _refitted(
    data: Data,
    current: Fit,
    effects: Mapping[str, Mapping[str, float]],
    start: Mapping[str, float],
    tell: Progress,
    held: tuple[str, ...] = (),
) -> Fit:
    """The model with the effects, fitted from a start; held: parameters that stay as the file has them."""
    actuator = current.actuator
    for name, settings in effects.items():
        actuator = with_effect(actuator, name, settings)
    return fit(data, actuator, start, tell, current.faults, held)


def held_back(found: Fit, effects: Iterable[str]) -> bool:
    """Whether a parameter of the effects ended so far from the guess that it began with that this holds it back."""
    for name in effects:
        for parameter in find(name, found.actuator.axes).parameters:
            one = found.calibration.parameters.get(f"effects.{name}.{parameter.name}")
            if one is None or abs(one.z) < _HELD_BACK or parameter.name in _FOUND:
                continue
            near = 0.01 * abs(one.value)
            if parameter.low + near < one.value < parameter.high - near:
                return True
    return False


def weakened(effect: Effect, settings: Mapping[str, float]) -> dict[str, float]:
    first = effect.parameters[0]
    return {**settings, first.name: max(first.low, _FAINT * settings[first.name])}


def promising(
    current: Fit,
    ranked: Sequence[Candidate],
    share: float,
    most: int,
    expected: Mapping[str, float] | None = None,
) -> list[Candidate]:
    """Candidates worth a refit: near the best, and such that a refit might make the data pay for them.

    expected: the evidence that is predicted for each; without it, the fall of χ².  What would be a parameter of the
    actuator that stands at its bound is refitted where it would take a fair share of χ², too: others have gone out of
    its way.  So are the terms of an effect's series, which only a refit has at all of their parameters.
    """
    told = {c.name: c.predicted_drop for c in ranked} | dict(expected or {})
    values = len(current.residual)
    material = (1.0 - (1.0 - LEAST_FALL) ** 2) * current.chi2
    needed = {c.name: fitted_count(c.name, current.actuator.axes) * np.log(values) + LEAST_BIC for c in ranked}
    chosen = [
        c
        for c in ranked
        if not c.obstacle
        and c.predicted_drop > _SCORE * max(material, needed[c.name])
        and told[c.name] > _SCORE * needed[c.name]
    ]
    best = [c for c in chosen if c.predicted_drop >= share * chosen[0].predicted_drop][:most]
    known = current.calibration.parameters
    bent = [c for c in ranked if (path := find(c.name).duplicates) in known and known[path].at_bound]
    least = _BENT * max((c.predicted_drop for c in ranked), default=0.0)
    best += [c for c in bent if c not in best and c.predicted_drop >= least and not c.obstacle]
    terms = {term for c in best if c.name in CATALOGUE for term in CATALOGUE[c.name].terms}
    return best + [c for c in ranked if c.name in terms and c not in best and not c.obstacle]


def with_drops(ranked: Sequence[Candidate], trials: Sequence[Trial]) -> list[Candidate]:
    """All candidates with what their refits gave, the best first."""
    drops: Mapping[str, float] = {trial.candidate.name: trial.drop for trial in trials}
    told = [replace(one, refitted_drop=drops.get(one.name)) for one in ranked]
    return sorted(told, key=lambda one: -(one.refitted_drop if one.refitted_drop is not None else -math.inf))


def fitted_count(name: str, axes: Axes) -> int:
    """Number of an effect's parameters that are fitted."""
    return sum(not parameter.integer for parameter in find(name, axes).parameters)
