"""The JSON form of what the flights of a unit tell: what each field means, and where it is from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NotRequired, TypedDict

from msgspec import Meta

from ema_model.quantities.numbers import IntervalJson
from ema_model.tracking.result import FaultTrack, Tracked
from ema_model.tracking.words import answer


class RemainingJson(TypedDict):
    """Flights until k first crosses its threshold, from the last flight on."""

    p05: Annotated[float, Meta(description="flights; 5 % of such units cross earlier")]
    p50: Annotated[float, Meta(description="flights; half of such units cross earlier")]
    p95: Annotated[float, Meta(description="flights; 95 % of such units cross earlier")]


class CrossingJson(TypedDict):
    """How likely k crosses its threshold soon."""

    flights: Annotated[int, Meta(description="within so many from the last one on")]
    probability: Annotated[float, Meta(description="0 … 1")]


class JumpJson(TypedDict):
    """A sudden step of k."""

    flight: Annotated[str, Meta(description="the first one after it")]
    before: Annotated[float, Meta(description="k before it")]
    after: Annotated[float, Meta(description="k after it")]
    replaced: Annotated[bool, Meta(description="whether it goes towards healthy, as after a part was replaced")]


class LeftOutJson(TypedDict):
    """A flight that does not count."""

    flight: Annotated[str, Meta(description="its name")]
    reason: Annotated[str, Meta(description="why")]


class FaultTrackJson(TypedDict):
    """One k over the flights, 0 … 1."""

    trend: Annotated[bool, Meta(description="whether there is evidence that it drifts")]
    level: Annotated[float, Meta(description="k after the last flight")]
    level_interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about level")]
    drift: Annotated[float, Meta(description="of k in a flight; 0 without a trend")]
    drift_interval90: Annotated[IntervalJson, Meta(description="the ends of the 90 % interval about drift")]
    since: Annotated[str | None, Meta(description="the flight after which the evidence for a trend sufficed")]
    threshold: Annotated[float | None, Meta(description="of k, at which the life ends; null: none was given")]
    remaining_flights: Annotated[RemainingJson | None, Meta(description="null: see reason")]
    reason: Annotated[str | None, Meta(description="why nothing is said of the remaining flights")]
    crossing_probability: Annotated[list[CrossingJson], Meta(description="empty where remaining_flights is null")]
    jumps: Annotated[list[JumpJson], Meta(description="in the order of the flights")]
    log_evidence: Annotated[float, Meta(description="natural logarithm, of a trend against none")]
    k: Annotated[list[float], Meta(description="of each flight that counts")]
    sigma: Annotated[list[float], Meta(description="1 σ of each k, of the flight's own noise")]
    excluded: Annotated[list[LeftOutJson], Meta(description="flights that do not count; the same for every k")]


class TrackedJson(TypedDict):
    """What the flights of one unit tell."""

    answer: Annotated[str, Meta(description="in one sentence")]
    trusted: Annotated[bool, Meta(description="whether the model fits the last flights")]
    warnings: Annotated[list[str], Meta(description="what the answer must be read with")]
    flights: Annotated[list[str], Meta(description="their names in order of time, those that do not count too")]
    correlation: Annotated[
        list[list[float]],
        Meta(description="(8, 8), of the errors of k1 … k8 in one flight; in place of k6 and k7 their vector's parts"),
    ]
    faults: Annotated[dict[str, FaultTrackJson], Meta(description="k1 … k8, without the angle k7")]
    interrupted: NotRequired[Annotated[bool, Meta(description="true where not all flights were identified")]]
    flights_identified: NotRequired[Annotated[int, Meta(description="how many were, before the interrupt")]]
    flights_named: NotRequired[Annotated[int, Meta(description="how many there are")]]


def as_dict(result: Tracked) -> TrackedJson:
    """Plain values only."""
    left_out: list[LeftOutJson] = [
        {"flight": one.name, "reason": one.excluded} for one in result.flights if one.excluded
    ]
    return {
        "answer": answer(result),
        "trusted": result.trusted,
        "warnings": list(result.warnings),
        "flights": [one.name for one in result.flights],
        "correlation": result.correlation.tolist(),
        "faults": {name: _fault(one, left_out) for name, one in result.faults.items()},
    }


def _fault(one: FaultTrack, left_out: Sequence[LeftOutJson]) -> FaultTrackJson:
    left = one.remaining
    return {
        "trend": one.trend,
        "level": one.level,
        "level_interval90": list(one.level90),
        "drift": one.drift,
        "drift_interval90": list(one.drift90),
        "since": one.since or None,
        "threshold": one.threshold,
        "remaining_flights": None if left is None else {"p05": left.p05, "p50": left.p50, "p95": left.p95},
        "reason": one.reason or None,
        "crossing_probability": []
        if left is None
        else [{"flights": n, "probability": probability} for n, probability in left.crossing],
        "jumps": [
            {"flight": jump.flight, "before": jump.before, "after": jump.after, "replaced": jump.towards_healthy}
            for jump in one.jumps
        ],
        "log_evidence": one.evidence,
        "k": one.k.tolist(),
        "sigma": one.sigma.tolist(),
        "excluded": list(left_out),
    }
