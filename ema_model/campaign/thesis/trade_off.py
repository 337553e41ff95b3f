"""What the thesis leaves to future work: how much search an answer takes, and when to stop it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ema_model.campaign.thesis.cases import ALGORITHMS, Case, case_of
from ema_model.campaign.thesis.scores import Rows

STOP_A = 1e-3  # of RMSE, at which the thesis would end a search
_AT_ITS_END = 1.01  # of the last RMSE: from there on a search gains nothing that counts


@dataclass(frozen=True)
class Point:
    """Searches of one algorithm with one population and so many iterations."""

    case: Case
    algorithm: str
    population: int
    iterations: int
    evaluations: float
    error_percent: float  # median, T 5.2
    low_percent: float  # 5 and 95 % of them
    high_percent: float
    count: int


@dataclass(frozen=True)
class Stop:
    """When searches of an algorithm could have ended."""

    algorithm: str
    count: int
    reached: int  # of them, the thesis's RMSE
    least_A: float  # the lowest RMSE of any
    settled: float  # median: the iteration from which the RMSE is within 1 % of its last
    settled_high: float  # 95 % of them have settled by there
    error_settled_percent: float  # median Err there
    error_percent: float  # and at the end


def points(rows: Rows) -> list[Point]:
    """By case, algorithm, population and iterations."""
    groups: dict[tuple[str, str, int, int], list] = {}
    for row in rows:
        case = case_of(row["k_true"])
        if case is not None:
            key = (case.name, row["algorithm"], row["population"], row["iterations"])
            groups.setdefault(key, []).append((case, row))
    found = []
    for (_, algorithm, population, iterations), its in sorted(groups.items()):
        errors = [row["error_percent"] for _, row in its]
        low, middle, high = np.percentile(errors, [5, 50, 95]).tolist()
        evaluations = float(np.mean([row["evaluations"] for _, row in its]))
        found.append(Point(its[0][0], algorithm, population, iterations, evaluations, middle, low, high, len(its)))
    return found


def stops(rows: Rows, algorithms: Sequence[str] = tuple(ALGORITHMS)) -> list[Stop]:
    """By algorithm, over all its searches; one without any is left out."""
    found = []
    for name in algorithms:
        own = [row for row in rows if row["algorithm"] == name and row["rmse_history_A"]]
        if not own:
            continue
        settled = [settled_at(row["rmse_history_A"]) for row in own]
        errors = [row["error_history_percent"][at] for row, at in zip(own, settled)]
        least = [min(row["rmse_history_A"]) for row in own]
        found.append(
            Stop(
                algorithm=name,
                count=len(own),
                reached=sum(one <= STOP_A for one in least),
                least_A=min(least),
                settled=float(np.median(settled)),
                settled_high=float(np.percentile(settled, 95)),
                error_settled_percent=float(np.median(errors)),
                error_percent=float(np.median([row["error_percent"] for row in own])),
            )
        )
    return found


def settled_at(rmse_history_A: Sequence[float]) -> int:
    """The first iteration whose best RMSE is within 1 % of the last one."""
    history = np.asarray(rmse_history_A, dtype=float)
    return int(np.argmax(history <= _AT_ITS_END * history[-1]))
