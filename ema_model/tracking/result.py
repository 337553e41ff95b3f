"""What the flights of a unit tell: of each k its level, its trend, its jumps, and the life that remains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.text import InWords
from ema_model.tracking.flights import Flight
from ema_model.tracking.remaining import Remaining

Array = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Jump:
    """A sudden step of k."""

    flight: str  # the first one after it
    before: float
    after: float
    towards_healthy: bool  # as after a part was replaced


@dataclass(frozen=True, eq=False)
class FaultTrack:
    """One k over the flights, less what the unit's base parameters are found to add; every interval holds 90 %."""

    name: str
    trend: bool
    level: float  # today, within k's range
    level90: Interval  # with what the unit's base parameters may add more or less
    drift: float  # of k in a flight; 0 without a trend
    drift90: Interval
    since: str  # the flight after which the evidence for a trend sufficed; empty without one
    threshold: float | None
    remaining: Remaining | None
    reason: str  # why nothing is said of the remaining life; empty where it is
    jumps: tuple[Jump, ...]
    evidence: float  # natural logarithm, of a trend against none
    k: Array  # (usable flights,), as measured but for the unit
    sigma: Array  # (usable flights,), of their own noise


@dataclass(frozen=True, repr=False, eq=False)
class Tracked(InWords):
    """The answer after the last flight."""

    flights: tuple[Flight, ...]
    faults: dict[str, FaultTrack]  # k1 … k8 without the angle k7
    correlation: Array  # (8, 8), of the flights' own noise: what trades against what, the eccentricity as a vector
    trusted: bool  # whether the model fits the last flights
    warnings: tuple[str, ...]
    seed: int

    @property
    def usable(self) -> list[Flight]:
        """The flights that count."""
        return [one for one in self.flights if not one.excluded]
