"""A sudden step of k between two flights: a part replaced, or a fault that came at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ema_model.tracking.criteria import JUMP_AFTER, JUMP_BACK, JUMP_LEAST, JUMP_ON, JUMP_SURE, JUMP_WINDOW

Array = NDArray[np.float64]


def jump(k: Array, variance: Array, common: Array, healthy: float) -> int | None:
    """The place of the first flight after a step, of the flights (n,) of one k; None where there is none.

    Only one that JUMP_AFTER flights follow is looked for, so that it is found as soon as it can be, and once more, if
    k went back towards healthy, after JUMP_SURE.  What the base parameters may add in other commands is no step: k is
    without what is known of it, common (flights, parameters) is what is not.
    """
    soon = _step(k, variance, common, JUMP_AFTER, healthy)
    if soon.sure > (JUMP_BACK if soon.back else JUMP_ON):
        return soon.at
    later = _step(k, variance, common, JUMP_SURE, healthy)
    return later.at if later.back and later.sure > JUMP_BACK else None


class _Step(NamedTuple):
    at: int  # place of the first flight after it
    sure: float  # its size over the spread
    back: bool  # towards healthy


def _step(k: Array, variance: Array, common: Array, after: int, healthy: float) -> _Step:
    """One that so many flights follow.

    Medians of as many flights on either side tell its size, less what wear adds meanwhile; the differences of the
    flights beside it tell the spread.
    """
    at = len(k) - after
    if at < after + 1:
        return _Step(at, 0.0, False)
    low, high = float(np.median(k[at - after : at])), float(np.median(k[at:]))
    first = max(0, at - JUMP_WINDOW)
    beside = np.delete(np.diff(k[first:]), at - first - 1)
    spread = max(
        1.4826 * float(np.median(np.abs(beside - np.median(beside)))),
        float(np.sqrt(2.0 * np.median(variance[first:]))),
    )
    # The median of a few differences is no slope for long; the flights before a step tell one, it itself does not.
    wear = float(np.median(beside)) if after == JUMP_AFTER else _slope(k[first:at])
    of_unit = np.linalg.norm(np.mean(common[at:], axis=0) - np.mean(common[at - after : at], axis=0))
    spread = float(np.hypot(spread * np.sqrt(JUMP_AFTER / after), of_unit))
    size = abs(high - low - after * wear)
    near = k[at - 2 : at + 2]  # medians leave it open by one
    back = abs(high - healthy) < abs(low - healthy)
    return _Step(at - 1 + int(np.argmax(np.abs(np.diff(near)))), size / spread if size > JUMP_LEAST else 0.0, back)


def _slope(k: Array) -> float:
    """Of a flight, by Theil and Sen: the median of those between any two."""
    sooner, later = np.triu_indices(len(k), 1)
    return float(np.median((k[later] - k[sooner]) / (later - sooner)))
