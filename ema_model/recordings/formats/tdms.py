"""TDMS of LabVIEW and DIAdem: channels in groups, each a waveform with a start and an increment, or with a time."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ema_model.recordings.formats.channels import Array, Channel, Log, broken_file, log_format

_INCREMENT, _START, _BEGINS = "wf_increment", "wf_start_offset", "wf_start_time"
_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit")


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The file's channels; NoLog for what the library cannot open."""
    import nptdms

    del most_bytes  # what is read is counted before
    with open(path, "rb") as content:  # by a path the library would take what a .tdms_index beside it says
        with broken_file():
            file = nptdms.TdmsFile.open(content)
        with file:
            with broken_file():
                log = _log(file)
            yield log


def _log(file: Any) -> Log:
    channels: list[Channel] = []
    clocks: dict[str, Any] = {}
    parameters = _numbers(file.properties)
    aside = []
    for group in file.groups():
        for channel in group.channels():
            kind = np.dtype(channel.dtype).kind if channel.dtype is not None else "O"
            path, samples = (group.name, channel.name), len(channel)
            if kind == "M" and samples > 1:  # LabVIEW's time stamps
                channels.append(Channel(path, samples, lambda c=channel: _seconds(_read(c)), "s"))
            elif kind not in "fiub" or samples == 0:
                aside.append(channel.name)
            else:
                clock = _clock(channel, samples)
                if clock:
                    clocks.setdefault(clock[0], clock[1])
                unit = next((str(channel.properties[name]) for name in _UNITS if name in channel.properties), "")
                name = clock[0] if clock else ""
                channels.append(
                    Channel(path, samples, lambda c=channel: _read(c), unit, name, kind in "iub" and not unit)
                )
    return Log(channels, clocks, parameters, left_aside=tuple(aside))


def _clock(channel: Any, samples: int) -> tuple[str, Any] | None:
    """A waveform's clock: channels that begin together, with one increment and length, share it."""
    step, start = channel.properties.get(_INCREMENT), channel.properties.get(_START, 0.0)
    if not isinstance(step, (int, float)) or not isinstance(start, (int, float)) or not 0.0 < step < np.inf:
        return None
    begins = channel.properties.get(_BEGINS)
    seconds = 0.0
    if isinstance(begins, np.datetime64):
        seconds = float(begins.astype("datetime64[us]").astype(np.int64)) * 1e-6
    rate = f"{1.0 / step:.6g} Hz from {start:.6g} s, {samples} samples"
    name = f"{rate}, begun {begins}" if seconds else rate
    return name, lambda: _ramp(seconds + start, step, samples)


def _ramp(start: float, step: float, samples: int) -> Array:
    return start + step * np.arange(samples, dtype=np.float64)


def _read(channel: Any) -> Any:
    with broken_file(repr(channel.name[:40])):
        return channel[:]


def _seconds(stamps: Any) -> Array:
    stamps = np.asarray(stamps).astype("datetime64[ns]").astype(np.int64)
    return (stamps - stamps[0]) * 1e-9


def _numbers(properties: Any) -> dict[str, float]:
    numbers = {}
    for name, value in properties.items():
        if isinstance(value, (int, float, np.number)) and not isinstance(value, np.timedelta64):
            numbers[str(name)] = float(value)
    return numbers


FORMAT = log_format(opened, "TDMS", ".tdms", needs="nptdms")
