"""Families of curves of one variable, from the simplest to the finest that data can carry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

HIGHEST_ORDER = 96  # per revolution
_KNOTS = (6, 16)
LEAST_SEEN = 0.5  # of an order's amplitude that blocks must keep
LEAST_CYCLES = 1.5  # of an order within the angles covered; fewer are a smooth curve of the position


def families(values: Array) -> list[Array]:
    """Columns of a straight line, and of piecewise linear curves with more and more knots: (n, columns) each."""
    centre, scale = float(np.mean(values)), float(np.std(values)) or 1.0
    found = [np.column_stack([np.ones_like(values), (values - centre) / scale])]
    for count in _KNOTS:
        knots = quantile_knots(values, count)
        if len(knots) >= 4:
            found.append(hats(values, knots))
    return found


def quantile_knots(values: Array, count: int) -> Array:
    """Knots with as many values between any two, half of them evenly spaced so that rare extremes are seen."""
    by_rank = np.quantile(values, np.linspace(0.0, 1.0, count))
    evenly = np.linspace(values.min(), values.max(), count)
    knots = np.unique(0.5 * (by_rank + evenly))
    least = 1e-3 * (knots[-1] - knots[0])
    return knots[np.concatenate([[True], np.diff(knots) > least])]


def hats(values: Array, knots: Array) -> Array:
    """Hat functions: (n, knots), each row adds to 1."""
    at = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    share = np.clip((values - knots[at]) / (knots[at + 1] - knots[at]), 0.0, 1.0)
    columns = np.zeros((len(values), len(knots)))
    rows = np.arange(len(values))
    columns[rows, at] = 1.0 - share
    columns[rows, at + 1] = share
    return columns


def harmonics(angle: Array, orders: NDArray[np.intp], advance: Array | None = None) -> Array:
    """Columns sin hθ, cos hθ for each order h: (n, 2·orders).

    advance: the motor's turn during a block, rad: the mean of a sine over it is smaller by sinc(h·advance/2).
    """
    columns = np.empty((len(angle), 2 * len(orders)))
    for j, h in enumerate(orders):
        share = 1.0 if advance is None else np.sinc(h * advance / (2.0 * np.pi))
        columns[:, 2 * j] = np.sin(h * angle) * share
        columns[:, 2 * j + 1] = np.cos(h * angle) * share
    return columns


def orders_in(turns: float, advance: Array | None = None) -> NDArray[np.intp]:
    """Orders that angles over so many turns can show, in blocks that advance so far (rad, each)."""
    highest = HIGHEST_ORDER
    if advance is not None:
        typical = float(np.sqrt(np.mean(advance**2)))
        kept = np.abs(np.sinc(np.arange(1, HIGHEST_ORDER + 1) * typical / (2.0 * np.pi)))
        highest = int(np.argmax(kept < LEAST_SEEN)) if np.any(kept < LEAST_SEEN) else HIGHEST_ORDER
    lowest = 1 if turns >= LEAST_CYCLES else int(np.ceil(LEAST_CYCLES / max(turns, 1e-9)))
    return np.arange(lowest, highest + 1) if lowest <= highest else np.zeros(0, np.intp)
