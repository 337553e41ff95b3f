"""Fewer points with the same envelope, for charts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def envelope(x: Array, series: Sequence[Array], points: int = 1000) -> tuple[Array, ...]:
    """x and the series with at most `points` samples: each bucket's minimum and maximum, in their order.

    All arrays are (n,); the result's are equally long.  Short ones come back as they are.
    """
    n = len(x)
    buckets = points // 2
    if n <= 2 * buckets:
        return (x, *series)
    edges = np.linspace(0, n, buckets + 1).astype(int)
    low = edges[:-1]
    places = np.stack([low, (low + edges[1:]) // 2], axis=1).ravel()
    out = [x[places]]
    for y in series:
        least, most = np.minimum.reduceat(y, low), np.maximum.reduceat(y, low)
        rising = y[low] <= y[edges[1:] - 1]
        out.append(np.stack([np.where(rising, least, most), np.where(rising, most, least)], axis=1).ravel())
    return tuple(out)
