"""All discoveries of a session: each keeps its story, so that one goes from one to the other without computing."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime

import msgspec

from ema_model.challenges import Challenge
from ema_model.discovery.steps.snapshot import Look
from ema_model.quantities.numbers import number
from emaviz.session.discover.progress import Telling
from emaviz.session.discover.saved_story import Recipe, SavedStory
from emaviz.session.discover.source import DiscoverySource
from emaviz.session.inputs import Inputs

_MOST_NAMES = 2  # of recordings, in an entry's words


@dataclass(eq=False)
class Entry:
    """One discovery.  One that a session's file brought has no story until its steps are taken again."""

    number: int
    recipe: Recipe
    told: Telling | None = None
    look: Look | None = None
    challenge: Challenge | None = None
    revealed: bool = False
    at: datetime = field(default_factory=datetime.now)
    brought: SavedStory | None = None  # what the file says, while there is no story
    inputs: Inputs | None = None  # of the story

    def saved(self) -> SavedStory:
        """As a session's file has it."""
        if self.told is None:
            assert self.brought is not None, "it was told here, or brought"
            return self.brought
        return msgspec.structs.replace(self.told.saved(), revealed=self.revealed, says=self.result)

    @property
    def subject(self) -> str:
        """What was recorded."""
        if self.challenge is not None:
            return self.challenge.title
        names = [name.rpartition("/")[2] for name in self.recipe.fitted]
        more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
        return (", ".join(names[:_MOST_NAMES]) + more) or self.recipe.challenge or "recordings"

    @property
    def result(self) -> str:
        """Steps and error: '2 added, 1.02 × floor'."""
        if self.look is None:
            return self.brought.says[:80] if self.brought is not None else "not opened yet"
        added = len(self.look.removable)
        return f"{f'{added} added' if added else 'calibrated'}, {number(self.look.rmse)} × floor"

    @property
    def words(self) -> str:
        """A line to choose it by."""
        return f"{self.number} · {self.subject} · {self.result} · {self.at:%H:%M}"


class Entries:
    """The discoveries, the oldest first, and which one is shown."""

    def __init__(self, source: DiscoverySource) -> None:
        self._source = source
        self.all: list[Entry] = []
        self.current: Entry | None = None

    def begin(self, told: Telling) -> Entry:
        """A new one, or the one that was brought and is taken again now, is shown."""
        entry = self.current
        if entry is None or entry.told is not None:
            self.leave()
            entry = self._new(told.recipe)
        entry.told, entry.look, entry.brought, entry.revealed = told, None, None, False
        entry.challenge = self._source.challenge
        self.current = entry
        return entry

    def bring(self, saved: SavedStory) -> Entry:
        """One of a session's file."""
        entry = self._new(saved.recipe)
        entry.brought = saved
        return entry

    def leave(self) -> None:
        """Something else is shown; what the source says of the present one is remembered."""
        if self.current is not None and self.current.told is not None:
            self.current.revealed = self._source.revealed
        self.current = None

    def _new(self, recipe: Recipe) -> Entry:
        entry = Entry(1 + max((one.number for one in self.all), default=0), recipe)
        self.all.append(entry)
        return entry
