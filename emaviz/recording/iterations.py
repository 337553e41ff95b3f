"""Iterations of an identification, gathered so that they are sent a column at a time and not a row."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from emaviz.recording.style import ITERATION, K_NAMES, algorithm_path

Array = NDArray[np.float64]
Column = tuple[str, list[rr.TimeColumn], Any]


class IterationBuffer:
    """Rows of one algorithm that are not yet sent.  Not thread safe."""

    def __init__(self, algorithm: str, widest: int = 0) -> None:
        """widest: of the populations that were sent before."""
        self.widest = widest
        self._path = algorithm_path(algorithm)
        self._index: list[int] = []
        self._rmse: list[float] = []
        self._best: list[Array] = []
        self._population: list[tuple[int, Array]] = []
        self._population_rmse: list[tuple[int, Array]] = []

    def __len__(self) -> int:
        return len(self._index)

    def add(
        self,
        index: int,
        rmse: float,
        best: ArrayLike,
        population: ArrayLike | None,
        population_rmse: ArrayLike | None,
    ) -> None:
        """Keeps copies: best (8,), population (N, 8), population_rmse (N,).  ValueError on another shape."""
        best = np.array(best, dtype=float)
        if best.shape != (8,):
            raise ValueError(f"best k must have the shape (8,), not {best.shape}")
        row, error = int(index), float(rmse)
        if population is not None:
            individuals = np.array(population, dtype=float)
            if individuals.ndim != 2 or individuals.shape[1] != 8:
                raise ValueError(f"the population must have the shape (N, 8), not {individuals.shape}")
            self._population.append((row, individuals))
            self.widest = max(self.widest, len(individuals))
        if population_rmse is not None:
            self._population_rmse.append((row, np.array(population_rmse, dtype=float).reshape(-1)))
        self._index.append(row)
        self._rmse.append(error)
        self._best.append(best)

    def columns(self, truth: Array | None) -> Iterator[Column]:
        """Path, times and columns for `send_columns`: all rows of an entity at once.

        truth (8,) is repeated along the iterations, since a plot cannot draw what has no time.
        """
        index, rmse, best = self._index, np.array(self._rmse), np.array(self._best)
        time = _time(index)
        yield f"{self._path}/rmse", time, rr.Scalars.columns(scalars=rmse)
        yield f"{self._path}/log10_rmse", time, rr.Scalars.columns(scalars=log10(rmse))
        for j, k in enumerate(K_NAMES):
            yield f"{self._path}/best/{k}", time, rr.Scalars.columns(scalars=best[:, j])
            if truth is not None:
                yield f"{self._path}/truth/{k}", time, rr.Scalars.columns(scalars=np.full(len(index), truth[j]))
        if self._population:
            for j, k in enumerate(K_NAMES):
                rows = [(i, _padded(individuals[:, j], self.widest)) for i, individuals in self._population]
                yield f"{self._path}/population/{k}", *_ragged(rows)
        if self._population_rmse:
            yield f"{self._path}/population/rmse", *_ragged(self._population_rmse)


def log10(errors: Array) -> Array:
    """For plots, which have no logarithmic axis; NaN where there is none."""
    return np.log10(np.where(np.isfinite(errors) & (errors > 0.0), errors, np.nan))


def _time(index: list[int]) -> list[rr.TimeColumn]:
    return [rr.TimeColumn(ITERATION, sequence=np.array(index, dtype=np.int64))]


def _padded(values: Array, count: int) -> Array:
    """With no numbers behind: the viewer complains of a plot whose rows become shorter."""
    return np.pad(values, (0, count - len(values)), constant_values=np.nan)


def _ragged(rows: list[tuple[int, Array]]) -> tuple[list[rr.TimeColumn], Any]:
    """One row per iteration, of as many values as the population then had."""
    values = np.concatenate([values for _, values in rows])
    lengths = [len(values) for _, values in rows]
    return _time([i for i, _ in rows]), rr.Scalars.columns(scalars=values).partition(lengths)
