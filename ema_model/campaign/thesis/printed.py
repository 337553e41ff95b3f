"""What the thesis prints: the rows of tables 5.1–5.36, their means (5.11, 5.23, 5.35), the coefficients (5.39–5.43)."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ema_model.campaign.thesis.cases import ALGORITHMS, case_of
from ema_model.faults import NAMES
from ema_model.files.shipped import shipped_folder

_OURS = {thesis: ours for ours, thesis in ALGORITHMS.items()}


@dataclass(frozen=True)
class PrintedRow:
    """One run of a table."""

    table: str
    algorithm: str  # by our name
    case: str
    k: NDArray[np.float64]  # (8,)
    truth: NDArray[np.float64]  # (8,)
    error_percent: float


@dataclass(frozen=True)
class PrintedMean:
    """Of ten runs."""

    error_percent: float
    time_s: float


@dataclass(frozen=True)
class PrintedCoefficient:
    """Of a fault, low and high together; of `single`, the five of them."""

    time_s: float
    error_percent: float
    coefficient_percent: float


@cache
def rows() -> tuple[PrintedRow, ...]:
    """All 330 of them."""
    found = []
    for row in _read("rows"):
        k, truth = (np.array([float(row[f"{name}{which}"]) for name in NAMES]) for which in ("", "_true"))
        case = case_of(truth)
        assert case is not None
        found.append(PrintedRow(row["table"], _OURS[row["algorithm"]], case.name, k, truth, float(row["err_percent"])))
    return tuple(found)


@cache
def means() -> dict[tuple[str, str], PrintedMean]:
    """By case and algorithm."""
    return {
        (row["case"], _OURS[row["algorithm"]]): PrintedMean(float(row["err_percent"]), float(row["time_s"]))
        for row in _read("means")
    }


@cache
def coefficients() -> dict[tuple[str, str], PrintedCoefficient]:
    """By fault (also `single` and `multiple`) and algorithm."""
    return {
        (row["fault"], _OURS[row["algorithm"]]): PrintedCoefficient(
            float(row["time_s"]), float(row["err_percent"]), float(row["coefficient_percent"])
        )
        for row in _read("coefficients")
    }


def _read(name: str) -> Iterator[dict[str, str]]:
    with (shipped_folder("thesis") / f"{name}.csv").open(newline="", encoding="utf-8") as file:
        yield from csv.DictReader(file)
