"""What the flights of a unit tell: of each k its level, its trend, its jumps, and the life that remains."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from ema_model.result import Result
from ema_model.tracking.flights import Flight
from ema_model.tracking.remaining import Crossing, Remaining

Array = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Jump:
    """A sudden step of k."""

    flight: Annotated[str, Meta(description="the first one after it")]
    before: Annotated[float, Meta(description="k before it")]
    after: Annotated[float, Meta(description="k after it")]
    replaced: Annotated[bool, Meta(description="whether it goes towards healthy, as after a part was replaced")]


@dataclass(frozen=True)
class LeftOut:
    """A flight that does not count."""

    flight: Annotated[str, Meta(description="its name")]
    reason: Annotated[str, Meta(description="why")]


@dataclass(frozen=True, eq=False)
class FaultTrack:
    """One k over the flights, 0 … 1, less what the unit's base parameters are found to add."""

    name: str
    trend: Annotated[bool, Meta(description="whether there is evidence that it drifts")]
    level: Annotated[float, Meta(description="k after the last flight")]
    # with what the unit's base parameters may add more or less
    level_interval90: Annotated[Interval, Meta(description="the ends of the 90 % interval about level")]
    drift: Annotated[float, Meta(description="of k in a flight; 0 without a trend")]
    drift_interval90: Annotated[Interval, Meta(description="the ends of the 90 % interval about drift")]
    since: Annotated[str | None, Meta(description="the flight after which the evidence for a trend sufficed")]
    threshold: Annotated[float | None, Meta(description="of k, at which the life ends; null: none was given")]
    remaining_flights: Annotated[Remaining | None, Meta(description="null: see reason")]
    reason: Annotated[str | None, Meta(description="why nothing is said of the remaining flights")]
    jumps: Annotated[tuple[Jump, ...], Meta(description="in the order of the flights")]
    log_evidence: Annotated[float, Meta(description="natural logarithm, of a trend against none")]
    k: Annotated[Array, Meta(description="of each flight that counts")]
    sigma: Annotated[Array, Meta(description="1 σ of each k, of the flight's own noise")]
    excluded: Annotated[tuple[LeftOut, ...], Meta(description="flights that do not count; the same for every k")]

    @property
    def crossing_probability(
        self,
    ) -> Annotated[tuple[Crossing, ...], Meta(description="empty where remaining_flights is null")]:
        """Of several numbers of flights."""
        return () if self.remaining_flights is None else self.remaining_flights.crossing


@dataclass(frozen=True, repr=False, eq=False)
class Tracked(Result):
    """What the flights of one unit tell, after the last one."""

    flights: tuple[Flight, ...]
    faults: Annotated[dict[str, FaultTrack], Meta(description="k1 … k8, without the angle k7")]
    correlation: Annotated[  # what trades against what
        Array,
        Meta(
            description="(8, 8), of the errors of k1 … k8 in one flight; in place of k6 and k7 their vector's parts",
            extra={"dimensions": 2},
        ),
    ]
    trusted: Annotated[bool, Meta(description="whether the model fits the last flights")]
    warnings: Annotated[tuple[str, ...], Meta(description="what the answer must be read with")]
    seed: int
    actuator: str = ""  # its name

    @property
    def answer(self) -> Annotated[str, Meta(description="in one sentence")]:
        """The first line of what it says."""
        return self.lines[0]

    @property
    def names(
        self,
    ) -> Annotated[
        list[str],
        Meta(description="their names in order of time, those that do not count too", extra={"as": "flights"}),
    ]:
        """As the flights' files are called."""
        return [one.name for one in self.flights]

    @property
    def usable(self) -> list[Flight]:
        """The flights that count."""
        return [one for one in self.flights if not one.excluded]
