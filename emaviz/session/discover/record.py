"""A discovery's steps in what JSON can hold, and the same steps taken again from their fitted values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

from ema_model.actuator.write import as_toml
from ema_model.discovery import Candidate, Story
from ema_model.discovery.candidates.refit import Trial
from ema_model.discovery.model_fit import fit
from ema_model.discovery.steps.step import Step
from ema_model.effects import CATALOGUE, catalogue_name
from ema_model.errors import InputError
from ema_model.faults import NAMES
from emaviz.session.discover.refits import check_value
from emaviz.session.discover.saved_story import SavedStep
from emaviz.session.discover.source import actuator_of

_DAMAGED = "the session's steps of Discover are damaged; save it anew"

Tell = Callable[[str], None]


def steps_of(story: Story) -> tuple[SavedStep, ...]:
    """Each step after the calibration."""
    return tuple(
        SavedStep(
            as_toml(step.fit.actuator),
            dict(step.fit.starts),
            tuple(step.fit.faults),
            _rivals(story, before, step),
        )
        for before, step in pairwise(story.steps)
    )


def take_again(story: Story, steps: Sequence[SavedStep], tell: Tell, shown: Callable[[], None]) -> None:
    """Takes saved steps after the calibration; each fit begins where it ended then.  shown() follows each step.

    Raises InputError for steps that make no sense, with the steps before them taken.
    """
    for i, one in enumerate(steps, 1):
        tell(f"step {i} of {len(steps)}")
        _take(story, one, lambda text, i=i: tell(f"step {i} of {len(steps)}: {text}"))
        shown()


def _take(story: Story, saved: SavedStep, tell: Tell) -> None:
    model, before = actuator_of(saved.model), story.current.actuator
    own = {path: one for path, one in model.tolerances.items() if path.startswith("effects.")}
    others = {path: one for path, one in before.tolerances.items() if not path.startswith("effects.")}
    found = fit(
        story.data,
        replace(before, effects=model.effects, tolerances={**others, **own}),
        saved.starts,
        tell,
        saved.faults,
    )
    more = tuple(name for name in found.faults if name not in story.current.faults)
    less = [name for name in story.current.faults if name not in found.faults]
    rivals = [one for one in saved.same_as if one in (*CATALOGUE, *NAMES) and one not in model.effects]
    new = [key for key in model.effects if key not in before.effects]
    gone = [key for key in before.effects if key not in model.effects]
    if more and not (new or gone or less):
        story.add(Trial(Candidate(more[0], 0.0, {}), {}, found, story.current.chi2 - found.chi2, more), rivals)
    elif less and not (new or gone or more):
        story.remove(less[0], found)
    elif more or less:
        raise InputError(_DAMAGED)
    elif len(gone) == 1 and not new:
        story.remove(gone[0], found)
    elif len(gone) == len(new) == 1:
        story.swap(gone[0], Trial(Candidate(new[0], 0.0, {}), {new[0]: {}}, found, story.current.chi2 - found.chi2))
    elif new and not gone:
        effects = {key: dict(model.effects[key]) for key in new}
        name = catalogue_name(new[0])
        trial = Trial(Candidate(name, 0.0, effects[new[0]]), effects, found, story.current.chi2 - found.chi2)
        check_value(trial)
        story.add(trial, rivals)
    else:
        raise InputError(_DAMAGED)


def _rivals(story: Story, before: Step, step: Step) -> tuple[str, ...]:
    """What cannot be told from that which a step adds."""
    effects = {name for one in step.added if one.key not in _keys(before) for name in one.same_as}
    faults = {story.ties[name] for name in step.fit.faults if name not in before.fit.faults and name in story.ties}
    return tuple(sorted(effects | faults))


def _keys(step: Step) -> set[str]:
    return {one.key for one in step.added}
