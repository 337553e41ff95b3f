"""A candidate in the model, refitted: an effect, or a fault of the actuator, which then stays free like a parameter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ema_model.discovery.result import Candidate
from ema_model.effects import Effect, catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation.model_fit import Data, Fit, fit, with_effect
from ema_model.estimation.problem import to_vector, unknowns_of
from ema_model.faults import NAMES, cause_of

Progress = Callable[[str], None]

_RECENTRED = 3  # times that a refit begins anew from where its first guess held it back
_HELD_BACK = 2.0  # σ of that guess, from which on it did
_FOUND = (*ANGLES, "order")  # what no guess holds back: any angle is as likely, a pitch is as exact as the travel
_UNMOVED = 1.0  # σ
_STEP = 0.01  # of a parameter, by which it is seen whether it moves anything; its unit where it is 0
_SAME = 1e-9  # what two of the same signal may differ by
_ALIKE = 0.9  # cosine of two parameters' columns, from which on they do the same
_FAINT = 0.1  # of the suggested strength, from which a fit that went astray begins anew


@dataclass(frozen=True)
class Trial:
    """A candidate in the model, fitted with all that this holds."""

    candidate: Candidate
    effects: Mapping[str, Mapping[str, float]]  # that it adds: settings by key
    fit: Fit
    drop: float  # of χ²
    faults: tuple[str, ...] = ()  # k1 … k8 that it frees, in place of effects


def refitted(
    data: Data,
    current: Fit,
    candidate: Candidate,
    start: Mapping[str, float],
    tell: Progress = lambda text: None,
    key: str = "",
    rough: bool = True,
) -> Trial:
    """A candidate in the model, refitted from a start, x by name; key: under which the model then holds an effect."""
    if candidate.name in NAMES:
        return _with_fault(data, current, candidate, start, tell, rough)
    key = key or free_key(current, candidate.name)
    tell(f"trying {candidate.name}")
    best = together(data, current, {key: candidate.settings}, start, tell, rough)
    return Trial(candidate, {key: candidate.settings}, best, current.chi2 - best.chi2)


def together(
    data: Data,
    current: Fit,
    effects: Mapping[str, Mapping[str, float]],
    start: Mapping[str, float],
    tell: Progress = lambda text: None,
    rough: bool = False,
) -> Fit:
    """The model with effects, from settings by key, refitted; begun anew from where that first guess held it back."""
    best = None
    effects, start = with_what_they_multiply(current, effects, start)
    for _ in range(_RECENTRED):
        actuator = current.actuator
        for key, settings in effects.items():
            actuator = with_effect(actuator, key, settings)
        found = fit(data, actuator, start, tell, current.faults, rough=rough)
        if best is not None and found.chi2 > best.chi2:
            break
        best = found
        if found.chi2 > current.chi2:  # it began too strong to find back
            effects = {key: _weakened(find(key, current.actuator.axes), own) for key, own in effects.items()}
            start = current.starts
        elif _is_held_back(found, effects):
            effects = settings_in(found, effects)
            own = tuple(f"effects.{key}." for key in effects)
            start = {name: x for name, x in found.starts.items() if not name.startswith(own)}
        else:
            break
    assert best is not None
    return best


def with_what_they_multiply(
    current: Fit, effects: Mapping[str, Mapping[str, float]], start: Mapping[str, float]
) -> tuple[Mapping[str, Mapping[str, float]], Mapping[str, float]]:
    """Effects and a start of which an effect that multiplies a base parameter takes on how far that is off."""
    axes, actuator, given, left = current.actuator.axes, current.actuator, dict(effects), dict(start)
    for key, settings in effects.items():
        effect = find(key, axes)
        first, path = effect.parameters[0], effect.duplicates
        if not effect.scale or path not in actuator.tolerances:
            continue
        off = left.pop(path, 0.0) * actuator.tolerances[path].sigma / actuator.value(path)
        whole = (1.0 + off) * (1.0 + effect.scale * settings[first.name])
        given[key] = {**settings, first.name: first.nearest((whole - 1.0) / effect.scale)}
    return given, left


def fitted_to_the_end(data: Data, found: Fit, again: bool, tell: Progress = lambda text: None) -> Fit:
    """A rough fit's model, fitted to its very end.

    again: also from the file's values, since parameters that stood in for what is new may lie beyond a ridge.
    """
    own = {name: x for name, x in found.starts.items() if name.startswith(("effects.", "k"))}
    starts = [found.starts, own] if again else [found.starts]
    return min((fit(data, found.actuator, one, tell, found.faults) for one in starts), key=lambda one: one.chi2)


def free_key(current: Fit, name: str) -> str:
    """Under which a model can hold one more of an effect: `name`, or `name_2` beside one of its kind."""
    count = sum(catalogue_name(key) == name for key in current.actuator.effects)
    return f"{name}_{count + 1}" if count else name


def _with_fault(
    data: Data, current: Fit, candidate: Candidate, start: Mapping[str, float], tell: Progress, rough: bool
) -> Trial:
    """A fault free beside the parameters, from its candidate's k."""
    names = cause_of(candidate.name)
    at = [NAMES.index(name) for name in names]
    tell(f"trying the fault {' and '.join(names)}")
    k = current.calibration.k.copy()
    k[at] = [candidate.settings.get(name, value) for name, value in zip(names, k[at])]
    unknowns = unknowns_of(current.actuator, names)
    guess = {u.name: float(value - u.nominal) / u.sigma for u, value in zip(unknowns, to_vector(k)[at])}
    best = fit(data, current.actuator, {**start, **guess}, tell, (*current.faults, *names), rough=rough)
    return Trial(candidate, {}, best, current.chi2 - best.chi2, names)


def without_fault(data: Data, current: Fit, name: str, tell: Progress) -> Fit:
    """A fit without one of its faults, from where its parameters are and from the file's values."""
    faults = tuple(one for one in current.faults if one not in cause_of(name))
    kept = {name: x for name, x in current.starts.items() if name.startswith(("effects.", "k"))}
    fits = [fit(data, current.actuator, start, tell, faults) for start in (current.starts, kept)]
    return min(fits, key=lambda found: found.chi2)


def settings_in(found: Fit, effects: Iterable[str]) -> dict[str, Mapping[str, float]]:
    """Of these effects, as a fit found them."""
    return {name: dict(found.calibration.actuator.effects[name]) for name in effects}


def stands_for(before: Fit, trial: Trial) -> str:
    """The path of the base parameter outside its tolerance that an effect beside this fit would be; "" for none.

    A parameter that is free, and stays where the file has it, is not what is missing, nor is one that moves the signals
    otherwise, though a reading alone would not tell the two apart: a constant load moves the axis, the bias of a
    logger's current does not, and nothing at all where no current was logged.
    """
    name = trial.candidate.name
    path = find(name).duplicates
    if not path:
        return ""
    free = before.calibration.parameters.get(path)
    if free is None and not _is_seen(before, path):
        return ""
    if free is not None and not free.at_bound and abs(free.z) < _UNMOVED:
        return ""
    return path if _moves_alike(trial.fit, path, f"effects.{name}.{find(name).parameters[0].name}") else ""


def _is_seen(found: Fit, path: str) -> bool:
    """Whether a parameter moves anything that was measured."""
    calibration = found.calibration
    value = calibration.actuator.value(path)
    moved = calibration.actuator.with_values({path: value + (_STEP * abs(value) or _STEP)})
    for i, window in enumerate(found.plant.windows):
        shown = found.plant.signals(i, moved, calibration.k, *calibration.start_of(i))
        both = [(shown[name], calibration.signals[i][name]) for name in window.measured if name in shown]
        if any(not np.allclose(one, other, rtol=_SAME, atol=0.0) for one, other in both):
            return True
    return False


def _moves_alike(found: Fit, *paths: str) -> bool:
    """Whether two parameters move the fitted signals in the same way, as far as both are free."""
    names = [*found.calibration.parameters]
    if any(path not in names for path in paths):
        return True
    one, other = (found.calibration.weighted_jacobian[:, names.index(path)] for path in paths)
    return abs(float(one @ other)) > _ALIKE * float(np.linalg.norm(one) * np.linalg.norm(other))


def _is_held_back(found: Fit, effects: Iterable[str]) -> bool:
    """Whether a parameter of the effects ended so far from the guess that it began with that this holds it back."""
    for name in effects:
        for parameter in find(name, found.actuator.axes).parameters:
            one = found.calibration.parameters.get(f"effects.{name}.{parameter.name}")
            if one is None or parameter.name in _FOUND or (abs(one.z) < _HELD_BACK and not one.at_bound):
                continue
            near = 0.01 * abs(one.value)
            if parameter.low + near < one.value < parameter.high - near:
                return True
    return False


def _weakened(effect: Effect, settings: Mapping[str, float]) -> dict[str, float]:
    first = effect.parameters[0]
    return {**settings, first.name: max(first.low, _FAINT * settings[first.name])}


def with_drops(ranked: Sequence[Candidate], trials: Sequence[Trial]) -> list[Candidate]:
    """All candidates with what their refits gave, the best first."""
    drops: Mapping[str, float] = {trial.candidate.name: trial.drop for trial in trials}
    told = [replace(one, refitted_drop=drops.get(one.name)) for one in ranked]
    return sorted(told, key=lambda one: -(one.refitted_drop if one.refitted_drop is not None else -math.inf))
