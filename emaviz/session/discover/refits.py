"""Candidates refitted in the model of a story, each once; and the two between which a test would have to decide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ema_model.discovery import Candidate, Story
from ema_model.discovery.candidates.refit import Trial
from ema_model.discovery.shown.labels import effect_title
from ema_model.discovery.steps.snapshot import Assessment, Look, known_of
from ema_model.discovery.steps.step import Step
from ema_model.errors import InputError
from ema_model.quantities.titles import in_sentence
from emaviz.session.job import Tell

_MOST_FOLLOWED = 8  # times that a fit is begun anew where the one before has ended


class Trials:
    """Those of one story, kept."""

    def __init__(self) -> None:
        self._known: dict[tuple[Step, str], Trial] = {}

    def of(self, story: Story, candidate: Candidate, tell: Tell) -> Trial:
        """A candidate in the last model of a story."""
        key = (story.steps[-1], candidate.name)
        known = self._known.get(key)
        if known is None or known.candidate.settings != candidate.settings:
            known = self._known[key] = story.trial(candidate, tell)
        return known

    def followed(self, story: Story, trial: Trial, tell: Tell) -> Trial:
        """A user's effect, fitted again from where its parameters went to a bound: their scale is the user's guess."""
        check_value(trial)
        name = trial.candidate.name
        for _ in range(_MOST_FOLLOWED):
            fitted = trial.fit.calibration.parameters
            if not any(one.at_bound for path, one in fitted.items() if path.startswith(f"effects.{name}.")):
                break
            settings = dict(trial.fit.calibration.actuator.effects[name])
            again = story.trial(replace(trial.candidate, settings=settings), tell)
            if again.fit.chi2 >= trial.fit.chi2:
                break
            trial = again
        return trial


def check_value(trial: Trial) -> None:
    """Raises InputError for a refitted model that has no value somewhere: whatever failed stays out of the story."""
    if not all(np.all(np.isfinite(values)) for one in trial.fit.calibration.signals for values in one.values()):
        title = in_sentence(effect_title(trial.candidate.name))
        raise InputError(
            f"with {title} the model has no value somewhere in these recordings, as in a division by zero; it was not "
            "added"
        )


def undecided(story: Story, known: Mapping[Step, Assessment]) -> tuple[Story, list[Candidate]] | None:
    """The last step at which two candidates were worth a refit, as a story that ends there, and the best two."""
    for at in range(len(story.steps), 0, -1):
        found = known_of(story.steps[at - 1], known)
        worth = [one for one in found.candidates if Look.is_worth(one)] if found else []
        if len(worth) > 1:
            return Story(story.data, story.held, story.steps[:at]), worth[:2]
    return None
