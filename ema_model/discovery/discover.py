"""Which physical effects are missing: calibrate, ask whether anything is left, score, refit, accept, repeat.

The method and what was measured on a prototype: no verdict without a converged calibration; an effect is accepted
when the data pay for its parameters (ΔBIC), on most stretches of time, materially, and on what was held out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison.compare import prepared, weights_of
from ema_model.comparison.result import Explanation
from ema_model.comparison.sampling import fit_stretches
from ema_model.discovery.experiments import next_experiment
from ema_model.discovery.fingerprints import Fingerprint, fingerprints
from ema_model.discovery.fitting import Data, Fit, fit, floor_ratio, gather, holdout_fit, rms_by_signal, without_effect
from ema_model.discovery.harmonics import is_periodic, with_further_orders
from ema_model.discovery.left import left_by
from ema_model.discovery.repeatability import by_inverse_dynamics, is_lost, with_divergence
from ema_model.discovery.result import Added, Candidate, Discovery, Experiment, Rung, StoodIn
from ema_model.discovery.score import scored
from ema_model.discovery.trial import LEAST_BIC, Trial, pays, promising, tried
from ema_model.effects import CATALOGUE, catalogue_name, find
from ema_model.measurement import Measurement
from ema_model.recordings import check_same_actuator

Array = NDArray[np.float64]
Progress = Callable[[str], None]

_REFITTED_SHARE, _MOST_REFITTED = 0.25, 6  # of the best score; of candidates
_TIE = 10.0  # of χ², within which rivals cannot be told apart
_MOVED = 1.5  # σ that a parameter comes back by, when it had been standing in for an effect
_NOT_LOOKED_FOR = ("pendulum_load",)  # whoever has an arm on the shaft knows of it


@dataclass
class _Story:
    """How the model grew: its effects, the ladder of errors, the current fit."""

    data: Data
    held: Data | None
    current: Fit
    added: list[Added] = field(default_factory=list)
    ladder: list[Rung] = field(default_factory=list)

    def step(self, label: str, found: Fit) -> Rung:
        """Makes a fit the current one, and a rung of it."""
        self.current = found
        self.ladder.append(_rung(label, found, self.data, self.held))
        return self.ladder[-1]

    def add(self, trial: Trial, label: str, ties: tuple[str, ...]) -> None:
        """Accepts a trial."""
        moved = _stood_in(self.current, trial.fit)
        before = self.ladder[-1]
        after = self.step(label, trial.fit)
        for key in trial.effects:
            self.added.append(_added(key, trial.fit, before, after, ties, moved))


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
    names = [name for name in candidates or CATALOGUE if name not in (*actuator.effects, *_NOT_LOOKED_FOR)]
    warnings: list[str] = []
    story, repeatable = _begun(measurements, holdout, actuator, signals, tell)
    inverse = None if repeatable else by_inverse_dynamics(story.data, actuator)
    if inverse is not None:
        warnings.append(
            "The closed loop is not repeatable (a change of 0.05 % in the inertia moves its signals by more than the "
            "noise): what the measured motion needs is compared instead."
        )
        actuator = inverse
        story, repeatable = _begun(measurements, holdout, actuator, signals, tell)
    if not repeatable:
        return _discovery("not_repeatable", story, [], None, warnings, None)
    data, held, base = story.data, story.held, story.current
    first: list[Candidate] = []
    prints: list[Fingerprint] = []
    rivals: list[Trial] = []
    # Each round looks whether or not anything is seen to be left: a fingerprint knows better what to look for.
    while len({one.name for one in story.added}) < most_effects:
        tell("scoring the candidates")
        prints = fingerprints(data, story.current, names, left_by(data, story.current).orders, prints)
        ranked = scored(story.current, prints)
        trials = []
        for candidate in promising(ranked, _REFITTED_SHARE, _MOST_REFITTED):
            tell(f"trying {candidate.name}")
            trials.append(tried(data, story.current, candidate, {candidate.name: candidate.settings}, tell))
        trials.sort(key=lambda trial: -trial.drop)
        first = first or _ranked(ranked, trials)
        accepted = [trial for trial in trials if pays(story.current, trial, data, held)]
        if not accepted:
            break
        tied = [trial for trial in accepted if accepted[0].drop - trial.drop < _TIE]
        # Of what cannot be told apart, a parameter outside its tolerance comes after an effect.
        best = next((trial for trial in tied if not CATALOGUE[trial.candidate.name].duplicates), tied[0])
        others = [trial for trial in tied if trial is not best]
        rivals = rivals or [best, *others] if others else rivals
        story.add(best, _label(best, actuator), tuple(trial.candidate.name for trial in others))
        if is_periodic(best.candidate.name):
            more = with_further_orders(data, held, story.current, best.candidate.name, tell)
            if more:
                numbers = ", ".join(f"{settings['order']:g}" for settings in more.effects.values())
                story.add(more, f"+ {best.candidate.name} of orders {numbers}", ())
    _drop_idle(story)
    unknown = left_by(data, story.current).explanation
    verdict = "effects_found" if story.added else "unknown_effect" if unknown else "adequate"
    if not story.added and not base.calibration.converged:
        verdict = "not_converged"  # an unfinished fit looks exactly like missing physics
    experiment = None
    if rivals:
        tell("looking for a test that tells the rivals apart")
        experiment = next_experiment(data, rivals[0].fit, rivals[1].fit)
    return _discovery(verdict, story, first, unknown, warnings, experiment)


def _begun(
    measurements: Sequence[Measurement],
    holdout: Sequence[Measurement],
    actuator: Actuator,
    signals: Sequence[str] | None,
    tell: Progress,
) -> tuple[_Story, bool]:
    """The calibrated model without any effect, and whether its loop can be simulated."""
    tell("measuring the model's floor")
    data, held = (_data(recordings, actuator, signals) for recordings in (measurements, holdout))
    assert data is not None
    tell("calibrating")
    base = fit(data, actuator, tell=tell)
    # How the two models differ depends on their parameters: on where the motor comes to stand above all.
    data, lost = with_divergence(data.beside(base), base)
    held = None if held is None else held.beside(base)
    base = fit(data, actuator, base.starts, tell)
    story = _Story(data, held, base)
    story.step("calibrated", base)
    return story, not is_lost(lost)


def _data(recordings: Sequence[Measurement], actuator: Actuator, signals: Sequence[str] | None) -> Data | None:
    if not recordings:
        return None
    inside = [prepared(recording, actuator) for recording in recordings]
    return gather(inside, actuator, weights_of(signals, actuator), fit_stretches(inside, actuator))


def _label(trial: Trial, actuator: Actuator) -> str:
    name = trial.candidate.name
    path = CATALOGUE[name].duplicates
    return f"{actuator.axes.path(path)} outside its tolerance" if path else f"+ {name}"


def _drop_idle(story: _Story) -> None:
    """Takes out effects that later ones have made idle."""
    for one in story.added[:-1]:
        smaller = fit(story.data, without_effect(story.current.actuator, one.key), story.current.starts)
        count = sum(not parameter.integer for parameter in find(one.name).parameters)
        if smaller.chi2 - story.current.chi2 < count * np.log(len(smaller.residual)) + LEAST_BIC:
            story.added = [other for other in story.added if other is not one]
            story.step(f"− {one.name}", smaller)


def _ranked(ranked: Sequence[Candidate], trials: Sequence[Trial]) -> list[Candidate]:
    """All candidates with what their refits gave, the best first."""
    drops = {trial.candidate.name: trial.drop for trial in trials}
    told = [replace(one, refitted_drop=drops.get(one.name)) for one in ranked]
    return sorted(told, key=lambda one: -(one.refitted_drop if one.refitted_drop is not None else -math.inf))


def _rung(label: str, found: Fit, data: Data, held: Data | None) -> Rung:
    shown = found.calibration.signals
    ratio, rms = floor_ratio(data, found.plant, shown), rms_by_signal(data, found.plant, shown)
    unseen, unseen_rms = (None, {}) if held is None else holdout_fit(held, found)
    return Rung(label, ratio, unseen, rms, unseen_rms, shown)


def _stood_in(before: Fit, after: Fit) -> tuple[StoodIn, ...]:
    """Parameters that came back toward the file's value."""
    moved = []
    for path, one in before.calibration.parameters.items():
        now = after.calibration.parameters[path]
        if not path.startswith("effects.") and abs(one.z) - abs(now.z) > _MOVED:
            moved.append(StoodIn(path, one.z, now.z))
    return tuple(moved)


def _added(key: str, found: Fit, before: Rung, after: Rung, ties: tuple[str, ...], moved: tuple[StoodIn, ...]) -> Added:
    fitted = {
        path.split(".")[2]: one
        for path, one in found.calibration.parameters.items()
        if path.startswith(f"effects.{key}.")
    }
    return Added(
        catalogue_name(key),
        fitted,
        before.rmse,
        after.rmse,
        before.holdout_rmse,
        after.holdout_rmse,
        ties,
        key,
        {name: value for name, value in found.calibration.actuator.effects[key].items() if name not in fitted},
        moved,
    )


def _warnings(story: _Story, actuator: Actuator) -> list[str]:
    return [
        f"{actuator.axes.path(moved.path)} had been standing in for {one.name}: it stood {moved.before:+.1f} σ from "
        f"the file's value and is at {moved.after:+.1f} σ now."
        for one in story.added
        for moved in one.stood_in
    ]


def _discovery(
    verdict: str, story: _Story, candidates: Sequence[Candidate], unknown: Explanation | None, more: list[str],
    experiment: Experiment | None,
) -> Discovery:  # fmt: skip
    calibration = story.current.calibration
    stand_ins = [CATALOGUE[one.name].duplicates for one in story.added]
    effects = [one for one, path in zip(story.added, stand_ins) if not path]
    outside = [name for name in calibration.outside_tolerance if not name.startswith("effects.")]
    outside = list(dict.fromkeys([*(path for path in stand_ins if path), *outside]))
    if verdict == "effects_found" and not effects:
        verdict = "adequate"  # a parameter is outside its tolerance; no physics is missing
    return Discovery(
        verdict,
        calibration,
        effects,
        story.ladder,
        candidates,
        outside,
        calibration.actuator,
        story.current.plant,
        unknown,
        experiment,
        [*more, *_warnings(story, calibration.actuator)],
    )


def settings_of(found: Discovery) -> Mapping[str, Mapping[str, float]]:
    """The effects of the improved model, as `compare` and `simulate` take them."""
    return {one.key: found.actuator.effects[one.key] for one in found.effects}
