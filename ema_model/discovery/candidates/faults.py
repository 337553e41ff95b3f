"""Faults of the actuator itself, k1 … k8: tried beside the effects, since a worn actuator looks like missing physics.

Faults stand in the ranking of the effects.  By itself a discovery takes one into the model when it tells more than any
effect could; a person takes any.  It then stays free like a parameter, and what is found afterwards is found beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.candidates.paid_for import pays, worth
from ema_model.discovery.candidates.refit import Trial
from ema_model.discovery.candidates.score import amounts_of, beyond_of, movable, unseen
from ema_model.discovery.candidates.unknown import TEETH
from ema_model.discovery.criteria import LEAST_BIC
from ema_model.discovery.result import Candidate
from ema_model.estimation.model_fit import Data, Fit, fit
from ema_model.estimation.problem import to_k, to_vector, unknowns_of
from ema_model.faults import CAUSES, NAMES, cause_of
from ema_model.side_by_side import fits

Array = NDArray[np.float64]

_SIZES = (0.03, 0.3)  # of a k, that its columns are made with: a straight line and a chord
_MOST_REFITTED = 2
_RIVAL = 0.3  # of the best effect's score, below which a fault is not refitted
_STRONG = 0.75  # of a k: a strong fault


@dataclass(frozen=True, eq=False)
class ScoredFault:
    """A fault at the strength that suits best, beyond what the calibrated parameters can do."""

    names: tuple[str, ...]
    there: Array  # (names,), the eccentricity as a vector
    drop: float  # of χ², as predicted
    signature: Array  # what it would take from measurement − model, over the floor: (values,)
    candidate: Candidate  # the same in the ranking of the effects


def fault_for(
    data: Data, held: Data | None, current: Fit, trials: Sequence[Trial], effects: Callable[[], Sequence[Trial]]
) -> Trial | None:
    """The fault that tells more than any effect, or as much as the best one, in the model and refitted.

    None where there is none; `Trial.same_as` names the effect that tells as much.  That one goes first, unless it
    repeats less often in a turn than teeth or poles do, as what an eccentric rotor does.
    trials: the faults that were refitted; effects() refits those that are worth it, the best first.
    """
    trials = [trial for trial in trials if pays(current, trial, data, held)]
    if not trials:
        return None
    fault = max(trials, key=lambda trial: worth(data, current, trial))
    rival = max(effects(), key=lambda trial: worth(data, current, trial), default=None)
    more = worth(data, current, fault) - (0.0 if rival is None else worth(data, current, rival))
    if rival is None or more > LEAST_BIC:
        return fault
    if more < -LEAST_BIC:
        return None
    return replace(fault, same_as=rival.candidate.name, yields=rival.candidate.settings.get("order", TEETH) >= TEETH)


def tried_faults(data: Data, current: Fit, ranked: Sequence[Candidate], tell: Callable[[str], None]) -> list[Trial]:
    """The faults that are worth a refit beside these effects, the most promising first, each in the model.

    Faults are those of a motor with three phases and a cascade: other actuators have none here.
    """
    best = max((one.predicted_drop for one in ranked), default=0.0)
    strong = [one for one in scored_faults(data, current) if one.drop > max(LEAST_BIC, _RIVAL * best)]

    def refitted(one: ScoredFault, tell: Callable[[str], None]) -> Trial:
        return _refitted(data, current, one.names, one.there, one.candidate, tell)

    return fits(refitted, strong[:_MOST_REFITTED], tell)


def fault_trial(
    data: Data,
    current: Fit,
    candidate: Candidate,
    tell: Callable[[str], None],
    start: Mapping[str, float] | None = None,
) -> Trial:
    """A fault of the ranking in the model, refitted; start: x by name, from which alone its fit begins."""
    names = cause_of(candidate.name)
    at = [NAMES.index(name) for name in names]
    k = current.calibration.k.copy()
    k[at] = [candidate.settings.get(name, value) for name, value in zip(names, k[at])]
    return _refitted(data, current, names, to_vector(k)[at], candidate, tell, start)


def without_fault(data: Data, current: Fit, name: str, tell: Callable[[str], None]) -> Fit:
    """A fit without one of its faults, from where its parameters are and from the file's values."""
    faults = tuple(one for one in current.faults if one not in cause_of(name))
    return _better_start(data, current, {}, tell, faults)


@lru_cache(maxsize=4)  # a step is ranked, walked and looked at by it
def scored_faults(data: Data, current: Fit) -> tuple[ScoredFault, ...]:
    """Each fault that is not in the model yet, the most telling first; of other actuators none."""
    if not current.actuator.has_reference_model:
        return ()
    known = to_vector(current.calibration.k)
    jacobian, gram = movable(current)
    best: dict[tuple[str, ...], ScoredFault] = {}
    for names, step, columns in fault_columns(data, current):
        own = beyond_of(jacobian, gram, columns)
        one = _at(known, names, step, own, *amounts_of(current, columns, jacobian, gram, own))
        if names not in best or one.drop > best[names].drop:
            best[names] = one
    return tuple(sorted(best.values(), key=lambda one: -one.drop))


@lru_cache(maxsize=2)  # a step is scored by it in two ways
def fault_columns(data: Data, current: Fit) -> Sequence[tuple[tuple[str, ...], float, Array]]:
    """Of each fault that is not in the model yet: its k, a step of it, and what that changes, over the floor.

    The changes are (values, 1), of an eccentricity (values, 2), as a vector.  Of other actuators there are none.
    """
    if not current.actuator.has_reference_model:
        return ()
    left = [names for names in CAUSES if names[0] not in current.faults]
    known = to_vector(current.calibration.k)
    lanes, tried = [known], []
    for names in left:
        for size in _SIZES:
            # From where a fault is known to be almost whole, it can only be less.
            step = size if known[NAMES.index(names[0])] + size <= 1.0 else -size
            tried.append((names, step, range(len(lanes), len(lanes) + len(names))))
            for name in names:
                lanes.append(known.copy())
                lanes[-1][NAMES.index(name)] += step
    k = to_k(np.stack(lanes))
    shown = [
        current.plant.signals(i, current.calibration.actuator, k, *current.calibration.start_of(i))
        for i in range(len(current.plant.windows))
    ]
    signals = np.nan_to_num(data.over_floor(current.plant, shown))
    return tuple((names, step, (signals[its] - signals[0]).T) for names, step, its in tried)


def fault_at(known: Array, names: tuple[str, ...], step: float, amounts: Array) -> tuple[Array, dict[str, float]]:
    """So many steps from what is known, (8,), as far as k may go: the fault's parts, as a vector, and its k."""
    at = [NAMES.index(name) for name in names]
    there = known[at] + step * amounts
    there = there / max(1.0, math.hypot(*there)) if len(names) == 2 else np.clip(there, 0.0, 1.0)
    vector = known.copy()
    vector[at] = there
    k = to_k(vector)
    return there, {name: float(k[i]) for name, i in zip(names, at)}


def _at(
    known: Array, names: tuple[str, ...], step: float, own: Array, amounts: Array, energy: Array, toward: Array
) -> ScoredFault:
    """The fault at these multiples of what its columns were made with, beyond what is known, as far as k may go."""
    there, settings = fault_at(known, names, step, amounts)
    amounts = (there - known[[NAMES.index(name) for name in names]]) / step
    drop = float(2.0 * amounts @ toward - amounts @ energy @ amounts)
    reason = unseen(energy, _STRONG / step)
    candidate = Candidate(names[0], 0.0 if reason else max(0.0, drop), settings, reason)
    return ScoredFault(names, there, drop, own @ amounts, candidate)


def _refitted(
    data: Data,
    current: Fit,
    names: tuple[str, ...],
    there: Array,
    candidate: Candidate,
    tell: Callable[[str], None],
    start: Mapping[str, float] | None = None,
) -> Trial:
    """The fault free beside the parameters, from a start, or from where they are and from the file's values."""
    tell(f"trying the fault {' and '.join(names)}")
    unknowns = unknowns_of(current.actuator, names)
    guess = {u.name: float(value - u.nominal) / u.sigma for u, value in zip(unknowns, there)}
    faults = (*current.faults, *names)
    if start is None:
        best = _better_start(data, current, guess, tell, faults)
    else:
        best = fit(data, current.actuator, {**start, **guess}, tell, faults, rough=True)
    return Trial(candidate, {}, best, current.chi2 - best.chi2, names)


def _better_start(
    data: Data, current: Fit, guess: Mapping[str, float], tell: Callable[[str], None], faults: tuple[str, ...]
) -> Fit:
    kept = {name: x for name, x in current.starts.items() if name.startswith(("effects.", "k"))}
    fits = [fit(data, current.actuator, {**start, **guess}, tell, faults) for start in (current.starts, kept)]
    return min(fits, key=lambda found: found.chi2)
