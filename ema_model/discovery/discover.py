"""Which physical effects are missing: calibrate, ask whether anything is left, score, refit, accept, repeat.

The method and what was measured on a prototype: no verdict without a converged calibration; an effect is accepted
when the data pay for its parameters (ΔBIC), on most stretches of time, materially, and on what was held out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison.assemble import residuals_of
from ema_model.comparison.compare import known_error, prepared, weights_of
from ema_model.comparison.curves import orders_in
from ema_model.comparison.explain import advance_of, explain, used_blocks
from ema_model.comparison.orders import orders as orders_of
from ema_model.comparison.residuals import Residuals
from ema_model.comparison.result import Explanation
from ema_model.comparison.sampling import fit_stretches
from ema_model.comparison.verdict import ORDER_OF_PRIMARY
from ema_model.discovery.fingerprints import fingerprints
from ema_model.discovery.fitting import Data, Fit, fit, floor_ratio, gather, holdout_error, with_effect, without_effect
from ema_model.discovery.result import Added, Candidate, Discovery, Rung
from ema_model.discovery.score import scored
from ema_model.effects import CATALOGUE
from ema_model.measurement import Measurement
from ema_model.recordings import check_same_actuator

Array = NDArray[np.float64]
Progress = Callable[[str], None]

_REFITTED_SHARE, _MOST_REFITTED = 0.25, 6  # of the best score; of candidates
_LEAST_BIC, _LEAST_FALL, _LEAST_HELD_FALL, _LEAST_T = 10.0, 0.01, 0.02, 2.4
_TIE = 10.0  # of χ², within which rivals cannot be told apart
_CORRELATED = 50  # values of a signal that may share their error
_NOT_LOOKED_FOR = ("pendulum_load",)  # whoever has an arm on the shaft knows of it
_ORDERS = 4  # of the residual's strongest, tried for periodic effects


@dataclass(frozen=True)
class _Trial:
    """A candidate in the model, refitted."""

    candidate: Candidate
    fit: Fit
    drop: float  # of χ²


def discover(
    measurements: Sequence[Measurement],
    actuator: Actuator | None = None,
    *,
    holdout: Sequence[Measurement] = (),
    signals: Sequence[str] | None = None,
    candidates: Sequence[str] | None = None,
    most_effects: int = 3,
    on_progress: Progress | None = None,
) -> Discovery:
    """The missing effects of recordings of one actuator, added to its model one after another.

    holdout: recordings that are not fitted and must improve as well; candidates: effects to consider, all of the
    catalogue's without it.  on_progress is told what goes on, and may raise to stop.
    Raises InputError for recordings that cannot be compared.
    """
    actuator = actuator or load_actuator()
    tell = on_progress or (lambda text: None)
    check_same_actuator([*measurements, *holdout])
    data, held = (_data(recordings, actuator, signals, tell) for recordings in (measurements, holdout))
    assert data is not None
    names = [name for name in candidates or CATALOGUE if name not in actuator.effects and _belongs(name)]
    tell("calibrating")
    base = current = fit(data, actuator, tell=tell)
    ladder = [_rung("calibrated", current, data, held)]
    added: list[Added] = []
    first: list[Candidate] = []
    left = _left(data, current)
    # Each round looks whether or not `_left` sees anything: a fingerprint knows better what to look for.
    while len(added) < most_effects:
        tell("scoring the candidates")
        ranked = scored(current, fingerprints(data, current, names, left.orders))
        trials = _refitted(data, current, ranked, tell)
        first = first or _ranked(ranked, trials)
        accepted = [trial for trial in trials if _pays(current, trial, data, held)]
        if not accepted:
            break
        best = accepted[0]
        ties = tuple(t.candidate.name for t in accepted[1:] if best.drop - t.drop < _TIE)
        path = CATALOGUE[best.candidate.name].duplicates
        label = f"{actuator.axes.path(path)} outside its tolerance" if path else f"+ {best.candidate.name}"
        rung = _rung(label, best.fit, data, held)
        added.append(_added(best, ladder[-1], rung, ties))
        ladder.append(rung)
        current = best.fit
        left = _left(data, current)
    current, added, ladder = _without_idle(data, held, current, added, ladder)
    unknown = left.explanation if left.significant else None
    verdict = "effects_found" if added else "unknown_effect" if unknown else "adequate"
    if not added and not base.calibration.converged:
        verdict = "not_converged"  # an unfinished fit looks exactly like missing physics
    return _discovery(verdict, current, added, ladder, first, unknown)


def _data(
    recordings: Sequence[Measurement], actuator: Actuator, signals: Sequence[str] | None, tell: Progress
) -> Data | None:
    if not recordings:
        return None
    tell("measuring the model's floor")
    inside = [prepared(recording, actuator) for recording in recordings]
    return gather(inside, actuator, weights_of(signals, actuator), fit_stretches(inside, actuator))


def _belongs(name: str) -> bool:
    """Whether an effect is looked for: not the rig's own arm."""
    return name not in _NOT_LOOKED_FOR


@dataclass(frozen=True)
class _Left:
    """What a fitted model leaves: whether it is anything, what explains it, and its strongest orders."""

    significant: bool
    explanation: Explanation | None
    orders: list[int]


def _left(data: Data, found: Fit) -> _Left:
    known = [known_error(found.plant, window, found.calibration) for window in found.plant.windows]
    residuals = residuals_of(
        found.plant, data.floors, found.calibration.signals, known, found.calibration.actuator, found.calibration
    )
    primary = next(name for name in ORDER_OF_PRIMARY if name in residuals.values)
    explained = [one for one in explain(residuals, primary, found.actuator.axes) if one.significant]
    return _Left(bool(explained), explained[0] if explained else None, _orders(residuals, primary))


def _orders(residuals: Residuals, primary: str) -> list[int]:
    """Orders that a periodic effect may have: the strongest of the residual."""
    used = used_blocks(residuals, primary)
    angle = residuals.variables.get("motor_angle")
    if used is None or angle is None:
        return []
    advance = advance_of(residuals, used)
    if not len(orders_in(residuals.turns, advance)):
        return []
    found = orders_of(angle[used.chosen], used.values, residuals.turns, advance)
    strongest = sorted(found, key=lambda one: -one.significance)[:_ORDERS]
    return [one.order for one in strongest]


def _refitted(data: Data, current: Fit, ranked: Sequence[Candidate], tell: Progress) -> list[_Trial]:
    """The promising candidates, each in the model, the best fit first."""
    promising = [c for c in ranked if not c.untestable_reason and c.predicted_drop > _LEAST_BIC]
    if promising:
        promising = [c for c in promising if c.predicted_drop >= _REFITTED_SHARE * promising[0].predicted_drop]
    trials = []
    for candidate in promising[:_MOST_REFITTED]:
        tell(f"trying {candidate.name}")
        fixed = with_effect(current.actuator, candidate.name, candidate.settings)
        trial = fit(data, fixed, current.starts, tell)
        trials.append(_Trial(candidate, trial, current.chi2 - trial.chi2))
    return sorted(trials, key=lambda trial: -trial.drop)


def _pays(current: Fit, trial: _Trial, data: Data, held: Data | None) -> bool:
    """Whether the data pay for the effect's parameters, everywhere, materially, and where they were not fitted."""
    values = len(current.residual)
    count = sum(not parameter.integer for parameter in CATALOGUE[trial.candidate.name].parameters)
    if trial.drop - count * np.log(values) < _LEAST_BIC:
        return False
    if trial.fit.error() > (1.0 - _LEAST_FALL) * current.error():
        return False
    gains = np.array_split(current.residual**2 - trial.fit.residual**2, max(8, values // _CORRELATED))
    sums = np.array([gain.sum() for gain in gains])
    if sums.sum() < _LEAST_T * np.std(sums, ddof=1) * np.sqrt(len(sums)):
        return False
    return held is None or holdout_error(held, trial.fit) < (1.0 - _LEAST_HELD_FALL) * holdout_error(held, current)


def _without_idle(
    data: Data, held: Data | None, current: Fit, added: list[Added], ladder: list[Rung]
) -> tuple[Fit, list[Added], list[Rung]]:
    """Takes out effects that later ones have made idle."""
    for one in added[:-1]:
        smaller = fit(data, without_effect(current.actuator, one.name), current.starts)
        count = len(CATALOGUE[one.name].parameters)
        if smaller.chi2 - current.chi2 < count * np.log(len(current.residual)) + _LEAST_BIC:
            current = smaller
            added = [other for other in added if other.name != one.name]
            ladder = [*ladder, _rung(f"− {one.name}", current, data, held)]
    return current, added, ladder


def _ranked(ranked: Sequence[Candidate], trials: Sequence[_Trial]) -> list[Candidate]:
    """All candidates with what their refits gave, the best first."""
    drops = {trial.candidate.name: trial.drop for trial in trials}
    told = [replace(one, refitted_drop=drops.get(one.name)) for one in ranked]
    return sorted(told, key=lambda one: -(one.refitted_drop if one.refitted_drop is not None else -1.0))


def _rung(label: str, found: Fit, data: Data, held: Data | None) -> Rung:
    signals: dict[str, list[Array]] = {}
    for window, shown in zip(found.plant.windows, found.calibration.signals):
        for name in data.signals:
            if name in window.measured:
                signals.setdefault(name, []).append(shown[name] - window.measured[name])
    rms = {name: float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) for name, parts in signals.items()}
    ratio = floor_ratio(data, found.plant, found.calibration.signals)
    return Rung(label, ratio, None if held is None else holdout_error(held, found), rms, found.calibration.signals)


def _added(trial: _Trial, before: Rung, after: Rung, ties: tuple[str, ...]) -> Added:
    name = trial.candidate.name
    fitted = {
        path.split(".")[2]: one
        for path, one in trial.fit.calibration.parameters.items()
        if path.startswith(f"effects.{name}.")
    }
    return Added(name, fitted, before.rmse, after.rmse, before.holdout_rmse, after.holdout_rmse, ties)


def _discovery(
    verdict: str,
    found: Fit,
    added: Sequence[Added],
    ladder: Sequence[Rung],
    candidates: Sequence[Candidate],
    unknown: Explanation | None,
) -> Discovery:
    calibration = found.calibration
    stand_ins = [CATALOGUE[one.name].duplicates for one in added]
    effects = [one for one, path in zip(added, stand_ins) if not path]
    outside = [name for name in calibration.outside_tolerance if not name.startswith("effects.")]
    outside = list(dict.fromkeys([*(path for path in stand_ins if path), *outside]))
    if verdict == "effects_found" and not effects:
        verdict = "adequate"  # a parameter is outside its tolerance; no physics is missing
    return Discovery(verdict, calibration, effects, ladder, candidates, outside, calibration.actuator, found.plant, unknown)


def settings_of(found: Discovery) -> Mapping[str, Mapping[str, float]]:
    """The effects of the improved model, as `compare` and `simulate` take them."""
    return {one.name: found.actuator.effects[one.name] for one in found.effects}
