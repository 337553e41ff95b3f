"""Channels with clocks of their own, brought onto one: the rule, which is named wherever it is used."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_GAP = 10.0  # median steps without a sample, from which on nothing is put between its ends


class NoCommonTime(Exception):
    """The channels were not recorded at the same time."""


def main_clock(clocks: Mapping[str, int]) -> str:
    """The one that all are brought onto, by their numbers of samples: that with the most."""
    return max(clocks, key=lambda name: clocks[name])


def usable(time: Array) -> NDArray[np.bool_]:
    """Which samples of a clock are later than all before them."""
    return np.diff(np.maximum.accumulate(time), prepend=-np.inf) > 0.0


def between(time: Array, own_time: Array, values: NDArray, holds: bool) -> Array:
    """The values of a channel at the times of another clock: on the line between two samples, or the last one."""
    keep = usable(own_time)
    own_time, values = own_time[keep], np.asarray(values, np.float64)[keep]
    if not holds:
        return np.interp(time, own_time, values)
    return values[np.clip(np.searchsorted(own_time, time, "right") - 1, 0, values.size - 1)]


def covered(time: Array, own_time: Array, holds: bool) -> NDArray[np.bool_]:
    """Which times lie between samples of another clock that are no gap apart; a state that holds has no gaps."""
    own_time = own_time[usable(own_time)]
    if own_time.size < 2:
        return np.zeros(time.size, bool)
    inside = time >= own_time[0]
    if holds:
        return inside
    inside &= time <= own_time[-1]
    steps = np.diff(own_time)
    wide = np.append(steps > _GAP * np.median(steps), False)
    at = np.clip(np.searchsorted(own_time, time, "right") - 1, 0, own_time.size - 1)
    return inside & ~(wide[at] & (time > own_time[at]))
