"""The mean of a residual in bins of a variable, with an error that neighbouring blocks cannot make too small."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FEWEST = 5  # blocks in a bin


@dataclass(frozen=True, eq=False)
class Binned:
    """All arrays are (bins,); bins with too few blocks are left out."""

    low: Array
    high: Array
    centre: Array  # mean of the variable there
    mean: Array
    error: Array  # standard error of the mean
    floor: Array  # rms of what a perfect model would leave in a block
    block_count: NDArray[np.intp]


def binned(x: Array, residual: Array, sigma: Array, edges: Array) -> Binned:
    """Blocks (n,) in the order of time, over the bins between edges (bins + 1,).

    Blocks that follow each other share their errors: the standard error is taken over visits to a bin, each an
    unbroken stay there, and never less than the blocks' own scatter gives.
    """
    known = np.isfinite(x) & np.isfinite(residual) & np.isfinite(sigma)
    x, residual, sigma = x[known], residual[known], sigma[known]
    count = len(edges) - 1
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, count - 1)
    blocks = np.bincount(place, minlength=count)
    many = np.maximum(blocks, 1)

    def mean(values: Array) -> Array:
        return np.bincount(place, values, count) / many

    means = mean(residual)
    left = residual - means[place]
    visit = np.concatenate([[0], np.cumsum(np.diff(place) != 0)]) if len(place) else np.zeros(0, int)
    sums = np.bincount(visit, left)
    home = place[np.concatenate([[True], np.diff(visit) > 0])] if len(place) else place
    visits = np.bincount(home, minlength=count)
    spread = np.bincount(home, sums**2, count) / np.maximum(1.0 - 1.0 / np.maximum(visits, 2), 0.5)
    # of one visit alone the sum is zero by its own mean: there only the scatter is known
    error = np.sqrt(np.maximum(spread, np.bincount(place, left**2, count))) / many
    used = blocks >= _FEWEST
    return Binned(
        edges[:-1][used],
        edges[1:][used],
        mean(x)[used],
        means[used],
        error[used],
        np.sqrt(mean(sigma**2))[used],
        blocks[used],
    )


def edges_for(variable: str, x: Array) -> Array:
    """Bins that suit a variable: even ones over a turn or over time, else as many blocks in each."""
    x = x[np.isfinite(x)]
    if variable == "motor_angle":
        # fine enough for cogging of many teeth where there are blocks enough
        return np.linspace(0.0, 2.0 * np.pi, int(np.clip(len(x) // 25, 12, 180)) + 1)
    if variable == "time":
        return np.linspace(np.min(x), np.max(x), 41)
    distinct = np.unique(x) if len(x) < 200_000 else np.unique(x[:: len(x) // 100_000])
    if len(distinct) <= 16:  # a load that was set in steps: a bin each
        middle = 0.5 * (distinct[1:] + distinct[:-1])
        return np.concatenate([[distinct[0] - 1e-9], middle, [distinct[-1] + 1e-9]])
    return np.unique(np.quantile(x, np.linspace(0.0, 1.0, 29)))
