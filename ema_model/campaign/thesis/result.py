"""The thesis's evaluation, as far as a campaign's folder has it."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any, TypedDict

import numpy as np
from msgspec import Meta

from ema_model.campaign.store import Store
from ema_model.campaign.thesis.cases import ALGORITHMS
from ema_model.campaign.thesis.scores import Coefficient, Missed, Score, coefficients, missed, scores
from ema_model.campaign.thesis.trade_off import Point, Stop, points, stops
from ema_model.identification.run import ROBUST

AS_THE_THESIS, FILTERED, TRADE_OFF = "thesis", "filtered", "trade_off"  # groups of the plan; robust has its own
TARGET_PERCENT = 0.05  # mean Err of the robust identification over all eleven


class ThesisRowJson(TypedDict):
    """An algorithm on one faulty actuator: means and deviations over its runs; null where there is no run."""

    case: Annotated[str, Meta(description="the actuator's name")]
    algorithm: Annotated[str, Meta(description="ssa, hba, do or robust")]
    runs: Annotated[int, Meta(description="how many")]
    error_percent: Annotated[float | None, Meta(description="Err %, mean")]
    error_deviation_percent: Annotated[float | None, Meta(description="Err %, standard deviation")]
    error_wrapped_percent: Annotated[float | None, Meta(description="Err %, mean, with k7 as the angle that it is")]
    time_s: Annotated[float | None, Meta(description="s of one run, mean")]
    time_deviation_s: Annotated[float | None, Meta(description="s, standard deviation")]
    thesis_error_percent: Annotated[float | None, Meta(description="Err % that the thesis prints; null: none")]
    thesis_error_deviation_percent: Annotated[float | None, Meta(description="its standard deviation, as printed")]
    thesis_time_s: Annotated[float | None, Meta(description="s that the thesis prints")]


class CoefficientJson(TypedDict):
    """The performance coefficient of an algorithm (T 5.4)."""

    fault: Annotated[str, Meta(description="the kind of fault")]
    algorithm: Annotated[str, Meta(description="ssa, hba or do")]
    coefficient: Annotated[float, Meta(description="%, ours")]
    thesis: Annotated[float | None, Meta(description="%, as the thesis prints it")]


class EvaluationJson(TypedDict):
    """The thesis's evaluation, computed anew, beside its printed numbers."""

    mean_error_percent: Annotated[
        dict[str, float | None], Meta(description="Err %, mean over the actuators, by algorithm")
    ]
    rows: Annotated[list[ThesisRowJson], Meta(description="of each actuator and algorithm")]
    performance_coefficient_percent: Annotated[list[CoefficientJson], Meta(description="of each fault and algorithm")]


class Evaluation:
    """The rows of a campaign of the plan `thesis`, and what they say together."""

    def __init__(self, store: Store) -> None:
        self.store = store

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """Identifications that have an answer."""
        every = self.store.table("identify", how=True).to_pylist()
        return [row for row in every if row["error"] is None and row["k_true"] is not None]

    def of(self, group: str) -> list[dict[str, Any]]:
        """The rows of a group."""
        return [row for row in self.rows if row["group"] == group]

    @cached_property
    def scores(self) -> list[Score]:
        """The thesis's algorithms at its settings, and the robust identification."""
        return scores(self.of(AS_THE_THESIS) + self.of(ROBUST))

    @cached_property
    def missed(self) -> list[Missed]:
        """How often each ended in a minimum that is not the fault's."""
        return missed(self.of(AS_THE_THESIS) + self.of(ROBUST))

    @cached_property
    def filtered(self) -> list[Score]:
        """The same algorithms, on means over 0.5 ms."""
        return scores(self.of(FILTERED), tuple(ALGORITHMS))

    @cached_property
    def coefficients(self) -> list[Coefficient]:
        """T 5.39–5.43."""
        return coefficients(self.scores)

    @cached_property
    def points(self) -> list[Point]:
        """Error against population and iterations."""
        return points(self.of(TRADE_OFF))

    @cached_property
    def stops(self) -> list[Stop]:
        """When its searches could have ended."""
        return stops(self.of(AS_THE_THESIS))

    def mean_error(self, algorithm: str) -> float:
        """Err %, the mean over the actuators of their means; NaN without a run."""
        return _mean([one.error.mean for one in self._computed(algorithm)])

    def printed_mean_error(self, algorithm: str) -> float:
        """The thesis's, over the same actuators; NaN for our own."""
        return _mean([one.printed.mean for one in self._computed(algorithm) if one.printed is not None])

    def fitness_compared(self) -> dict[str, tuple[float, float, float]]:
        """By algorithm: mean Err % of the thesis, of ours at its settings, and of `filtered`, on the same actuators."""
        found = {}
        for name in ALGORITHMS:
            ours = {one.case.name: one for one in self._computed(name)}
            own = [one for one in self.filtered if one.algorithm == name and one.error.count]
            both = [(ours[one.case.name], one) for one in own if one.case.name in ours]
            if both:
                printed = [a.printed.mean for a, _ in both if a.printed is not None]
                found[name] = (
                    _mean(printed),
                    _mean([a.error.mean for a, _ in both]),
                    _mean([b.error.mean for _, b in both]),
                )
        return found

    def _computed(self, algorithm: str) -> list[Score]:
        return [one for one in self.scores if one.algorithm == algorithm and one.error.count]

    def as_dict(self) -> EvaluationJson:
        """For JSON; what there is no run of is null."""
        return {
            "mean_error_percent": {
                name: _number(self.mean_error(name)) for name in dict.fromkeys(one.algorithm for one in self.scores)
            },
            "rows": [
                {
                    "case": one.case.name,
                    "algorithm": one.algorithm,
                    "runs": one.error.count,
                    "error_percent": _number(one.error.mean),
                    "error_deviation_percent": _number(one.error.deviation),
                    "error_wrapped_percent": _number(one.wrapped.mean),
                    "time_s": _number(one.time_s.mean),
                    "time_deviation_s": _number(one.time_s.deviation),
                    "thesis_error_percent": None if one.printed is None else one.printed.mean,
                    "thesis_error_deviation_percent": None if one.printed is None else one.printed.deviation,
                    "thesis_time_s": one.printed_time_s,
                }
                for one in self.scores
            ],
            "performance_coefficient_percent": [
                {
                    "fault": one.fault,
                    "algorithm": one.algorithm,
                    "coefficient": one.percent,
                    "thesis": None if one.printed is None else one.printed.coefficient_percent,
                }
                for one in self.coefficients
            ],
        }


def _mean(values: list[float]) -> float:
    return float(np.mean(values)) if values else float("nan")


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
