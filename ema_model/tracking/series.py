"""All k over the flights so far: their evidence, and where each jumped, from where on it is judged anew."""

from __future__ import annotations

from math import log

import numpy as np
from numpy.typing import NDArray

from ema_model.tracking.evidence import (
    FALSE_TREND,
    GROWN_BY,
    JUMP_AFTER,
    JUMP_LEAST,
    JUMP_SURE,
    JUMP_WINDOW,
    Evidence,
    jump,
)
from ema_model.tracking.flight import Flight
from ema_model.tracking.sensitivity import growth
from ema_model.tracking.unit import Unit

Array = NDArray[np.float64]


class Series:
    """The components of k, (8,), flight by flight; a place is that of a usable flight."""

    def __init__(self, base: int, one_sided: NDArray[np.bool_], healthy: Array) -> None:
        """one_sided, healthy (8,): whether each only grows, and where it begins."""
        self._healthy, count = healthy, len(healthy)
        self._evidence = Evidence(base, one_sided)
        self.unit = Unit(base, one_sided, healthy)
        self._units: dict[int, Unit] = {}  # before each of the last flights
        self.at: list[float] = []
        self.flights: list[Flight] = []
        self.jumps: list[list[int]] = [[] for _ in range(count)]  # places of the first flight after each
        self.trend_at: list[int | None] = [None] * count  # place of the flight after which the evidence sufficed
        self.log_evidence = np.zeros(count)

    def add(self, at: float, flight: Flight) -> None:
        """One usable flight more, and its number."""
        self.at.append(at)
        self.flights.append(flight)
        self._weigh(len(self.at) - 1, np.arange(len(self._healthy)))
        self._follow(len(self.at) - 1)
        found = [place for i in range(len(self._healthy)) if (place := self._jump(i)) is not None]
        if found:  # some flights after it came
            self.unit = self._units[min(found)].copy()
            for place in range(min(found), len(self.at)):
                self._follow(place)

    def start(self, i: int) -> int:
        """Place of the first flight since the last jump of a component."""
        return self.jumps[i][-1] if self.jumps[i] else 0

    @property
    def noise_factor(self) -> Array:
        """(8,), seen over stated variance."""
        return self._evidence.noise_factor

    def _follow(self, place: int) -> None:
        """What the flight tells of the unit."""
        self._units[place] = self.unit.copy()
        self._units.pop(place - JUMP_WINDOW - JUMP_SURE, None)
        for i, jumps in enumerate(self.jumps):
            if place in jumps:
                self.unit.replaced(i)
        flight, spread = self.flights[place], np.sqrt(self.noise_factor)
        self.unit.add(self.at[place], flight.k, spread[:, None] * flight.own * spread, flight.common)

    def _jump(self, i: int) -> int | None:
        """The place of a jump that is found now."""
        if not self._may_have_jumped(i):
            return None
        first = max(self.start(i), len(self.at) - JUMP_WINDOW - JUMP_SURE)
        last = self.flights[first:]
        base, covariance = self.unit.known()
        common: Array = np.array([one.common[i] for one in last])
        found = jump(
            np.array([one.k[i] for one in last]) - common @ base,
            np.array([one.own[i, i] for one in last]),
            common @ np.linalg.cholesky(covariance),
            float(self._healthy[i]),
        )
        if found is None:
            return None
        self.jumps[i].append(first + found)
        self.trend_at[i], self.log_evidence[i] = None, 0.0
        self._evidence.forget(i)
        for place in range(self.start(i), len(self.at)):
            self._weigh(place, np.array([i]))
        return self.start(i)

    def _at_begin(self, place: int) -> Array:
        """(8,), the share of a flight's sensitivities that was there in each k's first flight since its last jump.

        Told by the flights before it: by its own k̂ the noise of that would stand in the sensitivity as well.
        """
        last = np.stack([one.k for one in self.flights[max(0, place - GROWN_BY) : place]] or [self.flights[0].k])
        begin = [self.start(i) for i in range(len(self._healthy))]
        first = np.array([self.flights[at].k[i] for i, at in enumerate(begin)])
        before = [last[-(place - at) :, i].mean() if place > at else first[i] for i, at in enumerate(begin)]
        return growth(first) / growth(before)

    def _may_have_jumped(self, i: int) -> bool:
        """Whether the last flights stand far enough from those before them; asked of all, so it must be quick."""
        return any(self._stands_off(i, after) for after in (JUMP_AFTER, JUMP_SURE))

    def _stands_off(self, i: int, after: int) -> bool:
        last = [float(one.k[i]) for one in self.flights[-2 * after :]]
        low, high = sorted(last[:after]), sorted(last[after:])
        return len(last) == 2 * after and abs(high[after // 2] - low[after // 2]) > JUMP_LEAST

    def _weigh(self, place: int, which: NDArray[np.int64]) -> None:
        flight = self.flights[place]
        own = np.diagonal(flight.own)
        common = flight.common * self._at_begin(place)[:, None]
        self.log_evidence[which] = self._evidence.add(self.at[place], flight.k, own, common, which)
        for i in which:
            # After each jump half of the probability of a false trend is spent, so that all together stay below it.
            needed = log(len(self._healthy) / FALSE_TREND) + (len(self.jumps[i]) + 1) * log(2.0)
            if self.trend_at[i] is None and self.log_evidence[i] >= needed:
                self.trend_at[i] = place
