"""Channels with a channel of their own time beside them, or in each group of them: `t_speed`, `encoder/time`.

HDF5, MATLAB and JSON know of no clocks, so that only names and lengths tell whose time is whose.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ema_model.quantities.units import Unit, find_unit
from ema_model.recordings.column_names import QUANTITIES, is_time, readings
from ema_model.recordings.formats.channels import Array, Channel, Log, with_unit
from ema_model.recordings.formats.clocks import usable

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


def _unit(channel: Channel) -> Unit | None:
    return find_unit(readings(with_unit(channel.path[-1], channel.unit))[0].unit, "s")


def _has_unit(channel: Channel) -> bool:
    return bool(readings(with_unit(channel.path[-1], channel.unit))[0].unit)


def _seconds(channel: Channel, unit: Unit | None) -> Array:
    values = np.asarray(channel.values()).reshape(-1).astype(np.float64)
    return values if unit is None else unit.to_si(values)


def beside_time(name: str) -> frozenset[str]:
    """What a time's name says beside that it is time, and in which unit."""
    return tokens(name) - _TIME - tokens(readings(name)[0].unit)


def tokens(name: str) -> frozenset[str]:
    """Its words and numbers in small letters: `t_motorSpeed2` has t, motor, speed and 2."""
    return frozenset(re.findall(r"[^\W\d_]+|\d+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()))
