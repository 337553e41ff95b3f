"""What a format's file declares, and the rule by which channels with clocks of their own come onto one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.files.opened import megabytes, refusal
from ema_model.recordings.formats.text_layout import Head, Hints

# --- channels with clocks of their own, brought onto one: the rule, which is named wherever it is used ----------------

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


# --- what a format's file declares ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Columns:
    """Numbers as they stand in a file, not yet checked."""

    arrays: dict[str, Array]
    place: Callable[[int], str]  # the sample's index → where it stands: "line 2", "row 1"
    notes: tuple[str, ...] = ()
    title: str = ""  # what the file calls the run, beside its own name
    clocks: Clocks | None = None  # of the columns, where they have several
    layout: str = ""  # what was found out by itself of how the file is laid out, for a person to look at


def check_size(path: str, numbers: float, max_bytes: int) -> None:
    """Raises InputError if so many numbers take more memory than `max_bytes`: a small file may declare any number."""
    if 8.0 * numbers > max_bytes:
        size = f"unpacks to {megabytes(8.0 * numbers)}, over the limit of {megabytes(max_bytes)}"
        raise refusal(path, f"{size}; split it, or keep fewer columns")


@dataclass(frozen=True)
class Format:
    """One kind of file.

    `header` returns the columns' names, in the file's order.  `read` returns those asked for (float64, one
    length; NaN stands for itself, a blank cell is refused); unless `strict`, those that are columns of numbers by
    themselves, of whatever length.  `write` takes signals of one length and the file to make; formats that are only
    read have none.  The first two raise InputError for files that are not well formed or take more than `max_bytes`
    in memory; all may raise OSError.
    """

    suffix: str
    title: str
    header: Callable[[str, int], list[str]]  # path, max_bytes in memory
    read: Callable[[str, Sequence[str], int, bool], Columns]  # path, names, max_bytes in memory, strict
    write: Callable[[Mapping[str, Array], str], None] | None = None
    others: tuple[str, ...] = ()  # further suffixes of the same kind of file
    doubtful: tuple[str, ...] = ()  # suffixes that files of other things have as well: notes, settings, a run's record
    hinted: Callable[[Hints], Format] | None = None  # the same for a text of which somebody has said the layout
    head: Callable[[str, int], Head | None] | None = None  # path, max_bytes: a text's first lines; None for no text

    @property
    def suffixes(self) -> tuple[str, ...]:
        """All of them, the usual one first."""
        return (self.suffix, *self.others)
