"""Long lines for figures: few points, every spike kept, gaps left open."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from emaviz.figures.decimate import envelope

Array = NDArray[np.float64]
Single = NDArray[np.float32]  # half the size, and finer than any screen

_GAP = 5.0  # median steps of x without a point: a gap, over which no line is drawn


def stretches(x: Array, known: NDArray[np.bool_], most: int) -> list[NDArray[np.intp]]:
    """Places of each unbroken stretch of known points; all of them as one where there were more than `most`.

    A stretch ends where a point is not known, where x goes back, and where it leaps.
    """
    places = np.flatnonzero(known)
    if len(places) < 2:
        return [places] if len(places) else []
    steps = np.diff(x[places])
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    broken = (np.diff(places) > 1) | (steps <= 0.0) | (steps > _GAP * usual)
    parts = np.split(places, np.flatnonzero(broken) + 1)
    return parts if len(parts) <= most else [places]


def line(x: Array, y: Array, points: int) -> tuple[Single, Single]:
    """x and y (n,) with at most `points` values: the same envelope, NaN between stretches.

    What is not finite is left out.
    """
    xs, ys = [], []
    for at_x, at_y in _decimated(x, [y], points):
        xs += [at_x, [np.nan]]
        ys += [at_y, [np.nan]]
    return _joined(xs[:-1]), _joined(ys[:-1])


def band(x: Array, low: Array, high: Array, points: int) -> tuple[Single, Single]:
    """The outline of the band between low and high, to be filled "toself"; at most `points` values."""
    xs, ys = [], []
    for at_x, at_low, at_high in _decimated(x, [low, high], points // 2):
        # the lower edge's lows and the upper edge's highs: pairs of a bucket would draw teeth
        xs += [at_x, at_x[::-1], [np.nan]]
        ys += [at_high, at_low[::-1], [np.nan]]
    return _joined(xs[:-1]), _joined(ys[:-1])


def _decimated(x: Array, series: Sequence[Array], points: int) -> list[tuple[Array, ...]]:
    known = np.isfinite(x) & np.all(np.isfinite(series), axis=0)
    parts = stretches(x, known, max(1, points // 8))
    total = sum(map(len, parts))
    if total + len(parts) > points:
        left = points - 3 * len(parts)  # a gap each, and two points at least
        shares = [max(2, int(left * len(part) / total)) for part in parts]
    else:
        shares = [len(part) for part in parts]
    return [
        envelope(x[part], [one[part] for one in series], share) if len(part) > share else (x[part], *_at(series, part))
        for part, share in zip(parts, shares, strict=True)
    ]


def _at(series: Sequence[Array], part: NDArray[np.intp]) -> tuple[Array, ...]:
    return tuple(one[part] for one in series)


def _joined(parts: Sequence[Array | list[float]]) -> Single:
    with np.errstate(over="ignore"):  # of a model that diverges, which no chart can show
        return np.asarray(np.concatenate(parts) if parts else [], dtype=np.float32)


def scattered(x: Array, y: Array, points: int) -> NDArray[np.intp]:
    """Which of the points (n,) to draw as a cloud: lowest and highest of each slice of x, and others evenly."""
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if len(known) <= points:
        return known
    order = known[np.argsort(x[known], kind="stable")]
    slices = np.array_split(order, max(1, points // 4))
    extremes = np.array([place for part in slices for place in (part[np.argmin(y[part])], part[np.argmax(y[part])])])
    # Drawn at random, because even steps could beat against a periodic motion.
    others = np.random.default_rng(0).choice(known, points - len(extremes), replace=False)
    return np.union1d(extremes, others)
