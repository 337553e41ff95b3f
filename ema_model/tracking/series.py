"""One k over the flights so far: its evidence, and where it jumped, from where on it is judged anew."""

from __future__ import annotations

from math import log

import numpy as np
from numpy.typing import NDArray

from ema_model.tracking.criteria import FALSE_TREND, JUMP_AFTER, JUMP_WINDOW
from ema_model.tracking.evidence import Evidence
from ema_model.tracking.jumps import jump

Array = NDArray[np.float64]

COMPONENTS = 8  # among which the probability of a false trend is shared


class Series:
    """Of one component of k, flight by flight."""

    def __init__(self, base: int, one_sided: bool, healthy: float) -> None:
        self._base, self._one_sided, self.healthy = base, one_sided, healthy
        self.at: list[float] = []
        self.k: list[float] = []
        self.variance: list[float] = []
        self.common: list[Array] = []
        self.jumps: list[int] = []  # places of the first flight after each
        self.trend_at: int | None = None  # place of the flight after which the evidence sufficed
        self.log_evidence = 0.0
        self._evidence = Evidence(base, one_sided)

    def add(self, at: float, k: float, variance: float, common: Array) -> None:
        """One usable flight more."""
        for kept, value in ((self.at, at), (self.k, k), (self.variance, variance), (self.common, common)):
            kept.append(value)  # type: ignore[arg-type]
        self._weigh(len(self.at) - 1)
        begin = self.start
        last = slice(max(begin, len(self.at) - JUMP_WINDOW - JUMP_AFTER), None)
        found = jump(np.array(self.k[last]), np.array(self.variance[last]), np.array(self.common[last]), self.healthy)
        if found is not None:
            self.jumps.append(last.start + found)
            self.trend_at, self.log_evidence = None, 0.0
            self._evidence = Evidence(self._base, self._one_sided)
            for place in range(self.start, len(self.at)):
                self._weigh(place)

    @property
    def start(self) -> int:
        """Place of the first flight since the last jump."""
        return self.jumps[-1] if self.jumps else 0

    @property
    def noise_factor(self) -> float:
        """Seen over stated variance."""
        return self._evidence.noise_factor

    def _weigh(self, place: int) -> None:
        self.log_evidence = self._evidence.add(self.at[place], self.k[place], self.variance[place], self.common[place])
        # After each jump half of the probability of a false trend is spent, so that all together stay below it.
        needed = log(COMPONENTS / FALSE_TREND) + (len(self.jumps) + 1) * log(2.0)
        if self.trend_at is None and self.log_evidence >= needed:
            self.trend_at = place
