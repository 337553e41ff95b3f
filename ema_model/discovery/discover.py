"""Which physical effects are missing: calibrate, look at all Terms, add the most probable, repeat; and the verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison.explain import Explanation
from ema_model.comparison.result import Comparison
from ema_model.discovery.history import ShownFit, Story, begun, refreshed
from ema_model.discovery.inverse import other_loop, support_of
from ema_model.discovery.loop import repeated
from ema_model.discovery.next_experiment import next_experiment
from ema_model.discovery.remaining import free_simulation, lasts, left_by, silence, within_band
from ema_model.discovery.result import Added, Candidate, Discovery, Experiment, errors_of, misses_unseen
from ema_model.discovery.search import NO_LIMIT, search
from ema_model.discovery.uncertainty import outside_tolerance, with_intervals
from ema_model.discovery.words import as_well, held_back, mismatch, untold
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError, quoted
from ema_model.quantities import as_number
from ema_model.recordings import Measurement

Progress = Callable[[str], None]


class _Stopped(Exception):
    """What was found so far shall be the answer."""


def discover(
    measurements: Sequence[Measurement],
    actuator: Actuator | None = None,
    *,
    holdout: Sequence[Measurement] = (),
    signals: Sequence[str] | None = None,
    candidates: Sequence[str] | None = None,
    most_effects: int = NO_LIMIT,
    compared: Comparison | None = None,
    on_progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
) -> Discovery:
    """The missing effects of recordings of one actuator, added to its model one after another.

    holdout: recordings that are not fitted and must improve as well; candidates: effects to consider, all of the
    catalogue's without it; compared: a comparison of the same, on whose calibration this goes on.  on_progress is told
    what goes on, and may raise to stop.  stop() is asked as often once the model is calibrated; where it is true, what
    was added so far is the answer, with the verdict "interrupted".
    Raises InputError for recordings that cannot be compared.
    """
    if not as_number(most_effects) >= 0.0:
        raise InputError(f"most_effects must be a number from 0 on, not {quoted(repr(most_effects), 40)}")
    progress = on_progress or (lambda text: None)

    def go_on() -> None:
        if stop is not None and stop():
            raise _Stopped

    def tell(text: str) -> None:
        progress(text)
        go_on()

    story = begun(measurements, actuator or load_actuator(), holdout, signals, progress, compared)
    if not story.repeatable:
        return result_of(story)
    try:
        go_on()
        found = search(story, tell, candidates=candidates, most_effects=most_effects)
        experiment = None
        if found.rivals:
            tell("looking for a test that tells the rivals apart")
            first, second = found.rivals[:2]
            experiment = next_experiment(story.data, first, second)
            if experiment is None:
                story.warnings.append(untold(first.candidate.name, second.candidate.name))
    except _Stopped:
        return result_of(story, interrupted=True)
    return result_of(story, found.candidates, found.unknown, experiment)


def result_of(
    story: Story,
    candidates: Sequence[Candidate] = (),
    unknown: Explanation | None = None,
    experiment: Experiment | None = None,
    *,
    interrupted: bool = False,
) -> Discovery:
    """What a story comes to; unknown: what its last model leaves; interrupted: before its end."""
    seen = _shown(story)
    calibration, events = seen.calibration, seen.events
    names = story.named
    added = [
        replace(refreshed(one, calibration), supported_by=support_of(story, one.name), **errors_of(story.ladder, one))
        for one in story.added
    ]
    named = [one for one in added if one.name in names]
    faults = {name: calibration.parameters[name] for name in story.current.faults}
    outside = outside_tolerance(story.data, story.current)
    freed = [one for one in added if one.stands_for]
    lag = other_loop(story) if story.current.plant.simulates_commands else story.loop_lag
    told = {name for one in (*named, *freed) for name in (one.name, *one.same_as)}  # refused at an earlier step, or not
    return Discovery(
        verdict=verdict_of(story, named, unknown, interrupted),
        calibration=calibration,
        effects=named,
        ladder=story.ladder,
        candidates=_as_named(candidates, [*named, *freed]),
        faults=faults,
        parameters_outside_tolerance=list(dict.fromkeys([*(one.stands_for for one in freed), *outside])),
        actuator=calibration.actuator,
        plant=story.current.plant,
        floors=story.data.told_in,
        data=story.data,
        at_floor=explains_all(story),
        held=story.held,
        unknown=unknown,
        curve=next((one for one in added if one.name not in CATALOGUE), None),
        next_experiment=experiment,
        not_claimed={name: why for name, why in story.refused.items() if name not in told},
        warnings=[
            *story.warnings,
            *(one.sentence for one in events),
            *mismatch(story.controller_seen, calibration.actuator.axes, lag),
            *([story.transmission_seen.sentence(calibration.actuator)] if story.transmission_seen else ()),
            *([story.two_masses_seen.sentence(calibration.actuator)] if story.two_masses_seen else ()),
            *(one.sentence for one in story.disagreements),
            *held_back(story.current.held, calibration.actuator.axes),
            *as_well(story.ties, story.added, story.current.faults),
        ],
        controller_seen=story.controller_seen,
        loop_lag=lag,
        transmission_seen=story.transmission_seen,
        two_masses_seen=story.two_masses_seen,
        disagreements=story.disagreements,
        repeated=repeated(story.data, story.held, calibration.actuator),
        events=events,
        freed=freed,
        simulation=seen.simulation,
    )


def _shown(story: Story) -> ShownFit:
    """What is computed of the last model to be shown, once in the same floors."""
    found = story.current
    known = story.shown.get(found)
    if known is None or known.data is not story.data or known.held is not story.held:
        data, held = story.data, story.held
        simulation = known.simulation if known is not None and known.is_of(data, held) else None
        known = story.shown[found] = ShownFit(
            data,
            held,
            with_intervals(data, found),
            left_by(data, story.without_curve).events,
            free_simulation(data, held, found) if simulation is None else simulation,
        )
    return known


def _as_named(candidates: Sequence[Candidate], named: Sequence[Added]) -> list[Candidate]:
    """Candidates of the first round; those named since, and what is not told from them, as probable as said there."""
    since = {name: one.probability or 0.0 for one in named for name in (one.name, *one.same_as)}
    told = [
        replace(one, probability=max(one.probability or 0.0, since[one.name])) if one.name in since else one
        for one in candidates
    ]
    return sorted(told, key=lambda one: -(one.probability or 0.0))


def settings_of(found: Discovery) -> Mapping[str, Mapping[str, float]]:
    """The effects of the improved model, as `compare` and `simulate` take them."""
    return {one.key: found.actuator.effects[one.key] for one in found.effects}


# --- the verdict, bound to its ladder: nothing is said that the error does not bear out -------------------------------


def verdict_of(story: Story, named: Sequence[Added], unknown: Explanation | None, interrupted: bool = False) -> str:
    """One of `VERDICTS`; named: the library's effects in the last model; unknown: what the last model leaves."""
    if interrupted:
        return "interrupted"
    if not story.repeatable:
        return "not_repeatable"
    done = explains_all(story) and story.transmission_seen is None
    if named:
        return "effects_found" if done else "partly_explained"
    if silence(story.data, story.current):
        return "uninformative"
    if not story.base.calibration.converged and not story.added:
        return "not_converged"  # an unfinished fit looks exactly like missing physics
    if done:
        noise = unknown is None and not lasts(story.data, story.current)
        return "adequate" if noise else "unknown_effect"
    return "partly_explained" if story.added else "unknown_effect"


def explains_all(story: Story) -> bool:
    """Whether what is left may be noise and the model's floor: within its band, and not far off what was not fitted."""
    return within_band(story.data, story.current) and not misses_unseen(story.ladder[-1], story.disagreements)
