"""A fault and an algorithm: the thesis's ten runs beside ours, and the performance coefficients that follow."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ema_model.campaign.thesis import printed
from ema_model.campaign.thesis.cases import ALGORITHMS, CASES, EVERY, FAULTS, MULTIPLE, Case, case_of
from ema_model.faults import performance_coefficient

MISSED_PERCENT = 5.0  # of Err: "healthy" has 9.8 % of a single low fault, and 6.2 % of several at once
SINGLE = "single"  # the five faults that stand alone, together
Rows = Sequence[Mapping[str, Any]]  # of a campaign's identifications, without errors


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation of some runs; NaN where there are too few."""

    mean: float
    deviation: float
    count: int

    @classmethod
    def of(cls, values: Sequence[float]) -> Spread:
        """The deviation is a sample's (n − 1)."""
        n = len(values)
        return cls(
            float(np.mean(values)) if n else float("nan"), float(np.std(values, ddof=1)) if n > 1 else float("nan"), n
        )


@dataclass(frozen=True)
class Score:
    """One algorithm on one of the eleven actuators.  Errors in %, times in s; the thesis's are None for our own."""

    case: Case
    algorithm: str
    printed: Spread | None  # of Err (T 5.2)
    printed_time_s: float | None
    printed_k: float | None  # median of the k that tells the fault
    error: Spread  # as T 5.2 is printed
    wrapped: Spread  # with k7 as the angle that it is
    time_s: Spread
    k: float  # median

    @property
    def difference(self) -> float | None:
        """Ours − the thesis's, in % of Err; None where one of them is missing."""
        return self.error.mean - self.printed.mean if self.printed is not None and self.error.count else None


@dataclass(frozen=True)
class Missed:
    """Runs of an algorithm that ended in another minimum than the fault's; Err in %, as T 5.2 is printed."""

    algorithm: str
    count: int
    missed: int
    error_of_others: float  # mean; what is left is the model's bias, and what the search leaves open
    printed_count: int
    printed_missed: int
    printed_error_of_others: float


@dataclass(frozen=True)
class Coefficient:
    """T 5.4 of an algorithm: on a fault (low and high together), on `single`, or on `multiple`."""

    fault: str
    algorithm: str
    error_percent: float
    time_s: float
    percent: float
    printed: printed.PrintedCoefficient | None


def scores(rows: Rows, algorithms: Sequence[str] = EVERY) -> list[Score]:
    """In the thesis's order; an algorithm without any run on a case, in the thesis or here, is left out of it."""
    found = [_score(case, name, rows) for case in CASES for name in algorithms]
    return [one for one in found if one.error.count or one.printed is not None]


def _score(case: Case, algorithm: str, rows: Rows) -> Score:
    own = [row for row in rows if row["algorithm"] == algorithm and case_of(row["k_true"]) is case]
    theirs = [row for row in printed.rows() if (row.case, row.algorithm) == (case.name, algorithm)]
    at = int(case.main[1:]) - 1
    mean = printed.means().get((case.name, algorithm))
    return Score(
        case=case,
        algorithm=algorithm,
        printed=Spread.of([row.error_percent for row in theirs]) if theirs else None,
        printed_time_s=None if mean is None else mean.time_s,
        printed_k=float(np.median([row.k[at] for row in theirs])) if theirs else None,
        error=Spread.of([row["error_percent"] for row in own]),
        wrapped=Spread.of([row["error_wrapped_percent"] for row in own]),
        time_s=Spread.of([row["answer_s"] for row in own]),
        k=float(np.median([row[case.main] for row in own])) if own else float("nan"),
    )


def missed(rows: Rows, algorithms: Sequence[str] = EVERY) -> list[Missed]:
    """By algorithm, over all actuators; one without a run is left out."""
    found = []
    for name in algorithms:
        ours = [row["error_percent"] for row in rows if row["algorithm"] == name and case_of(row["k_true"]) is not None]
        theirs = [row.error_percent for row in printed.rows() if row.algorithm == name]
        if ours:
            found.append(Missed(name, *_apart(ours), *_apart(theirs)))
    return found


def _apart(errors: Sequence[float]) -> tuple[int, int, float]:
    others = [one for one in errors if one <= MISSED_PERCENT]
    return len(errors), len(errors) - len(others), float(np.mean(others)) if others else float("nan")


def coefficients(found: Sequence[Score], algorithms: Sequence[str] = tuple(ALGORITHMS)) -> list[Coefficient]:
    """T 5.4 as the thesis has it: errors and times of low and high are averaged, then compared between algorithms.

    The coefficient of `single` is the mean of the five faults' (T 5.42).  A fault that not every algorithm has been
    run on is left out, and so is `single` then.
    """
    made: list[Coefficient] = []
    for fault in (*FAULTS, MULTIPLE):
        made += _of_fault(fault, found, algorithms)
    if len({one.fault for one in made} - {MULTIPLE}) == len(FAULTS):
        alone = [one for one in made if one.fault != MULTIPLE]
        for name in algorithms:
            own = [one for one in alone if one.algorithm == name]
            error, time, percent = (
                float(np.mean([getattr(one, what) for one in own])) for what in ("error_percent", "time_s", "percent")
            )
            made.append(Coefficient(SINGLE, name, error, time, percent, _printed(SINGLE, name)))
    return made


def _of_fault(fault: str, found: Sequence[Score], algorithms: Sequence[str]) -> list[Coefficient]:
    cases = [case for case in CASES if case.fault == fault]
    own = {
        name: [one for one in found if one.case in cases and one.algorithm == name and one.error.count]
        for name in algorithms
    }
    if any(len(its) < len(cases) for its in own.values()):
        return []
    errors = [float(np.mean([one.error.mean for one in its])) for its in own.values()]
    times = [float(np.mean([one.time_s.mean for one in its])) for its in own.values()]
    percents = performance_coefficient(errors, times)
    return [
        Coefficient(fault, name, error, time, float(percent), _printed(fault, name))
        for name, error, time, percent in zip(own, errors, times, percents)
    ]


def _printed(fault: str, algorithm: str) -> printed.PrintedCoefficient | None:
    return printed.coefficients().get((fault, algorithm))
