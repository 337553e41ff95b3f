"""Faults of the actuator itself, k1 … k8: tried beside the effects, since a worn actuator looks like missing physics.

A fault is taken into the model when it tells more than any effect could.  It then stays free like a parameter, and
what is found afterwards is found beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.criteria import LEAST_BIC
from ema_model.discovery.model_fit import Data, Fit, fit
from ema_model.discovery.refit import Trial, pays, worth
from ema_model.discovery.result import Candidate
from ema_model.discovery.score import amounts_of, movable
from ema_model.discovery.unknown import TEETH
from ema_model.estimation.unknowns import to_k, to_vector, unknowns_of
from ema_model.faults import NAMES

Array = NDArray[np.float64]

# What is free together: of the eccentricity its modulus and its phase.
_FAULTS = (("k1",), ("k2",), ("k3",), ("k4",), ("k5",), ("k6", "k7"), ("k8",))
_SIZES = (0.03, 0.3)  # of a k, that its columns are made with: a straight line and a chord
_MOST_REFITTED = 2
_RIVAL = 0.3  # of the best effect's score, below which a fault is not refitted


@dataclass(frozen=True)
class _Scored:
    names: tuple[str, ...]
    there: Array  # (names,), the eccentricity as a vector
    drop: float  # of χ², as predicted


def fault_for(
    data: Data,
    held: Data | None,
    current: Fit,
    ranked: Sequence[Candidate],
    effects: Callable[[], Sequence[Trial]],
    tell: Callable[[str], None],
) -> Trial | None:
    """The fault that tells more than any effect, or as much as the best one, in the model and refitted.

    None where there is none; `Trial.same_as` names the effect that tells as much.  That one goes first, unless it
    repeats less often in a turn than teeth or poles do, as what an eccentric rotor does.
    ranked: the effects, the most promising first; effects() refits those that are worth it, the best first.
    Faults are those of a motor with three phases and a cascade: other actuators have none here.
    """
    if not current.actuator.has_reference_model:
        return None
    best = max((one.predicted_drop for one in ranked), default=0.0)
    strong = [one for one in _scores(data, current) if one.drop > max(LEAST_BIC, _RIVAL * best)]
    trials = [_refitted(data, current, one, tell) for one in strong[:_MOST_REFITTED]]
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


def _scores(data: Data, current: Fit) -> list[_Scored]:
    """Each fault at the strength that suits best, beyond what the parameters can do; the most telling first."""
    left = [names for names in _FAULTS if names[0] not in current.faults]
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
    jacobian, gram = movable(current)
    best: dict[tuple[str, ...], _Scored] = {}
    for names, step, its in tried:
        one = _at(known, names, step, *amounts_of(current, (signals[its] - signals[0]).T, jacobian, gram))
        if names not in best or one.drop > best[names].drop:
            best[names] = one
    return sorted(best.values(), key=lambda one: -one.drop)


def _at(known: Array, names: tuple[str, ...], step: float, amounts: Array, energy: Array, toward: Array) -> _Scored:
    """The fault at these multiples of what its columns were made with, beyond what is known, as far as k may go."""
    at = [NAMES.index(name) for name in names]
    there = known[at] + step * amounts
    there = there / max(1.0, math.hypot(*there)) if len(names) == 2 else np.clip(there, 0.0, 1.0)
    amounts = (there - known[at]) / step
    return _Scored(names, there, float(2.0 * amounts @ toward - amounts @ energy @ amounts))


def _refitted(data: Data, current: Fit, one: _Scored, tell: Callable[[str], None]) -> Trial:
    """The fault free beside the parameters, from where they are and from the file's values."""
    tell(f"trying the fault {' and '.join(one.names)}")
    unknowns = unknowns_of(current.actuator, one.names)
    guess = {u.name: float(value - u.nominal) / u.sigma for u, value in zip(unknowns, one.there)}
    kept = {name: x for name, x in current.starts.items() if name.startswith(("effects.", "k"))}
    faults = (*current.faults, *one.names)
    fits = [fit(data, current.actuator, {**start, **guess}, tell, faults) for start in (current.starts, kept)]
    best = min(fits, key=lambda found: found.chi2)
    return Trial(Candidate(one.names[0], one.drop, {}), {}, best, current.chi2 - best.chi2, one.names)
