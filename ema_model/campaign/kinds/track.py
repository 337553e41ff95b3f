"""Lives that are made: whether a trend is seen, and how the remaining life that is told compares with the true one.

The measures are those of Saxena et al., "Metrics for offline evaluation of prognostic performance", IJPHM 1 (2010),
over the time from the flight in which a remaining life is first told (λ = 0) to the last one (λ = 1): α-λ, whether the
median is within α of the true remaining life at λ; relative accuracy 1 − |r − r*|/r*, and its mean over λ, the
cumulative one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from ema_model.campaign.kinds.kind import NUMBER, NUMBERS, TEXT, TEXTS, Kind
from ema_model.campaign.plan_axes import TaskInputs
from ema_model.errors import InputError, quoted
from ema_model.faults import NAMES
from ema_model.simulated_lives import LAWS, Life, drawn, healthy_life, worn_life
from ema_model.tracking.track import TRACKED, Tracker

ALPHA, LAMBDA = 0.2, 0.5
LAMBDAS = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)  # of the cumulative relative accuracy
_HEALTHY = "healthy"


@dataclass(frozen=True)
class Settings:
    """Which lives."""

    law: str = "linear"
    variation: float = 0.5  # coefficient of variation of a flight's wear

    def __post_init__(self) -> None:
        if self.law not in (*LAWS, _HEALTHY):
            raise InputError(f"no wear law {quoted(self.law)!r}; there are {', '.join((*LAWS, _HEALTHY))}")
        if not 0.05 <= self.variation <= 3.0:
            raise InputError(f"variation is from 0.05 to 3, not {self.variation:g}")


@dataclass(frozen=True)
class Told:
    """A remaining life that was told after a flight, and the true one."""

    flight: int
    true: float
    p05: float
    p50: float
    p95: float

    @property
    def defined(self) -> bool:
        """Whether a remaining life was told at all."""
        return bool(np.isfinite(self.p50))

    @property
    def relative_accuracy(self) -> float:
        """1 − |r − r*|/r*, below 0 where it is off by more than all of it."""
        return 1.0 - abs(self.p50 - self.true) / self.true


def life_of(settings: Settings, seed: int) -> Life:
    """The life of a task."""
    if settings.law == _HEALTHY:
        return healthy_life(seed, variation=settings.variation)
    return worn_life(settings.law, seed, settings.variation)


def places(first: int, last: int, lambdas: Sequence[float]) -> list[int]:
    """The flights (counted from 0) at λ between the first told and the one that crosses."""
    return [min(last - 1, first + round(share * (last - first))) for share in lambdas]


def _run(inputs: TaskInputs, settings: Settings, seed: int) -> dict[str, Any]:
    life = life_of(settings, seed)
    last = life.flights - 1
    tracker = Tracker({life.fault: life.threshold} if life.fault else {}, seed)
    trends: set[str] = set()
    looks: list[int] = []
    told: list[Told] = []
    for i, flight in enumerate(drawn(life)):
        tracker.add(flight)
        trends |= {name for name in TRACKED if tracker.has_trend(name)}
        if not looks and life.fault and tracker.has_trend(life.fault) and (life.repaired or 0) <= i < last:
            looks = places(i, last, (0.0, *LAMBDAS))
        if i in looks:
            told += [_told_after(tracker, life, i)] * looks.count(i)
    jumps = [jump for one in tracker.look().faults.values() for jump in one.jumps]
    counted = [one.relative_accuracy for one in told[1:] if one.defined]
    middle = told[1 + LAMBDAS.index(LAMBDA)] if told else None
    return {
        "fault": life.fault or None,
        "flights": float(life.flights),
        "repaired": None if life.repaired is None else float(life.repaired),
        "trends": sorted(trends),
        "false_trends": sorted(trends - _wearing(life)),
        "jumps": float(len(jumps)),
        "at": [float(one.flight) for one in told],
        "true": [one.true for one in told],
        **{name: [getattr(one, name) for one in told] for name in ("p05", "p50", "p95")},
        "alpha_lambda": None if middle is None else float(middle.defined and middle.relative_accuracy >= 1.0 - ALPHA),
        "cra": float(np.mean(counted)) if counted else None,
    }


def _told_after(tracker: Tracker, life: Life, i: int) -> Told:
    left = tracker.look().faults[life.fault].remaining_flights
    told = (np.nan, np.nan, np.nan) if left is None else (left.p05, left.p50, left.p95)
    return Told(i, float(life.flights - 1 - i), *told)


def _wearing(life: Life) -> set[str]:
    moved = dict(zip(NAMES, np.ptp(life.k, axis=0) > 0.0))
    return {name for name in TRACKED if moved[name]}


def _told(rows: list[dict[str, Any]]) -> dict[str, Any]:
    worn = [row for row in rows if row["fault"]]
    repairs = sum(row["repaired"] is not None for row in rows)
    told: dict[str, Any] = {
        "lives with a false trend": sum(bool(row["false_trends"]) for row in rows),
        "jumps found / repairs": f"{sum(row['jumps'] for row in rows):g} / {repairs}",
    }
    if not worn:
        return told
    seen = [row for row in worn if row["at"]]
    answers = [one for row in seen for one in zip(row["true"], row["p05"], row["p95"])]
    defined = [one for one in answers if np.isfinite(one[1])]
    held = sum(low <= true <= high for true, low, high in defined)
    accuracies = [row["cra"] for row in seen if row["cra"] is not None]
    return told | {
        "wear seen before the end": len(seen),
        "undefined answers": f"{len(answers) - len(defined)} of {len(answers)}",
        "90 % interval holds the life, %": f"{100.0 * held / max(len(defined), 1):.1f}",
        "α-λ": f"{np.mean([row['alpha_lambda'] for row in seen]):.2f}" if seen else "–",
        "cumulative relative accuracy": f"{np.mean(accuracies):.2f}" if accuracies else "–",
        "its median": f"{np.median(accuracies):.2f}" if accuracies else "–",
    }


KIND = Kind(
    title="Lives",
    settings=Settings,
    columns=pa.schema(
        [
            ("fault", TEXT),  # that crosses; null in a healthy life
            ("flights", NUMBER),
            ("repaired", NUMBER),
            ("trends", TEXTS),
            ("false_trends", TEXTS),  # of k that do not wear
            ("jumps", NUMBER),
            ("at", NUMBERS),  # flights, from 0, after which the remaining life was told: λ = 0, and LAMBDAS
            ("true", NUMBERS),  # remaining flights then
            ("p05", NUMBERS),  # NaN where it was undefined
            ("p50", NUMBERS),
            ("p95", NUMBERS),
            ("alpha_lambda", NUMBER),
            ("cra", NUMBER),
        ]
    ),
    run=_run,
    seconds=lambda settings: 1.0,
    told=_told,
    from_recordings=False,
)
