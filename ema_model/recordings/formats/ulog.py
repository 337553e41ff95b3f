"""ULog of PX4 and others: topics, each with its own stamps in microseconds; the vehicle's settings are parameters."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ema_model.recordings.formats.channels import Channel, Log, broken_file, log_format

_STAMP = "timestamp"
_MICROSECOND = 1e-6


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The file's topics; NoLog for what is damaged beyond the library's own repairs."""
    from pyulog import ULog

    del most_bytes  # the whole file is read, which is no larger than it may be
    with broken_file():
        log = _log(ULog(path, disable_str_exceptions=True))
    yield log


def _log(file: Any) -> Log:
    channels: list[Channel] = []
    clocks: dict[str, Any] = {}
    for topic in file.data_list:
        stamps = topic.data.get(_STAMP)
        if stamps is None or len(stamps) < 2:
            continue
        clock = topic.name if topic.multi_id == 0 else f"{topic.name}.{topic.multi_id}"
        clocks[clock] = lambda stamps=stamps: stamps * _MICROSECOND
        for name, values in topic.data.items():
            if name == _STAMP or values.dtype.kind not in "fiub":
                continue
            plain = name.replace("[", ".").replace("]", "")  # brackets are for units
            holds = values.dtype.kind in "iub"
            channels.append(Channel((clock, plain), len(values), lambda v=values: v, clock=clock, holds=holds))
    notes = ("the logger says that it is cut short or has dropouts",) if file.dropouts else ()
    parameters = {name: float(value) for name, value in file.initial_parameters.items()}
    return Log(channels, clocks, parameters, notes)


FORMAT = log_format(opened, "ULog", ".ulg", ".ulog", needs="pyulog")
