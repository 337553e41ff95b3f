"""The discoveries in a session's file: what it is given, and what it brings, taken again step by step."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from typing import Any

import msgspec

from emaviz.session.discover.entries import Entries, Entry
from emaviz.session.discover.record import take_again
from emaviz.session.discover.saved_story import SavedStory, story_of
from emaviz.session.discover.shown import Shown
from emaviz.session.discover.source import DiscoverySource
from emaviz.session.inputs import Provenance
from emaviz.session.job import RESTED, Job, Stopped, Tell

_MOST_BROUGHT = 50  # discoveries beside the shown one
_MOST_WAIT_S = 20.0  # for measurements that may never be there
_TITLE = "Taking the session's steps again"


class SavedStories:
    """Saves all entries; takes those of a file."""

    def __init__(
        self,
        job: Job,
        source: DiscoverySource,
        entries: Entries,
        shown: Shown,
        opened: Callable[[], Collection[str]],
        provenance: Provenance,
    ) -> None:
        """opened(): names of the recordings that are open on Compare."""
        self._job, self._source, self._entries, self._shown, self._opened = job, source, entries, shown, opened
        self._provenance = provenance
        self._again: SavedStory | None = None  # what is being taken again, or was when it was stopped

    def forget(self) -> None:
        """What was being taken again is put away."""
        self._again = None

    @property
    def unfinished(self) -> Entry | None:
        """The discovery of a file whose steps are not all taken again."""
        return self._entries.current if self._again is not None else None

    def saved(self) -> SavedStory | None:
        """Every discovery, the one that is shown (else the last) first and the rest as its others; None without one."""
        entries = self._entries
        current = entries.current or (entries.all[-1] if entries.all else None)
        if current is None:
            return self._again
        if current is entries.current:
            current.revealed = self._source.revealed
        first = self._again or current.saved()
        return msgspec.structs.replace(first, others=tuple(one.saved() for one in entries.all if one is not current))

    def files(self) -> list[str]:
        """Names in the data folder of what they are made from."""
        saved = self.saved()
        return [] if saved is None else [name for one in (saved, *saved.others) for name in one.recipe.files]

    def bring(self, saved: Any, names: Mapping[str, str]) -> Entry:
        """The entries of a file; returns the one that is to be shown.  InputError, and none of them, if it is damaged.

        names: the files' names of now by those of then.
        """
        told = story_of(saved)
        first, *others = (
            msgspec.structs.replace(one, recipe=self._source.checked(one.recipe.renamed(names)), others=())
            for one in (told, *told.others)
        )
        for one in others[:_MOST_BROUGHT]:
            self._entries.bring(one)
        return self._entries.bring(first)

    def take_again(self, entry: Entry) -> None:
        """The steps of one that a file brought, once nothing else runs; its fits begin where they ended then."""
        saved, shown = entry.brought or self._again, self._shown
        assert saved is not None, "it has no story yet"
        self._source.take(saved.recipe)
        shown.leave()
        entry.told, entry.look, entry.brought = None, None, saved
        self._entries.current, self._again = entry, saved

        def job(tell: Tell) -> None:
            inputs = self._source.inputs()
            try:
                told = shown.begin(saved.recipe, tell)
                shown.assess(told, tell)  # the first step's cards are what the report ranks
                take_again(told.story, saved.steps, tell, lambda: shown.show(told))
            except Stopped:
                raise  # the rest can be taken later
            except BaseException:
                self._again = None
                raise
            told.experiment, self._source.revealed = saved.experiment, saved.revealed
            self._again, entry.inputs = None, inputs
            self._provenance.take(inputs)
            shown.assess(told, tell)

        wanted, until = {*saved.recipe.fitted, *saved.recipe.held}, time.perf_counter() + _MOST_WAIT_S

        def waits_for() -> str:
            open_or_late = wanted <= {*self._opened()} or time.perf_counter() > until
            return "" if open_or_late else "its measurements, which are being read"

        def begin() -> bool:
            return self._provenance.begin(lambda: self._job.begin(_TITLE, job))

        self._job.begin_in_turn(_TITLE, begin, waits_for, RESTED)
