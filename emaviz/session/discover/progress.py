"""A story and all that belongs to it: what is known of its steps, what it was made from, how it is written down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ema_model.comparison.explain import Explanation
from ema_model.discovery import Candidate, Story, result_of
from ema_model.discovery.candidates.refit import Trial, with_drops
from ema_model.discovery.result import Experiment
from ema_model.discovery.steps.snapshot import Assessment, Look, assessed, known_of, look_at
from ema_model.discovery.steps.step import Step
from ema_model.effects import CATALOGUE
from emaviz.session.discover.record import steps_of
from emaviz.session.discover.refits import Trials
from emaviz.session.discover.saved_story import Recipe, SavedStory


@dataclass(eq=False)
class Telling:
    """One story as it is told on the page."""

    story: Story
    recipe: Recipe  # of its recordings
    known: dict[Step, Assessment] = field(default_factory=dict)  # so that a step back is at once
    trials: Trials = field(default_factory=Trials)  # so that nothing is fitted twice
    first: Sequence[Candidate] = ()  # of the first search, with what their refits gave
    experiment: Experiment | None = None

    @property
    def is_assessed(self) -> bool:
        """Whether it is known what may be missing from the last model."""
        return self.story.steps[-1] in self.known

    def assess(self) -> None:
        """Looks at what the last model leaves; takes a second, and the first time a compilation."""
        found = self.known[self.story.steps[-1]] = assessed(self.story)
        self.first = self.first or found.candidates

    def add(self, trial: Trial, alike: Sequence[str]) -> None:
        """Takes a trial for the next model; alike: effects and faults that cannot be told from it."""
        self.story.add(trial, ties=alike)
        if self.first and trial.candidate.predicted_drop:
            self.first = with_drops(self.first, [trial])

    def look(self) -> Look:
        """A picture of the story as it stands."""
        story = self.story
        found = result_of(story, self.first, self._unknown(), self.experiment)
        return look_at(story, found, self.known.get(story.steps[-1]), known_of(story.steps[0], self.known))

    def _unknown(self) -> Explanation | None:
        """What is left by the last model; with a torque of no name in it, what that one stands in for."""
        steps = self.story.steps
        nameless = (i for i, step in enumerate(steps) if any(one.name not in CATALOGUE for one in step.added))
        known = known_of(steps[next(nameless, len(steps)) - 1], self.known)
        return known.left.explanation if known is not None else None

    def saved(self) -> SavedStory:
        """The steps, and what they were made from."""
        return SavedStory(self.recipe, steps_of(self.story), self.experiment)
