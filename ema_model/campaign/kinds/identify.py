"""k1 … k8 of recordings, with their intervals."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa

from ema_model import faults
from ema_model.campaign.kinds.kind import FLAG, NUMBER, NUMBERS, TEXT, TEXTS, Kind
from ema_model.campaign.plan_axes import TaskInputs
from ema_model.errors import InputError, quoted
from ema_model.identification.run import ALGORITHMS, ROBUST, identify
from ema_model.identification.search import Objective
from ema_model.simulation.plant import FITNESSES


@dataclass(frozen=True)
class Settings:
    """As `emaviz identify` has them."""

    algorithm: str = ROBUST
    population: int = 50
    iterations: int = 150
    fitness: str = "filtered"
    circuit: str = "reduced"
    polish: bool = False
    parameters_known: bool = False

    def __post_init__(self) -> None:
        for what, value, known in (
            ("algorithm", self.algorithm, ALGORITHMS),
            ("fitness", self.fitness, FITNESSES),
            ("circuit", self.circuit, ("reduced", "thesis")),
        ):
            if value not in known:
                raise InputError(f"no {what} {quoted(value)!r}; there are {', '.join(known)}")
        if not (2 <= self.population <= 100_000 and 1 <= self.iterations <= 1_000_000):
            raise InputError("population is from 2 to 100000, iterations from 1 to 1000000")


def _run(inputs: TaskInputs, settings: Settings, seed: int) -> dict[str, Any]:
    objective, held = (
        Objective(one, inputs.actuator, circuit=settings.circuit, fitness=settings.fitness) if one else None
        for one in (inputs.fitted, inputs.held)
    )
    assert objective is not None
    answer = identify(
        objective,
        settings.algorithm,
        population=settings.population,
        iterations=settings.iterations,
        seed=seed,
        truth=inputs.truth,
        parameters_known=settings.parameters_known,
        polish=settings.polish,
    )
    sure = answer.uncertainty
    low, high = sure.interval90.T
    return {
        "algorithm": settings.algorithm,
        "population": settings.population,
        "iterations": settings.iterations,
        **{name: float(value) for name, value in zip(faults.NAMES, answer.k)},
        **{f"{name}_low": float(value) for name, value in zip(faults.NAMES, low)},
        **{f"{name}_high": float(value) for name, value in zip(faults.NAMES, high)},
        "error_percent": answer.error_percent,
        "error_wrapped_percent": None
        if inputs.truth is None
        else faults.error_percent(answer.k, inputs.truth, wrap=True),
        "rmse_A": answer.rmse,
        "holdout_rmse_A": None if held is None else float(held(answer.k)[0]),
        "healthy": bool(sure.healthy),
        "alarms": list(sure.alarms),
        "adequate": bool(sure.adequate),
        "ambiguous": ["+".join(group) for group in sure.ambiguous],
        "evaluations": int(answer.evaluations),
        "rmse_history_A": answer.rmse_history.tolist(),
        "error_history_percent": None
        if inputs.truth is None
        else [faults.error_percent(k, inputs.truth) for k in answer.k_history],
        "answer_s": answer.elapsed_s,
    }


def _seconds(settings: Settings) -> float:
    if settings.algorithm == ROBUST:
        return 1.2 + 0.012 * settings.population
    return 1.0 + 2e-4 * settings.population * settings.iterations


def covered(row: dict[str, Any]) -> list[bool]:
    """By k, whether its interval holds the truth; k7 is an angle."""
    inside = []
    for name, true in zip(faults.NAMES, row["k_true"]):
        low, high = row[f"{name}_low"], row[f"{name}_high"]
        off = true - 0.5 * (low + high)
        if name == "k7":
            off -= round(off)
        inside.append(abs(off) <= 0.5 * (high - low) + 1e-12)
    return inside


def _told(rows: list[dict[str, Any]]) -> dict[str, Any]:
    known = [row for row in rows if row["k_true"] is not None]
    told: dict[str, Any] = {}
    if known:
        errors = [row["error_wrapped_percent"] for row in known]
        inside = np.array([covered(row) for row in known], dtype=float)
        inside[[row["k6_low"] <= 0.0 for row in known], 6] = np.nan  # an eccentricity that may be none has no phase
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            share = 100.0 * np.nanmean(inside, axis=0)
        told = {
            "Err % median": f"{np.median(errors):.2f}",
            "95 %": f"{np.percentile(errors, 95):.2f}",
            "worst": f"{max(errors):.2f}",
            "90 % intervals that hold k1 … k8, %": " ".join("–" if np.isnan(s) else f"{s:.0f}" for s in share),
        }
    return told | {
        "healthy": sum(row["healthy"] for row in rows),
        "with alarms": sum(bool(row["alarms"]) for row in rows),
        "does not fit": sum(not row["adequate"] for row in rows),
    }


KIND = Kind(
    title="Identification",
    settings=Settings,
    columns=pa.schema(
        [
            ("algorithm", TEXT),
            ("population", pa.int64()),
            ("iterations", pa.int64()),
            *((name, NUMBER) for name in faults.NAMES),
            *((f"{name}_low", NUMBER) for name in faults.NAMES),
            *((f"{name}_high", NUMBER) for name in faults.NAMES),
            ("error_percent", NUMBER),  # as the thesis has it
            ("error_wrapped_percent", NUMBER),  # k7 as the angle that it is
            ("rmse_A", NUMBER),
            ("holdout_rmse_A", NUMBER),
            ("healthy", FLAG),
            ("alarms", TEXTS),
            ("adequate", FLAG),
            ("ambiguous", TEXTS),
            ("evaluations", pa.int64()),
            ("rmse_history_A", NUMBERS),
            ("error_history_percent", NUMBERS),  # as the thesis has it, of the best so far
        ]
    ),
    run=_run,
    seconds=_seconds,
    told=_told,
)
