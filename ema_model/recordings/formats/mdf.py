"""MDF of ASAM, versions 3 and 4 (CANape, INCA, ETAS): groups of channels, each group with a time of its own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ema_model.recordings.formats.channels import Channel, Log, broken_file, log_format

_MASTERS = (2, 3)  # kinds of channels that are their group's time


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The file's channels, by the physical values that its conversions say; NoLog for what cannot be opened."""
    from asammdf import MDF

    del most_bytes  # samples are counted before they are read
    with broken_file():
        # Descriptions of buses may stand in other files, which would be read for what is of no use here.
        file = MDF(path, process_bus_logging=False)  # type: ignore  its versions take it
    with file:
        with broken_file():
            log = _log(file)
        yield log


def _log(file: Any) -> Log:
    channels: list[Channel] = []
    clocks: dict[str, Any] = {}
    for number, group in enumerate(file.groups):
        samples = int(group.channel_group.cycles_nr)
        clock = f"group {number + 1}"
        name_of_group = str(getattr(group.channel_group, "acq_name", "") or "") or clock
        master = file.masters_db.get(number)
        for index, channel in enumerate(group.channels):
            if index == master or samples < 2 or int(channel.channel_type) in _MASTERS:
                continue
            unit = str(channel.unit or getattr(channel.conversion, "unit", "") or "")
            channels.append(
                Channel(
                    (name_of_group, str(channel.name).split("\\")[0]),
                    samples,
                    lambda g=number, i=index: _values(file, g, i),
                    unit,
                    clock if master is not None else "",
                    not unit and _is_state(channel),
                )
            )
        if master is not None:
            clocks[clock] = lambda g=number: _read(lambda: file.get_master(g))
    return Log(channels, clocks)


def _is_state(channel: Any) -> bool:
    """Whether whole numbers are stored, which no conversion turns into a quantity."""
    conversion = getattr(channel, "conversion", None)
    return int(channel.data_type) < 4 and (conversion is None or int(conversion.conversion_type) not in (1, 2, 3))


def _values(file: Any, group: int, index: int) -> Any:
    values = _read(lambda: file.get(group=group, index=index, samples_only=True)[0])
    if values.dtype.kind not in "fiub":  # texts for numbers: their numbers are what is wanted
        values = _read(lambda: file.get(group=group, index=index, samples_only=True, raw=True)[0])
    return values


def _read(read: Any) -> Any:
    with broken_file():
        return np.asarray(read())


FORMAT = log_format(opened, "MDF", ".mf4", ".mdf", ".mf3", needs="asammdf")
