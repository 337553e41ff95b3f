"""Texts in which each channel has a column of its own time, as loggers with a buffer for each export them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pyarrow as pa

from ema_model.files.refusal import listed, refusal
from ema_model.recordings.columns.words import QUANTITIES, readings
from ema_model.recordings.formats.clocks import Clocks, between, covered, is_state, main_clock, rule
from ema_model.recordings.formats.format import Array
from ema_model.recordings.formats.stamps import seconds

_TIME = QUANTITIES["time"]


def is_time(name: str) -> bool:
    """Whether a column's name says that it is time."""
    return any(not _TIME.isdisjoint(one.words) for one in readings(name))


def own_clocks(names: Sequence[str]) -> dict[int, int]:
    """Where columns of time stand before as many others each: those others' own times."""
    times = [i for i, name in enumerate(names) if is_time(name)]
    if len(times) < 2 or times[0] != 0:
        return {}
    ends = [*times[1:], max(i for i, name in enumerate(names) if name) + 1]
    if len({end - start for start, end in zip(times, ends)}) != 1 or ends[0] < 2:
        return {}
    units = {one.unit for i in times for one in readings(names[i])[:1]}
    if len(units) != 1:
        return {}
    return {i: start for start, end in zip(times, ends) for i in range(start, end)}


def since_one_moment(
    stamps: Iterable[int], texts: Mapping[int, pa.ChunkedArray], values: Mapping[int, tuple[Array, np.ndarray]]
) -> None:
    """Lets stamps of several clocks, each counted from its own first, count from the first clock's; in place.

    stamps: their columns; values: the seconds by column, and which cells are none.
    """
    times = [i for i in sorted(stamps) if not values[i][1].all()]
    begins = [texts[i][int(np.argmin(values[i][1]))].as_py() for i in times]
    for i, begin in zip(times[1:], begins[1:]):
        since = seconds(pa.chunked_array([[begins[0], begin]]))
        if since is not None:
            values[i][0][:] += since[1]


def on_one_clock(
    path: str,
    titles: Sequence[str],
    clocks: Mapping[int, int],
    places: Mapping[str, int],
    arrays: dict[str, Array],
    found: Mapping[int, Array | None],
    strict: bool,
) -> tuple[dict[str, Array], list[str], Clocks | None]:
    """The columns on the time with the most samples, see `clocks`; what was done, in words and by column.

    titles: of the file's columns; clocks: by column, that of its time; places: a name's column; found: numbers by
    column, each as long as it goes; strict: only where all were recorded.
    """
    times = {i: time for i in sorted(set(clocks.values())) if (time := found.get(i)) is not None}
    if not times:
        return arrays, [], None
    main = int(main_clock({f"{i}": time.size for i, time in times.items()}))
    time = times[main]
    timed = {name: clocks[places[name]] for name in arrays if places[name] in clocks and places[name] not in times}
    own = {name: times[clock] for name, clock in timed.items() if clock in times}
    moved = {name: one for name, one in own.items() if not np.array_equal(one, time)}
    states = {name for name in moved if not readings(name)[0].unit and is_state(arrays[name])}
    within = np.ones(time.size, bool)
    for name, one in moved.items() if strict else ():
        within &= covered(time, one, name in states)
    if strict and not within.any():
        raise refusal(path, "its columns have no time in common; choose others, or record them together")
    result = {}
    for name, values in arrays.items():
        if places[name] in times:
            result[name] = time[within]
        elif name in moved:
            length = min(moved[name].size, values.size)
            result[name] = between(time, moved[name][:length], values[:length], name in states)[within]
        else:
            result[name] = values[within] if values.size == time.size else values
    if not moved:
        return result, [], None
    done = rule(bool(states))
    notes = [f"each with a time of its own, brought onto one {done}: {listed(moved)}"]
    if lost := int(np.count_nonzero(~within)):
        notes.append(f"{lost} samples are left out, where one of these was not recorded")
    called = {clock: f"{titles[clock]} in column {clock + 1}" for clock in times}
    of = {name: called[timed[name] if name in moved else main] for name in own}
    return result, notes, Clocks(of, called[main], done)
