"""Channels as loggers keep them: each with its unit and, where the format has them, with a clock of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.files.limits import COLUMNS
from ema_model.files.opened import shown
from ema_model.quantities.units import dimensions_of
from ema_model.recordings.column_names import is_time

Array = NDArray[np.float64]
MOST_COLUMNS = 64  # of a matrix: beyond, it is an image
_LONGEST_UNIT = 24
_SAYS_NOTHING = ("data", "value", "values")  # of a name: what a group or a topic holds, not what it is


@dataclass(frozen=True)
class Channel:
    """One row of numbers; (n,).  Channels of one clock have one length."""

    path: tuple[str, ...]  # its group's name, where there is one, and its own
    samples: int
    values: Callable[[], NDArray[Any]]
    unit: str = ""
    clock: str = ""  # of the log's clocks; "" where the format knows of none
    holds: bool = False  # whole numbers without a unit: a state, which holds between its samples, or counts


@dataclass(frozen=True)
class Log:
    """What a file holds: channels, clocks, single numbers, and what it says of itself."""

    channels: Sequence[Channel]
    clocks: dict[str, Callable[[], Array]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    left_aside: tuple[str, ...] = ()  # names of what is no row of numbers
    title: str = ""  # what it calls the run, beside its file's name
    time: str = "time_s"  # what the clocks' column is called: they are in seconds, unless their unit is not known


Opened = Callable[[str, int], AbstractContextManager[Log]]  # path, most bytes


class NoLog(Exception):
    """The file breaks its format; the text says how, for a person."""


@contextmanager
def broken_file(what: str = "") -> Iterator[None]:
    """Around a library that checks little: whatever it raises of a file's content is a NoLog, of `what` in it.

    Native code raises panics that are no Exception.
    """
    try:
        yield
    except (NoLog, InputError, MemoryError, GeneratorExit, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:
        raise NoLog(f"{what}: {type(error).__name__}: {error}".removeprefix(": ")) from None


def named(channels: Sequence[Channel]) -> dict[str, Channel]:
    """The channels by the names of their columns: their own, with the groups' as far as it takes, and the unit.

    A table cannot have more columns than a measurement may; NoLog says so.
    """
    if len(channels) > COLUMNS:
        raise NoLog(f"it has {len(channels)} channels, over the limit of {COLUMNS}")
    found: dict[str, Channel] = {}
    for name, channel in zip(_told_apart([channel.path for channel in channels]), channels):
        unique, number = name, 2
        while with_unit(unique, channel.unit) in found:  # the same path stands twice
            unique, number = f"{name} #{number}", number + 1
        found[with_unit(unique, channel.unit)] = channel
    return found


def with_unit(name: str, unit: str) -> str:
    """The name as people write it in a table: `speed [rpm]`; as it is where the unit is none that is known."""
    unit = unit.strip()
    is_known = 0 < len(unit) <= _LONGEST_UNIT and bool(dimensions_of(unit))
    return f"{name} [{unit}]" if is_known and not name.endswith("]") and unit not in ("1", "-") else name


@dataclass(frozen=True)
class Matrix:
    """Numbers in rows and columns, of which one way is time; sizes of one are left out of the shape."""

    path: tuple[str, ...]
    shape: tuple[int, int]
    values: Callable[[], NDArray[Any]]  # (rows, columns)
    names: Sequence[str] = ()  # of its signals, where they have some
    units: Sequence[str] = ()


def in_columns(found: Sequence[Channel | Matrix]) -> tuple[list[Channel], list[str]]:
    """The channels, each matrix as those that it holds, and the names and sizes of matrices that hold none."""
    lengths = times_of((one.path[-1], one.samples) for one in found if isinstance(one, Channel))
    channels: list[Channel] = []
    aside = []
    for one in found:
        if isinstance(one, Channel):
            channels.append(one)
        elif (way := way_of_time(one.shape, lengths, len(one.names))) is None:
            aside.append(without_columns(".".join(one.path), one.shape))
        else:
            channels += _columns(one, way)
    return channels, aside


def _columns(matrix: Matrix, way: int) -> list[Channel]:
    samples, count = matrix.shape[way], matrix.shape[1 - way]
    *group, name = matrix.path
    names = column_names_of(name, count)
    if len(matrix.names) == count == len(set(matrix.names)) and all(matrix.names):
        group, names = [*group, name], matrix.names
    units = matrix.units if len(matrix.units) == count else [""] * count
    whole: list[NDArray[Any]] = []

    def column(i: int) -> NDArray[Any]:
        if not whole:  # read at once: what is stored row by row has a column in every part
            whole.append(matrix.values())
        return whole[0][:, i] if way == 0 else whole[0][i]

    return [Channel((*group, name), samples, lambda i=i: column(i), units[i]) for i, name in enumerate(names)]


def column_names_of(matrix: str, count: int) -> list[str]:
    """What the columns of a matrix are called: q_1, q_2, …"""
    return [f"{matrix}_{i + 1}" for i in range(count)]


def times_of(vectors: Iterable[tuple[str, int]]) -> set[int]:
    """The lengths that time has in a file, by the names and lengths of its vectors; without one, the longest length."""
    vectors = list(vectors)
    times = {size for name, size in vectors if is_time(name)}
    return times or {max((size for _, size in vectors), default=0)}


def without_ones(shape: Sequence[int]) -> tuple[int, ...]:
    """A shape without its sizes of one: a vector has one size, a matrix two."""
    return tuple(size for size in shape if size != 1)


def way_of_time(shape: Sequence[int], times: Collection[int], signals: int = 0) -> int | None:
    """Along which of its two sizes a matrix has its samples: that of a time, else the long one; None for an image.

    signals: how many there are, where that is known.
    """
    if len(shape) != 2:
        return None
    fitting = [way for way in (0, 1) if 1 < shape[1 - way] <= MOST_COLUMNS and shape[way] > 1]
    of_time = [way for way in fitting if shape[way] in times]
    of_names = [way for way in fitting if signals > 1 and shape[1 - way] == signals]
    long = [way for way in fitting if shape[way] > shape[1 - way]]
    return next((way for way in (*of_time, *of_names, *long)), None)


def without_columns(name: str, shape: Sequence[int]) -> str:
    """How a message calls numbers that give no columns: with their sizes."""
    over = f", over {MOST_COLUMNS} columns" if len(shape) == 2 and min(shape) > MOST_COLUMNS else ""
    return f"{name} ({'×'.join(map(str, shape))}{over})"


def told(parameters: dict[str, float]) -> str:
    """The single numbers of a file in one line: "kp = 100, mass = 0.49"."""
    few = [f"{shown(name)} = {value:.6g}" for name, value in list(parameters.items())[:12]]
    return ", ".join([*few, "…"] if len(parameters) > len(few) else few)


def _told_apart(paths: Sequence[tuple[str, ...]]) -> list[str]:
    """Each path's last parts, as few as say something and tell it from all others, joined by dots."""
    lengths = [1 + (path[-1].lower() in _SAYS_NOTHING) for path in paths]
    for _ in range(max(map(len, paths), default=1)):
        names = [".".join(path[-length:]) for path, length in zip(paths, lengths)]
        count = Counter(names)
        lengths = [length + (count[name] > 1) for name, length in zip(names, lengths)]
    return [".".join(path[-length:]) for path, length in zip(paths, lengths)]
