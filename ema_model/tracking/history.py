"""What was known of a unit after each of its flights, and what came then."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

from ema_model import faults
from ema_model.errors import InputError
from ema_model.tracking.evidence import LEAST_FLIGHTS
from ema_model.tracking.flights import Flight
from ema_model.tracking.result import Tracked
from ema_model.tracking.track import Tracker


@dataclass(frozen=True)
class Came:
    """What came after a flight."""

    crossed: int | None  # flights later, in which the level of k had reached its threshold; None: not so far
    seen: int  # flights since


@dataclass(frozen=True, eq=False)
class HistoryParts:
    """Of which a history is made: where it is stored, they stand for it."""

    thresholds: dict[str, float]
    seed: int
    flights: list[Flight]
    looks: dict[int, Tracked]  # without their flights, which are the first of these

    def made(self) -> History:
        """The history; InputError for looks that are not of its flights."""
        made = History(self.thresholds, self.seed)
        if not {*self.looks} <= {*range(1, len(self.flights) + 1)}:
            raise InputError("a history's looks are not of its flights")
        made.flights, made._tracker = self.flights, None
        made.looks = {count: replace(one, flights=tuple(self.flights[:count])) for count, one in self.looks.items()}
        return made


class History:
    """The looks of a `Tracker`, flight after flight; flights that arrive at the end cost their own looks alone."""

    def __init__(self, thresholds: Mapping[str, float] | None = None, seed: int = 0) -> None:
        """InputError as `Tracker`."""
        self.thresholds, self._seed = dict(thresholds or {}), seed
        self.looks: dict[int, Tracked] = {}  # by how many flights there were
        self.flights: list[Flight] = []  # in order of time
        self._tracker: Tracker | None = Tracker(self.thresholds, seed)

    def made_of(self) -> HistoryParts:
        """As `ema_model.result` stores it."""
        bare = {count: replace(one, flights=()) for count, one in self.looks.items()}
        return HistoryParts(self.thresholds, self._seed, self.flights, bare)

    def follow(self, flights: Sequence[Flight]) -> Iterator[int]:
        """Looks after each flight, all in order of time; yields how many are done.

        What was taken before is looked at anew only where it is not how these begin.  InputError as `Tracker.add`.
        """
        if [*map(id, self.flights)] != [*map(id, flights[: len(self.flights)])]:
            self.looks, self.flights, self._tracker = {}, [], Tracker(self.thresholds, self._seed)
        if self._tracker is None:  # it was stored
            self._tracker = Tracker(self.thresholds, self._seed)
            for one in self.flights:
                self._tracker.add(one)
        usable = sum(not one.excluded for one in self.flights)
        for one in flights[len(self.flights) :]:
            self._tracker.add(one)
            self.flights.append(one)
            usable += not one.excluded
            if usable >= LEAST_FLIGHTS:
                self.looks[len(self.flights)] = self._tracker.look()
            yield len(self.flights)

    def copy(self) -> History:
        """As it is now; what follows changes this one alone."""
        other = copy(self)
        other.looks, other.flights = dict(self.looks), list(self.flights)
        return other

    @property
    def last(self) -> Tracked | None:
        """After all of them; None before there are enough."""
        return self.looks.get(len(self.flights))

    def crossed(self, name: str) -> int | None:
        """The number of the flight after which the level of a k had first reached its threshold."""
        threshold = self.thresholds.get(name)
        if threshold is None:
            return None
        sign = 1.0 if threshold > faults.BY_NAME[name].healthy else -1.0
        passed = (n for n, look in self.looks.items() if sign * (look.faults[name].level - threshold) >= 0.0)
        return next(passed, None)

    def came(self, number: int, name: str) -> Came:
        """What came after so many flights; a part that is replaced ends nothing."""
        crossed = self.crossed(name)
        later = None if crossed is None or crossed < number else crossed - number
        return Came(later, len(self.flights) - number)
