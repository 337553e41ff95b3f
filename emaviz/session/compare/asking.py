"""A comparison that is asked for is made: once the files on their way are read, and no other long run goes on."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable

from ema_model.errors import InputError
from emaviz.session.job import Job


class Asking:
    """What is asked for while it cannot begin waits for its turn, and says for what; what is missing is told."""

    def __init__(
        self,
        job: Job,
        title: Callable[[], str],
        begin: Callable[[], bool],
        chosen: Callable[[], Hashable],
        refused: Callable[[str, bool], object],
    ) -> None:
        """begin(): False while another long run goes on, InputError for what is missing; chosen(): what it would take.

        refused(why, by_hand): what is missing, or "" once it has begun.
        """
        self._job, self._title, self._begin, self._chosen, self._refused = job, title, begin, chosen, refused
        self._reading: set[str] = set()
        self._by_hand = False
        self._running: Hashable = None  # what the run that goes on, or did last, was of
        self._lock = threading.RLock()  # a button and the end of a file are on threads of their own

    @property
    def reading(self) -> list[str]:
        """Names of the files that are being read."""
        with self._lock:
            return sorted(self._reading)

    def reads(self, name: str) -> None:
        """A file is on its way: what is asked for waits for it."""
        with self._lock:
            self._reading.add(name)

    def has_read(self, name: str) -> None:
        """It is read, or refused."""
        with self._lock:
            self._reading.discard(name)

    def ask(self, by_hand: bool) -> None:
        """Compares what is chosen once it can; nothing new while a run of the same goes on.

        by_hand: a person has pressed for it, and did not only add a file.
        """
        with self._lock:
            self._by_hand = by_hand or (self._job.waiting and self._by_hand)
            if not self._same() and (self._waits_for() or not self._try()):
                self._job.begin_in_turn(self._title(), self._try, self._waits_for)

    def _same(self) -> bool:
        return self._job.running and self._chosen() == self._running

    def _try(self) -> bool:
        """Whether there is no more to wait for: it has begun, or cannot."""
        with self._lock:
            if self._same():
                return True
            chosen, by_hand = self._chosen(), self._by_hand
            try:
                begun, why = self._begin(), ""
            except InputError as error:
                begun, why = True, str(error)
            if begun and not why:
                self._running = chosen
        if begun:
            self._refused(why, by_hand)
        return begun

    def _waits_for(self) -> str:
        reading = self.reading
        if not reading:
            return ""
        more = f" and {len(reading) - 1} more" if len(reading) > 1 else ""
        return f"{reading[0]}{more} to be read"
