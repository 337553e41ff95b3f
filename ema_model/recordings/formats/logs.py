"""Formats of logs: what a library of theirs finds in a file becomes columns on one clock, in a process of its own.

A format's file gives a function `opened(path, most_bytes)`, which yields a `Log`, and makes its `FORMAT` here.
"""

from __future__ import annotations

import importlib
import importlib.util
import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np

from ema_model.files import apart
from ema_model.files.refusal import listed, refusal, shown
from ema_model.recordings.formats.arrays import check_lengths
from ema_model.recordings.formats.channels import Channel, Log, NoLog, named, told
from ema_model.recordings.formats.clocks import Clocks, between, covered, is_state, main_clock, rule, usable
from ema_model.recordings.formats.format import Array, Columns, Format, check_size

_PATIENCE_S = 20.0  # for one question; some libraries never end
_TIME = "time_s"  # what the common clock's column is called: it is in seconds
INSTALL = "pip install 'emaviz[rigs]'"


def log_format(module: str, title: str, *suffixes: str, needs: str = "", doubtful: tuple[str, ...] = ()) -> Format:
    """A format whose file is `module`; `needs` is the library that reads it, if it is not always installed."""

    def ask(function: str, path: str, max_bytes: int, *more: Any) -> apart.Answer:
        if needs and importlib.util.find_spec(needs) is None:
            raise refusal(path, f"{title} files are read with {needs}, which is not installed: {INSTALL}")
        with open(path, "rb"):
            pass  # what the system does not let us read, is told as for any file
        question = f"{__name__}:{function}"
        try:
            return apart.ask(question, module, path, max_bytes, *more, most_bytes=3 * max_bytes, patience_s=_PATIENCE_S)
        except apart.Broken as error:
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


def names_of(module: str, path: str, max_bytes: int) -> tuple[list[str], list[Array]]:
    """The columns' names; asked in the process of its own."""
    log = _opened(module, path, max_bytes)
    return list(_columns(path, log)), []


def columns_of(
    module: str, path: str, max_bytes: int, names: Sequence[str], strict: bool
) -> tuple[tuple[list[str], list[str], str, tuple[dict[str, str], str, str] | None], list[Array]]:
    """Names, notes, title and what `Clocks` takes, and the columns; asked in the process of its own."""
    log = _opened(module, path, max_bytes)
    columns = _columns(path, log)
    if any(name not in columns for name in names):
        raise refusal(path, "has changed while it was read; read it again")
    check_size(path, sum(_samples(columns[name], log) for name in names), max_bytes)
    notes = list(log.notes)
    if log.parameters:
        notes.append(f"single numbers in the file: {told(log.parameters)}")
    if log.left_aside:
        notes.append(f"left aside, as they are no columns of numbers: {listed(log.left_aside)}")
    with _told(module, path):
        arrays, done, clocks = _on_one_clock(path, {name: columns[name] for name in names}, log, strict)
    if strict:
        _close()
    return (list(arrays), notes + done, log.title, clocks), list(arrays.values())


def _opened(module: str, path: str, max_bytes: int) -> Log:
    global _last
    status = os.stat(path)
    key = (module, os.path.realpath(path), status.st_mtime_ns, status.st_size, status.st_ino, max_bytes)
    if _last is not None and _last[0] == key:
        return _last[1]
    _close()
    files = ExitStack()
    with _told(module, path):
        log = files.enter_context(importlib.import_module(module).opened(path, max_bytes))
    _last = key, log, files
    return log


@contextmanager
def _told(module: str, path: str) -> Iterator[None]:
    try:
        yield
    except NoLog as error:
        title = importlib.import_module(module).FORMAT.title
        raise refusal(path, f"is not a whole {title} file ({shown(error, 120)}); save it again") from None


def _close() -> None:
    global _last
    if _last is not None:
        _, _, files = _last
        _last = None
        files.close()


def _columns(path: str, log: Log) -> dict[str, Channel | str]:
    """The channels by their names, the common clock first; a clock stands for itself by its name."""
    try:
        columns: dict[str, Channel | str] = dict(named(log.channels))
    except NoLog as error:
        raise refusal(path, f"{error}; keep fewer columns") from None
    if not columns:
        aside = f" ({listed(log.left_aside)})" if log.left_aside else ""
        raise refusal(path, f"holds no rows of numbers{aside}; a time and its signals are expected")
    if log.clocks and _TIME not in columns:
        return {_TIME: "", **columns}
    return columns


def _samples(column: Channel | str, log: Log) -> int:
    most = max((channel.samples for channel in log.channels), default=0)
    return most if isinstance(column, str) or column.clock else column.samples


def _on_one_clock(
    path: str, columns: dict[str, Channel | str], log: Log, strict: bool
) -> tuple[dict[str, Array], list[str], tuple[dict[str, str], str, str] | None]:
    """The columns with one length, by the rule of `clocks`: the clock with the most samples is that of all."""
    samples = {one.clock: one.samples for one in columns.values() if isinstance(one, Channel) and one.clock}
    if not samples:  # of the clock alone
        samples = {one.clock: one.samples for one in log.channels if one.clock}
    if not samples:
        return {name: _numbers(one.values()) for name, one in columns.items() if isinstance(one, Channel)}, [], None
    main = main_clock(samples)
    clocks = {name: _numbers(log.clocks[name]()) for name in samples}
    start = min((float(time[0]) for time in clocks.values() if time.size), default=0.0)
    time = clocks[main]
    keep = usable(time)
    repeated = int(keep.size - np.count_nonzero(keep))
    arrays: dict[str, Array] = {}
    timed = {name: one for name, one in columns.items() if isinstance(one, Channel) and one.clock}
    moved = [name for name, one in timed.items() if _differs(clocks, one, main)]
    numbers = {name: _numbers(one.values()) for name, one in columns.items() if isinstance(one, Channel)}
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
    return arrays, notes, ({name: one.clock if name in moved else main for name, one in timed.items()}, main, done)


def _whose(clock: str) -> str:
    return clock or "the others"


def _differs(clocks: dict[str, Array], one: Channel, main: str) -> bool:
    return one.clock != main and not np.array_equal(clocks[one.clock], clocks[main])


def _numbers(values: Any) -> Array:
    values = np.asarray(values)
    if values.dtype.kind not in "fiub":
        raise NoLog("it holds what are no numbers where there should be some")
    return np.require(values.reshape(-1), np.float64, ["C", "A"])
