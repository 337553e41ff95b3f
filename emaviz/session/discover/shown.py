"""The story that is shown: begun, a step further, and looked at anew, on the compute thread."""

from __future__ import annotations

from collections.abc import Sequence

from ema_model.discovery import begun
from ema_model.discovery.candidates.refit import Trial
from ema_model.discovery.steps.snapshot import Look
from emaviz.session.discover.entries import Entries, Entry
from emaviz.session.discover.progress import Telling
from emaviz.session.discover.refits import check_value
from emaviz.session.discover.saved_story import Recipe
from emaviz.session.discover.source import DiscoverySource
from emaviz.session.job import Tell
from emaviz.session.signal import Signal


class Shown:
    """It, and the last picture of it; both None while there is none."""

    def __init__(self, source: DiscoverySource, entries: Entries, looked: Signal[[Look | None]]) -> None:
        """looked: told each picture."""
        self.told: Telling | None = None
        self.look: Look | None = None
        self._source, self._entries, self._looked = source, entries, looked

    @property
    def is_behind(self) -> bool:
        """Whether the story is a step further than its picture."""
        return self.told is not None and (self.look is None or self.look.steps != len(self.told.story.steps))

    def leave(self) -> None:
        """Shows none; the story stays among the entries."""
        self._entries.leave()
        self.told = self.look = None

    def recall(self, entry: Entry) -> None:
        """A story as it was left, at once."""
        self._entries.current, self.told, self.look = entry, entry.told, entry.look
        self._looked(self.look)

    def begin(self, recipe: Recipe, tell: Tell) -> Telling:
        """A story of its own: reads what the recipe says, and calibrates."""
        tell("reading")
        given = self._source.read(recipe)
        told = Telling(begun(given.fitted, given.actuator, given.held, given.signals, tell), recipe)
        self._entries.begin(told)
        self.told, self.look, self._source.revealed = told, None, False
        return told

    def take(self, told: Telling, trial: Trial, alike: Sequence[str], tell: Tell) -> None:
        """A trial into the model; alike: effects that cannot be told from it."""
        check_value(trial)
        tell("measuring the new model's error")  # the last moment to stop
        told.add(trial, alike)
        self.assess(told, tell)

    def assess(self, told: Telling, tell: Tell) -> None:
        """Shows the model as it is now, then what may be missing from it."""
        self.show(told)
        if not told.is_assessed:
            tell("analysing the residual; the library of effects is compiled on its first use")
            told.assess()
            self.show(told)

    def show(self, told: Telling) -> None:
        """A new picture."""
        self.look = told.look()
        if self._entries.current is not None:
            self._entries.current.look = self.look
        self._looked(self.look)
