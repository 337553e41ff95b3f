"""A discovery's steps in what JSON can hold, and the same steps taken again from their fitted values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from itertools import pairwise
from typing import Any

from ema_model.actuator.write import as_toml
from ema_model.commands import command
from ema_model.discovery import Candidate, Story
from ema_model.discovery.model_fit import fit
from ema_model.discovery.path import Step
from ema_model.discovery.refit import Trial
from ema_model.discovery.result import Experiment
from ema_model.effects import CATALOGUE, catalogue_name, find
from ema_model.errors import InputError
from ema_model.faults import NAMES
from emaviz.session.discover.refits import check_value
from emaviz.session.discover.source import actuator_of
from emaviz.session.settings import number

MOST_STEPS = 100
_FARTHEST = 1e3  # σ that a fitted value may be off
_DAMAGED = "the session's steps of Discover are damaged; save it anew"

Tell = Callable[[str], None]


def steps_of(story: Story) -> list[dict[str, Any]]:
    """Each step after the calibration: its model as an actuator's file, where its fit ended, and its rivals."""
    return [
        {
            "model": as_toml(step.fit.actuator),
            "starts": step.fit.starts,
            "faults": list(step.fit.faults),
            "same_as": sorted({name for one in step.added if one.key not in _keys(before) for name in one.same_as}),
        }
        for before, step in pairwise(story.steps)
    ]


def take_again(story: Story, steps: Sequence[Mapping[str, Any]], tell: Tell, shown: Callable[[], None]) -> None:
    """Takes saved steps after the calibration; each fit begins where it ended then.  shown() follows each step.

    Raises InputError for steps that make no sense, with the steps before them taken.
    """
    for i, one in enumerate(steps, 1):
        tell(f"step {i} of {len(steps)}")
        _take(story, one, lambda text, i=i: tell(f"step {i} of {len(steps)}: {text}"))
        shown()


def checked(steps: Any) -> list[dict[str, Any]]:
    """The steps of a session's file; InputError if they are none."""
    if not isinstance(steps, list) or len(steps) > MOST_STEPS or not all(isinstance(one, dict) for one in steps):
        raise InputError(_DAMAGED)
    for one in steps:
        if not isinstance(one.get("model"), str) or not isinstance(one.get("starts"), dict):
            raise InputError(_DAMAGED)
        if not all(_is_near(value) for value in one["starts"].values()) or not _are_faults(one.get("faults", [])):
            raise InputError(_DAMAGED)
    return steps


def experiment_of(saved: Any) -> Experiment | None:
    """A suggested test as `asdict` gave it; InputError if it is none."""
    if saved is None:
        return None
    try:
        settings = {str(name): float(value) for name, value in saved["settings"].items()}
        command(str(saved["command"]), settings)
        first, second = (find(str(name)).name for name in saved["separates"])
        return Experiment(
            str(saved["command"]),
            settings,
            number(saved["duration_s"], "the test's duration"),
            number(saved["load_torque_Nm"], "the test's load"),
            None if saved["add_signal"] is None else str(saved["add_signal"])[:200],
            (first, second),
            number(saved["expected_chi2"], "the test's χ²"),
        )
    except InputError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(_DAMAGED) from None


def experiment_saved(one: Experiment | None) -> dict[str, Any] | None:
    """A suggested test in what JSON can hold."""
    return None if one is None else asdict(one)


def _take(story: Story, saved: Mapping[str, Any], tell: Tell) -> None:
    model, before = actuator_of(saved["model"]), story.current.actuator
    own = {path: one for path, one in model.tolerances.items() if path.startswith("effects.")}
    others = {path: one for path, one in before.tolerances.items() if not path.startswith("effects.")}
    found = fit(
        story.data,
        replace(before, effects=model.effects, tolerances={**others, **own}),
        {str(name): float(x) for name, x in saved["starts"].items()},
        tell,
        tuple(saved.get("faults", ())),
    )
    more = found.faults[len(story.current.faults) :]
    new = [key for key in model.effects if key not in before.effects]
    gone = [key for key in before.effects if key not in model.effects]
    if more and not (new or gone):
        story.add(Trial(Candidate(more[0], 0.0, {}), {}, found, story.current.chi2 - found.chi2, more))
    elif len(gone) == 1 and not new:
        story.remove(gone[0], found)
    elif new and not gone:
        effects = {key: dict(model.effects[key]) for key in new}
        name = catalogue_name(new[0])
        trial = Trial(Candidate(name, 0.0, effects[new[0]]), effects, found, story.current.chi2 - found.chi2)
        check_value(trial)
        rivals = [str(one) for one in saved.get("same_as", ()) if one in CATALOGUE and one not in model.effects]
        story.add(trial, rivals)
    else:
        raise InputError(_DAMAGED)


def _keys(step: Step) -> set[str]:
    return {one.key for one in step.added}


def _are_faults(names: Any) -> bool:
    return isinstance(names, list) and all(name in NAMES for name in names) and len(set(names)) == len(names)


def _is_near(value: Any) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value) and abs(value) < _FARTHEST
