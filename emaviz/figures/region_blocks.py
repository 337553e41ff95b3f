"""Where a region lies in one recording: its blocks, and the stretches of time that they fill."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.result import Comparison, Region


def of_recording(comparison: Comparison, recording: int) -> NDArray[np.intp]:
    """Places in the joined residuals of one recording's blocks."""
    return np.flatnonzero(comparison.residuals.recording == recording)


def within(time_s: NDArray[np.float64], window_s: tuple[float, float] | None) -> NDArray[np.bool_]:
    """Which blocks (n,) lie in a window of time; all where there is none."""
    if window_s is None:
        return np.ones(len(time_s), dtype=bool)
    return (time_s >= window_s[0]) & (time_s <= window_s[1])


def time_ranges(comparison: Comparison, region: Region, recording: int) -> list[tuple[float, float]]:
    """From–to, s, of each unbroken stretch of the region's blocks in a recording."""
    residuals = comparison.residuals
    places = of_recording(comparison, recording)
    inside = region.blocks[places]
    time, run = residuals.time_s[places], residuals.run[places]
    edges = np.flatnonzero((np.diff(inside) != 0) | (np.diff(run) != 0)) + 1
    half = 0.5 * residuals.block_s
    parts = np.split(np.arange(len(places)), edges)
    return [
        (float(time[part[0]]) - half, float(time[part[-1]]) + half) for part in parts if len(part) and inside[part[0]]
    ]
