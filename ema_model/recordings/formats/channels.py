"""Channels as loggers keep them: units, clocks of their own, groups of runs, and all of them on one clock."""

from __future__ import annotations

import importlib
import importlib.util
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.files import sandbox
from ema_model.files.opened import COLUMNS, listed, refusal, shown
from ema_model.recordings.column_names import QUANTITIES, UnitOfMeasure, dimensions_of, find_unit, is_time, readings
from ema_model.recordings.formats.format import (
    Clocks,
    Columns,
    Format,
    between,
    check_size,
    covered,
    is_state,
    main_clock,
    rule,
    usable,
)

# --- channels as loggers keep them: each with its unit and, where the format has them, with a clock of its own --------

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


# --- channels with a channel of their own time beside them, or in each group of them: `t_speed`, `encoder/time` -------
# HDF5, MATLAB and JSON know of no clocks, so that only names and lengths tell whose time is whose.

_TIME = QUANTITIES["time"]
_RISING = 0.9  # of a clock's steps
_LOOKED_AT = 1_000_000  # of its samples


def with_own_clocks(log: Log) -> Log:
    """The log with its channels of time as clocks, where the others have two or more of them; else as it is."""
    if log.clocks or sum(is_time(one.path[-1]) for one in log.channels) < 2:
        return log
    times = {i: one for i, one in enumerate(log.channels) if is_clock(one)}
    if len(times) < 2:
        return log
    near: dict[tuple[tuple[str, ...], int], list[int]] = {}
    for i, one in times.items():
        near.setdefault((one.path[:-1], one.samples), []).append(i)
    whose = {i: _time_of(one, near, times) for i, one in enumerate(log.channels) if i not in times}
    used = set(whose.values()) - {None}
    units = {i: _unit(times[i]) for i in times if i in used}
    if len(used) < 2 or (None in units.values() and any(units.values())):  # of some nobody knows how fast they go
        return log
    channels = [
        one if (time := whose.get(i)) is None else replace(one, clock=_name(times[time]), holds=not _has_unit(one))
        for i, one in enumerate(log.channels)
        if i not in used
    ]
    clocks = {_name(times[i]): partial(_seconds, times[i], unit) for i, unit in units.items()}
    return replace(log, channels=channels, clocks=clocks, time="time_s" if all(units.values()) else "time")


def _time_of(
    channel: Channel, near: Mapping[tuple[tuple[str, ...], int], Sequence[int]], times: Mapping[int, Channel]
) -> int | None:
    """The time of a channel: the one of its length that is named after it, or the only one, in the nearest group.

    near: times by group and length.
    """
    own = tokens(channel.path[-1])
    for depth in range(len(channel.path) - 1, -1, -1):
        here = near.get((channel.path[:depth], channel.samples), ())
        after = [i for i in here if (rest := beside_time(times[i].path[-1])) and rest <= own]
        for found in (after, here):
            if len(found) == 1:
                return found[0]
        if here:
            return None  # nobody knows which
    return None


def _name(time: Channel) -> str:
    return ".".join(time.path)


def is_clock(channel: Channel) -> bool:
    """Whether a channel is called a time, and rises as one does."""
    if channel.samples < 2 or not is_time(channel.path[-1]):
        return False
    values = np.asarray(channel.values())
    if values.dtype.kind not in "fiu":
        return False
    values = values.reshape(-1)[:_LOOKED_AT].astype(np.float64)
    return bool(np.isfinite(values).all() and np.count_nonzero(usable(values)) > _RISING * values.size)


def _unit(channel: Channel) -> UnitOfMeasure | None:
    return find_unit(readings(with_unit(channel.path[-1], channel.unit))[0].unit, "s")


def _has_unit(channel: Channel) -> bool:
    return bool(readings(with_unit(channel.path[-1], channel.unit))[0].unit)


def _seconds(channel: Channel, unit: UnitOfMeasure | None) -> Array:
    values = np.asarray(channel.values()).reshape(-1).astype(np.float64)
    return values if unit is None else unit.to_si(values)


def beside_time(name: str) -> frozenset[str]:
    """What a time's name says beside that it is time, and in which unit."""
    return tokens(name) - _TIME - tokens(readings(name)[0].unit)


def tokens(name: str) -> frozenset[str]:
    """Its words and numbers in small letters: `t_motorSpeed2` has t, motor, speed and 2."""
    return frozenset(re.findall(r"[^\W\d_]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()))


# --- files with a group for each run, all with the same channels ------------------------------------------------------
# HDF5's groups, TDMS's, MATLAB's structs in a row.
# They become one table with a column that numbers the runs, as texts have it.  Groups alike may as well be the axes of
# one machine, so that their names must say that they are runs: trial_3, test(2), 2024-05-01.

RUN = "run"
_RUNS = QUANTITIES["segment"] | frozenset(
    "runs trials test tests experiment exp shot measurement meas messung versuch cycle sweep recording rec record log "
    "data flight series".split()
)
_MOST_TOLD = 12


def with_runs(log: Log) -> Log:
    """The log with its groups one after the other, where each is a run with a time of its own; else as it is."""
    groups: dict[tuple[str, ...], dict[str, Channel]] = {}
    for one in log.channels:
        groups.setdefault(one.path[:-1], {})[one.path[-1]] = one
    if log.clocks or not _are_runs(log, groups):
        return log
    ordered = sorted(groups, key=lambda group: [_natural(part) for part in group])
    numbers = _run_numbers([group[-1] for group in ordered])
    runs = [groups[group] for group in ordered]
    lengths = [next(iter(run.values())).samples for run in runs]
    samples = sum(lengths)
    channels = [
        replace(one, path=(name,), samples=samples, values=partial(_joined, [run[name] for run in runs]))
        for name, one in runs[0].items()
    ]
    channels.append(Channel((RUN,), samples, partial(np.repeat, np.array(numbers, float), lengths), holds=True))
    told = [f"{number} is {group[-1]}" for number, group in zip(numbers, ordered)]
    more = ", …" if len(told) > _MOST_TOLD else ""
    return replace(log, channels=channels, notes=(*log.notes, f"a run a group: {', '.join(told[:_MOST_TOLD])}{more}"))


def _are_runs(log: Log, groups: dict[tuple[str, ...], dict[str, Channel]]) -> bool:
    """Whether all channels stand in groups side by side, with the same names and one time each."""
    first = next(iter(groups.values()), {})
    if len(groups) < 2 or len(first) < 2 or RUN in first or () in groups or len({group[:-1] for group in groups}) > 1:
        return False
    if not all(_is_run(group[-1]) for group in groups):
        return False
    if sum(map(len, groups.values())) < len(log.channels):  # a name stands twice in a group
        return False
    return all(
        run.keys() == first.keys()
        and len({one.samples for one in run.values()}) == 1
        and all(one.unit == first[name].unit for name, one in run.items())
        and sum(map(is_clock, run.values())) == 1
        for run in groups.values()
    )


def _is_run(name: str) -> bool:
    words = set(re.findall(r"[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()))
    return not _RUNS.isdisjoint(words) or (not words and bool(re.search(r"\d", name)))


def _run_numbers(names: Sequence[str]) -> list[int]:
    """The numbers that the groups' names end in, where all do and no two the same; else 1, 2, 3 …"""
    ends = [re.search(r"(\d{1,9})\)?$", name) for name in names]
    found = [int(end[1]) for end in ends if end]
    return found if len(set(found)) == len(names) else list(range(1, len(names) + 1))


def _natural(text: str) -> list[tuple[int, str]]:
    """A key by which trial2 stands before trial10."""
    return [(int(part[:18]), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", text)]


def _joined(parts: Sequence[Channel]) -> Array:
    return np.concatenate([np.asarray(part.values()).reshape(-1) for part in parts])


# --- a log's channels as columns of one length: those with clocks of their own are brought onto one -------------------


def offered(path: str, log: Log) -> dict[str, Channel | str]:
    """The channels by their names, the common clock first; a clock stands for itself by its name."""
    try:
        columns: dict[str, Channel | str] = dict(named(log.channels))
    except NoLog as error:
        raise refusal(path, f"{error}; keep fewer columns") from None
    if not columns:
        aside = f" ({listed(log.left_aside)})" if log.left_aside else ""
        raise refusal(path, f"holds no rows of numbers{aside}; a time and its signals are expected")
    if log.clocks and log.time not in columns:
        return {log.time: "", **columns}
    return columns


def _samples(column: Channel | str, log: Log) -> int:
    most = max((channel.samples for channel in log.channels), default=0)
    return most if isinstance(column, str) or column.clock else column.samples


def taken(
    path: str, log: Log, names: Sequence[str], max_bytes: int, strict: bool
) -> tuple[dict[str, Array], list[str], Clocks | None]:
    """The columns asked for with one length, by the rule of `format`: the clock with the most samples is that of all.

    With it what was done, in words and by column; strict: only where all were recorded.  Raises InputError for what
    takes more than `max_bytes` and for channels that have no time in common, NoLog for what is no column of numbers.
    """
    known = offered(path, log)
    if any(name not in known for name in names):
        raise refusal(path, "has changed while it was read; read it again")
    columns = {name: known[name] for name in names}
    check_size(path, sum(_samples(one, log) for one in columns.values()), max_bytes)
    samples = {one.clock: one.samples for one in columns.values() if isinstance(one, Channel) and one.clock}
    if not samples:  # of the clock alone
        samples = {one.clock: one.samples for one in log.channels if one.clock}
    if not samples:
        return (
            {name: _as_numbers(one.values()) for name, one in columns.items() if isinstance(one, Channel)},
            [],
            None,
        )
    main = main_clock(samples)
    clocks = {name: _as_numbers(log.clocks[name]()) for name in samples}
    start = min((float(time[0]) for time in clocks.values() if time.size), default=0.0)
    time = clocks[main]
    keep = usable(time)
    repeated = int(keep.size - np.count_nonzero(keep))
    arrays: dict[str, Array] = {}
    timed = {name: one for name, one in columns.items() if isinstance(one, Channel) and one.clock}
    moved = [name for name, one in timed.items() if _differs(clocks, one, main)]
    numbers = {name: _as_numbers(one.values()) for name, one in columns.items() if isinstance(one, Channel)}
    states = {name for name in moved if timed[name].holds and is_state(numbers[name])}
    within = keep.copy()
    for name in moved if strict else ():
        within &= covered(time, clocks[timed[name].clock], name in states)
    if strict and not within.any():
        raise refusal(path, "its channels have no time in common; choose others, or record them together")
    for name, one in columns.items():
        if isinstance(one, str):
            arrays[name] = (time - start)[within]
        elif name in moved:
            arrays[name] = between(time, clocks[one.clock], numbers[name], name in states)[within]
        else:
            arrays[name] = numbers[name][within] if one.clock else numbers[name]
    notes = []
    if repeated:
        notes.append(f"{repeated} samples are left out, whose time is not after the one before")
    if not moved:
        return arrays, notes, None
    done = rule(bool(states))
    notes.append(f"brought onto the clock of {shown(_whose(main))}, {done}: {listed(moved)}")
    if (lost := int(np.count_nonzero(keep & ~within))) > 0:
        notes.append(f"{lost} samples are left out, where one of these was not recorded")
    return (
        arrays,
        notes,
        Clocks({name: one.clock if name in moved else main for name, one in timed.items()}, main, done),
    )


def _whose(clock: str) -> str:
    return clock or "the others"


def _differs(clocks: dict[str, Array], one: Channel, main: str) -> bool:
    return one.clock != main and not np.array_equal(clocks[one.clock], clocks[main])


def _as_numbers(values: Any) -> Array:
    values = np.asarray(values)
    if values.dtype.kind not in "fiub":
        raise NoLog("it holds what are no numbers where there should be some")
    return np.require(values.reshape(-1), np.float64, ["C", "A"])


# --- formats of logs: what a library finds in a file becomes columns on one clock, in a process of its own ------------
# A format's file has a function of a path and of the most bytes, which yields a `Log`, and makes its `FORMAT` of it.

_PATIENCE_S = 20.0  # for one question; some libraries never end
INSTALL = "pip install 'emaviz[rigs]'"


def check_lengths(path: str, columns: Mapping[str, Array]) -> None:
    """Raises InputError unless all have the length of the first."""
    names = list(columns)
    for name in names[1:]:
        if columns[name].size != columns[names[0]].size:
            found = f"{columns[name].size} values where {shown(names[0])!r} has {columns[names[0]].size}"
            raise refusal(path, f"column {shown(name)!r} has {found}; one length is expected, cut or resample it")


Opening: TypeAlias = Callable[[str, int], AbstractContextManager[Log]]  # path, most bytes; NoLog for what is none


def log_format(opened: Opening, title: str, *suffixes: str, needs: str = "", doubtful: tuple[str, ...] = ()) -> Format:
    """A format that a function of a module opens; `needs` is the library for it, if it is not always installed."""
    place = f"{opened.__module__}:{opened.__name__}"

    def ask(function: str, path: str, max_bytes: int, *more: Any) -> sandbox.Answer:
        if needs and importlib.util.find_spec(needs) is None:
            raise refusal(path, f"{title} files are read with {needs}, which is not installed: {INSTALL}")
        with open(path, "rb"):
            pass  # what the system does not let us read, is told as for any file
        question = f"{__name__}:{function}"
        try:
            return sandbox.ask(
                question, place, title, path, max_bytes, *more, most_bytes=3 * max_bytes, patience_s=_PATIENCE_S
            )
        except sandbox.Broken as error:
            raise refusal(path, f"is not a whole {title} file ({error}); save it again, or in parts") from None

    def header(path: str, max_bytes: int) -> list[str]:
        names, _ = ask("names_of", path, max_bytes)
        return names

    def read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
        (found, notes, title, clocks), arrays = ask("columns_of", path, max_bytes, list(names), strict)
        columns = dict(zip(found, arrays))
        if strict:
            check_lengths(path, columns)
        clocks = Clocks(*clocks) if clocks else None
        return Columns(columns, lambda row: f"sample {row + 1}", tuple(notes), title, clocks)

    return Format(suffixes[0], title, header, read, others=suffixes[1:], doubtful=doubtful)


_last: tuple[object, Log, ExitStack] | None = None  # the file that is looked at: it is asked about more than once


def names_of(place: str, title: str, path: str, max_bytes: int) -> tuple[list[str], list[Array]]:
    """The columns' names; asked in the process of its own.  place: "module:function" that opens the file."""
    return list(offered(path, _opened(place, title, path, max_bytes))), []


def columns_of(
    place: str, title: str, path: str, max_bytes: int, names: Sequence[str], strict: bool
) -> tuple[tuple[list[str], list[str], str, tuple[dict[str, str], str, str] | None], list[Array]]:
    """Names, notes, title and what `Clocks` takes, and the columns; asked in the process of its own."""
    log = _opened(place, title, path, max_bytes)
    notes = list(log.notes)
    if log.parameters:
        notes.append(f"single numbers in the file: {told(log.parameters)}")
    if log.left_aside:
        notes.append(f"left aside, as they are no columns of numbers: {listed(log.left_aside)}")
    with _told(title, path):
        arrays, done, clocks = taken(path, log, names, max_bytes, strict)
    if strict:
        _close()
    parts = (dict(clocks.of), clocks.main, clocks.rule) if clocks else None
    return (list(arrays), notes + done, log.title, parts), list(arrays.values())


def _opened(place: str, title: str, path: str, max_bytes: int) -> Log:
    global _last
    status = os.stat(path)
    key = (place, os.path.realpath(path), status.st_mtime_ns, status.st_size, status.st_ino, max_bytes)
    if _last is not None and _last[0] == key:
        return _last[1]
    _close()
    files = ExitStack()
    with _told(title, path):
        module, _, function = place.partition(":")
        log = files.enter_context(getattr(importlib.import_module(module), function)(path, max_bytes))
        log = with_own_clocks(with_runs(log))
    _last = key, log, files
    return log


@contextmanager
def _told(title: str, path: str) -> Iterator[None]:
    try:
        yield
    except NoLog as error:
        raise refusal(path, f"is not a whole {title} file ({shown(error, 120)}); save it again") from None


def _close() -> None:
    global _last
    if _last is not None:
        _, _, files = _last
        _last = None
        files.close()
