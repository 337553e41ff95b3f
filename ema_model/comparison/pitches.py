"""Pitches: how a residual repeats along a linear motor, which has no turn that would make its orders whole.

Each order alone is fitted beside a constant (Lomb and Scargle's periodogram of unevenly spaced values), on a grid that
the travel resolves.  Magnets, poles and a screw's leads stand out of it as peaks.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.curves import LEAST_CYCLES, LEAST_SEEN
from ema_model.comparison.orders import Order, colour

Array = NDArray[np.float64]

HIGHEST = 20_000.0  # periods in 2π m: a pitch of 0.3 mm
_PER_TRAVEL = 3.0  # orders tried for one that the travel can tell from its neighbour
_REFINED = 16  # orders tried between two neighbours about a peak
_MOST = 24  # peaks
_AT_ONCE = 2_000_000  # values × orders, which the periodogram holds in memory


def pitches(position: Array, values: Array, advance: Array | None = None) -> list[Order]:
    """The orders h of A sin(h x + φ) that the travel can show, the most significant first.

    position: (samples,), m; values: (samples,), of any unit; advance: the way during a sample, m.
    """
    known = np.isfinite(position) & np.isfinite(values)
    x, y = position[known], values[known]
    travel = float(np.ptp(x)) if x.size else 0.0
    if travel == 0.0 or np.ptp(y) == 0.0:
        return []
    y = y - np.mean(y)
    grid = np.arange(LEAST_CYCLES, min(HIGHEST, _seen_to(advance)) * travel / (2.0 * np.pi), 1.0 / _PER_TRAVEL)
    grid *= 2.0 * np.pi / travel
    if grid.size < 3:
        return []
    step = grid[1] - grid[0]
    from scipy.signal import find_peaks  # takes a third of a second to import

    chi2 = _explained(x, y, grid)
    peaks, _ = find_peaks(chi2)
    strongest = peaks[np.argsort(-chi2[peaks])[:_MOST]]
    noise = colour(chi2)
    found = []
    for at in strongest:
        near = grid[at] + step * np.linspace(-1.0, 1.0, 2 * _REFINED + 1)
        order = float(near[int(np.argmax(_explained(x, y, near)))])
        columns = np.column_stack([np.sin(order * x), np.cos(order * x), np.ones(x.size)])
        a, b, _ = np.linalg.lstsq(columns, y, rcond=None)[0]
        found.append(Order(order, float(np.hypot(a, b)), float(np.arctan2(b, a)), float(chi2[at] / noise[at])))
    return sorted(found, key=lambda one: -one.significance)


def _seen_to(advance: Array | None) -> float:
    """The highest order of which blocks that advance so far keep enough."""
    typical = 0.0 if advance is None else float(np.sqrt(np.mean(advance**2)))
    if typical == 0.0:
        return np.inf
    shares = np.linspace(0.0, 1.0, 1001)
    return float(2.0 * np.pi * shares[np.argmax(np.sinc(shares) < LEAST_SEEN)] / typical)


def _explained(x: Array, y: Array, orders: Array) -> Array:
    """χ² that a sine of each order explains, of values whose noise is what it leaves: (orders,)."""
    from scipy.signal import lombscargle

    size = max(1, _AT_ONCE // x.size)
    parts = [orders[first : first + size] for first in range(0, orders.size, size)]
    told = [lombscargle(x, y, part, normalize=True, floating_mean=True) for part in parts]
    power = np.hstack(told)  # of one order it is a number
    return x.size * power / np.maximum(1.0 - power, 1e-9)
