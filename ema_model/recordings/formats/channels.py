"""Channels as loggers keep them: each with its unit and, where the format has them, with a clock of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.files.limits import COLUMNS
from ema_model.files.opened import shown
from ema_model.quantities.units import dimensions_of

Array = NDArray[np.float64]
MOST_COLUMNS = 64  # of a table without names: beyond, it is an image, or the table lies on its side
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


def table(
    path: tuple[str, ...],
    rows: int,
    count: int,
    column: Callable[[int], NDArray[Any]],
    names: Sequence[str] = (),
    units: Sequence[str] = (),
) -> list[Channel]:
    """The columns of a matrix (rows, count), under their names where they have some, else as MATLAB writes them."""
    if len(names) != count or len(set(names)) != count or not all(names):
        names = [f"{path[-1]}(:,{i + 1})" for i in range(count)]
        path = path[:-1]
    units = units if len(units) == count else [""] * count
    return [Channel((*path, name), rows, lambda i=i: column(i), units[i]) for i, name in enumerate(names)]


def is_table(shape: Sequence[int]) -> bool:
    """Whether a matrix has columns to offer: few and long."""
    return len(shape) == 2 and 1 < shape[1] <= MOST_COLUMNS and shape[0] > shape[1]


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
