"""A log's channels as columns of one length: those with clocks of their own are brought onto one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ema_model.files.opened import listed, refusal, shown
from ema_model.recordings.formats.channels import Channel, Log, NoLog, named
from ema_model.recordings.formats.clocks import Clocks, between, covered, is_state, main_clock, rule, usable
from ema_model.recordings.formats.format import Array, check_size


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
    """The columns asked for with one length, by the rule of `clocks`: the clock with the most samples is that of all.

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
    return (
        arrays,
        notes,
        Clocks({name: one.clock if name in moved else main for name, one in timed.items()}, main, done),
    )


def _whose(clock: str) -> str:
    return clock or "the others"


def _differs(clocks: dict[str, Array], one: Channel, main: str) -> bool:
    return one.clock != main and not np.array_equal(clocks[one.clock], clocks[main])


def _numbers(values: Any) -> Array:
    values = np.asarray(values)
    if values.dtype.kind not in "fiub":
        raise NoLog("it holds what are no numbers where there should be some")
    return np.require(values.reshape(-1), np.float64, ["C", "A"])
