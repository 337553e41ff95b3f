"""Which physical effects are missing: calibrate, ask whether anything is left, score, refit, accept, repeat.

The method and what was measured on a prototype: no verdict without a converged calibration; an effect is accepted
when the data pay for its parameters (ΔBIC), on most stretches of time, materially, and on what was held out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison.explain import Explanation
from ema_model.discovery.harmonics import with_further_orders
from ema_model.discovery.next_experiment import next_experiment
from ema_model.discovery.path import Story, begun, with_drops
from ema_model.discovery.refit import LEAST_BIC, Trial, fitted_count, pays
from ema_model.discovery.result import Candidate, Discovery, Experiment
from ema_model.discovery.sentences import as_well, masked, untold
from ema_model.discovery.unknown import curve_instead, is_a_shape
from ema_model.effects import CATALOGUE, find
from ema_model.recordings import Measurement

Progress = Callable[[str], None]

_REFITTED_SHARE, _MOST_REFITTED = 0.25, 6  # of the best score; of candidates
_TIE = 10.0  # of χ², within which rivals cannot be told apart


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
    tell = on_progress or (lambda text: None)
    story = begun(measurements, actuator or load_actuator(), holdout, signals, tell)
    if not story.repeatable:
        return result_of(story)
    walked = walk(story, tell, candidates=candidates, most_effects=most_effects)
    experiment = None
    if walked.rivals:
        tell("looking for a test that tells the rivals apart")
        experiment = next_experiment(story.data, walked.rivals[0].fit, walked.rivals[1].fit)
        if experiment is None:
            story.warnings.append(untold(*(trial.candidate.name for trial in walked.rivals[:2])))
    return result_of(story, walked.candidates, walked.unknown, experiment)


@dataclass(frozen=True)
class Walked:
    """What a walk saw besides the story's own steps."""

    candidates: Sequence[Candidate]  # of its first round, the best first
    rivals: Sequence[Trial]  # that could not be told apart, the chosen one first
    unknown: Explanation | None  # what the last model leaves, or what the curve stands for


def walk(
    story: Story, tell: Progress = lambda text: None, *, candidates: Sequence[str] | None = None, most_effects: int = 3
) -> Walked:
    """Goes on by itself from where a story stands: adds what pays, takes out what became idle, draws what is unknown.

    tell is told after each step, too, and may raise to stop; the story then stands at its last whole step.
    """
    first: list[Candidate] = []
    rivals: list[Trial] = []
    curve: Trial | None = None
    # Each round looks whether or not anything is seen to be left: a fingerprint knows better what to look for.
    while len({one.name for one in story.added}) < most_effects:
        tell("scoring the candidates")
        left = story.left()
        ranked = story.ranked(candidates, left)
        trials = story.tried(ranked, _REFITTED_SHARE, _MOST_REFITTED, tell)
        fault = story.fault(ranked, lambda trials=trials: trials, tell)
        if fault:
            story.add(fault)
            continue
        first = first or with_drops(ranked, trials)
        accepted = [trial for trial in trials if pays(story.current, trial, story.data, story.held)]
        if not accepted:
            break
        best, others = _chosen(accepted)
        curve = curve_instead(story.data, story.held, story.current, best, left.explanation, tell)
        more = None if curve else _further(story, best, tell)
        orders = [settings["order"] for settings in more.effects.values()] if more else []
        if curve or is_a_shape([best.candidate.settings.get("order", 0.0), *orders]):
            break
        if others and not rivals:
            rivals = [best, *others]
        story.add(best, ties=[trial.candidate.name for trial in others])
        if more:
            story.add(more, f"+ {best.candidate.name} of orders {', '.join(f'{order:g}' for order in orders)}")
    _drop_idle(story, tell)
    unknown = story.left().explanation
    if unknown is not None and not _named(story):
        unknown = _with_curve(story, curve, unknown, tell)
    return Walked(first, rivals, unknown)


def _chosen(accepted: Sequence[Trial]) -> tuple[Trial, list[Trial]]:
    """The best of the trials, and those that cannot be told from it.

    Of what cannot be told apart, a parameter outside its tolerance comes after an effect.
    """
    tied = [trial for trial in accepted if accepted[0].drop - trial.drop < _TIE]
    best = next((trial for trial in tied if not find(trial.candidate.name).duplicates), tied[0])
    return best, [trial for trial in tied if trial is not best]


def _further(story: Story, best: Trial, tell: Progress) -> Trial | None:
    """Further orders of a periodic effect, beside it."""
    if not find(best.candidate.name).is_periodic:
        return None
    return with_further_orders(story.data, story.held, best.fit, best.candidate.name, tell)


def _drop_idle(story: Story, tell: Progress) -> None:
    """Takes out effects that later ones have made idle."""
    for one in story.added[:-1]:
        tell(f"trying without {one.name}")
        smaller = story.without(one.key, tell)
        if smaller.chi2 - story.current.chi2 < fitted_count(one.key) * np.log(len(smaller.residual)) + LEAST_BIC:
            story.remove(one.key, smaller)


def _with_curve(story: Story, curve: Trial | None, unknown: Explanation, tell: Progress) -> Explanation:
    """Adds the curve of what is unknown, and tells what it stands for.

    Parameters that only bent toward it go back: the curve is drawn beside the calibrated model, if one can be.
    """
    bent = story.steps[story.bare :]
    whole = None
    if bent:
        try:
            story.restart()
            whole = story.left().explanation
            curve = story.curve(whole, tell)
        finally:  # also when it was stopped
            story.steps += bent
    if bent and curve and whole:
        story.restart()
        unknown = whole
    curve = curve or story.curve(unknown, tell)
    if curve:
        story.add(curve)
    return unknown


def _named(story: Story) -> list[str]:
    """The library's effects in the model that are no parameters outside their tolerance."""
    return [one.name for one in story.added if one.name in CATALOGUE and not find(one.name).duplicates]


def result_of(
    story: Story,
    candidates: Sequence[Candidate] = (),
    unknown: Explanation | None = None,
    experiment: Experiment | None = None,
) -> Discovery:
    """What a story comes to; unknown: what its last model leaves."""
    calibration = story.current.calibration
    named = _named(story)
    faults = {name: calibration.parameters[name] for name in story.current.faults}
    outside = [name for name in calibration.outside_tolerance if "." in name and not name.startswith("effects.")]
    stand_ins = [path for one in story.added if (path := find(one.name).duplicates)]
    return Discovery(
        verdict=_verdict(story, unknown),
        calibration=calibration,
        effects=[one for one in story.added if one.name in named],
        ladder=story.ladder,
        candidates=candidates,
        faults=faults,
        parameters_outside_tolerance=list(dict.fromkeys([*stand_ins, *outside])),
        actuator=calibration.actuator,
        plant=story.current.plant,
        floors=story.data.floors,
        data=story.data,
        held=story.held,
        unknown=unknown,
        curve=next((one for one in story.added if one.name not in CATALOGUE), None),
        next_experiment=experiment,
        warnings=[
            *story.warnings,
            *masked(story.added, calibration.actuator.axes),
            *as_well(story.ties, story.added, story.current.faults),
        ],
    )


def _verdict(story: Story, unknown: Explanation | None) -> str:
    if not story.repeatable:
        return "not_repeatable"
    if _named(story):
        return "effects_found"
    if not story.base.calibration.converged and not story.added:
        return "not_converged"  # an unfinished fit looks exactly like missing physics
    return "adequate" if unknown is None else "unknown_effect"


def settings_of(found: Discovery) -> Mapping[str, Mapping[str, float]]:
    """The effects of the improved model, as `compare` and `simulate` take them."""
    return {one.key: found.actuator.effects[one.key] for one in found.effects}
