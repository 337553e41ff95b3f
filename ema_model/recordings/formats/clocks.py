"""Channels with clocks of their own, brought onto one: the rule, which is named wherever it is used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
GAP = 10.0  # median steps without a sample, from which on nothing is put between its ends
_STATES, _SELDOM = 16, 0.1  # values of a state at most, or the share of its samples at which it changes
_CYCLIC, _ALIKE = 0.9, 0.2  # the share of steps that are so near the median where a logger samples by the clock


@dataclass(frozen=True)
class Clocks:
    """Which columns, or signals, had which clock, before all were brought onto one."""

    of: Mapping[str, str]  # the clock's name by the column's
    main: str
    rule: str  # by which values were put between samples: "linearly between their samples, states held"


class NoCommonTime(Exception):
    """The channels were not recorded at the same time."""


def main_clock(clocks: Mapping[str, int]) -> str:
    """The one that all are brought onto, by their numbers of samples: that with the most."""
    return max(clocks, key=lambda name: clocks[name])


def is_state(values: NDArray) -> bool:
    """Whether a channel without a unit holds between samples: few whole numbers, or seldom changing ones."""
    values = np.asarray(values, np.float64)
    is_whole = bool(np.all(values == np.round(values)))
    changes = int(np.count_nonzero(np.diff(values)))
    return is_whole and (changes <= _SELDOM * values.size or np.unique(values).size <= _STATES)


def rule(holds: bool) -> str:
    """What `between` does, in words; holds: whether there are states."""
    return "linearly between their samples" + (", states held" if holds else "")


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
    """Which times lie between samples of another clock that are no gap apart.

    A state that is logged where it changes has no gaps; one that is sampled has those of its clock.
    """
    own_time = own_time[usable(own_time)]
    if own_time.size < 2:
        return np.zeros(time.size, bool)
    inside = time >= own_time[0]
    steps = np.diff(own_time)
    usual = np.median(steps)
    if holds and np.mean(np.abs(steps - usual) <= _ALIKE * usual) < _CYCLIC:
        return inside
    inside &= time <= own_time[-1]
    wide = np.append(steps > GAP * usual, False)
    at = np.clip(np.searchsorted(own_time, time, "right") - 1, 0, own_time.size - 1)
    return inside & ~(wide[at] & (time > own_time[at]))
