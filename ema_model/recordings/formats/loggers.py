"""Files of loggers, which libraries read that are not always installed: MDF, TDMS and ULog."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ema_model.recordings.formats.channels import Array, Channel, Log, broken_file, log_format

# --- MDF of ASAM, versions 3 and 4 (CANape, INCA, ETAS): groups of channels, each group with a time of its own --------

_MASTERS = (2, 3)  # kinds of channels that are their group's time


@contextmanager
def opened_mdf(path: str, most_bytes: int) -> Iterator[Log]:
    """The file's channels, by the physical values that its conversions say; NoLog for what cannot be opened."""
    from asammdf import MDF

    del most_bytes  # samples are counted before they are read
    with broken_file():
        # Descriptions of buses may stand in other files, which would be read for what is of no use here.
        file = MDF(path, process_bus_logging=False)  # type: ignore  its versions take it
    with file:
        with broken_file():
            log = _mdf_log(file)
        yield log


def _mdf_log(file: Any) -> Log:
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
                    lambda g=number, i=index: _mdf_values(file, g, i),
                    unit,
                    clock if master is not None else "",
                    not unit and _is_state(channel),
                )
            )
        if master is not None:
            clocks[clock] = lambda g=number: _mdf_read(lambda: file.get_master(g))
    return Log(channels, clocks)


def _is_state(channel: Any) -> bool:
    """Whether whole numbers are stored, which no conversion turns into a quantity."""
    conversion = getattr(channel, "conversion", None)
    return int(channel.data_type) < 4 and (conversion is None or int(conversion.conversion_type) not in (1, 2, 3))


def _mdf_values(file: Any, group: int, index: int) -> Any:
    values = _mdf_read(lambda: file.get(group=group, index=index, samples_only=True)[0])
    if values.dtype.kind not in "fiub":  # texts for numbers: their numbers are what is wanted
        values = _mdf_read(lambda: file.get(group=group, index=index, samples_only=True, raw=True)[0])
    return values


def _mdf_read(read: Any) -> Any:
    with broken_file():
        return np.asarray(read())


MDF = log_format(opened_mdf, "MDF", ".mf4", ".mdf", ".mf3", needs="asammdf")


# --- TDMS of LabVIEW and DIAdem: channels in groups, each a waveform with a start and an increment, or a time ---------

_INCREMENT, _START, _BEGINS = "wf_increment", "wf_start_offset", "wf_start_time"
_UNITS = ("unit_string", "NI_UnitDescription", "unit", "Unit")


@contextmanager
def opened_tdms(path: str, most_bytes: int) -> Iterator[Log]:
    """The file's channels; NoLog for what the library cannot open."""
    import nptdms

    del most_bytes  # what is read is counted before
    with open(path, "rb") as content:  # by a path the library would take what a .tdms_index beside it says
        with broken_file():
            file = nptdms.TdmsFile.open(content)
        with file:
            with broken_file():
                log = _tdms_log(file)
            yield log


def _tdms_log(file: Any) -> Log:
    channels: list[Channel] = []
    clocks: dict[str, Any] = {}
    parameters = _numbers(file.properties)
    aside = []
    for group in file.groups():
        for channel in group.channels():
            kind = np.dtype(channel.dtype).kind if channel.dtype is not None else "O"
            path, samples = (group.name, channel.name), len(channel)
            if kind == "M" and samples > 1:  # LabVIEW's time stamps
                channels.append(Channel(path, samples, lambda c=channel: _seconds(_tdms_read(c)), "s"))
            elif kind not in "fiub" or samples == 0:
                aside.append(channel.name)
            else:
                clock = _clock(channel, samples)
                if clock:
                    clocks.setdefault(clock[0], clock[1])
                unit = next((str(channel.properties[name]) for name in _UNITS if name in channel.properties), "")
                name = clock[0] if clock else ""
                channels.append(
                    Channel(path, samples, lambda c=channel: _tdms_read(c), unit, name, kind in "iub" and not unit)
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


def _tdms_read(channel: Any) -> Any:
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


TDMS = log_format(opened_tdms, "TDMS", ".tdms", needs="nptdms")


# --- ULog of PX4 and others: topics, each with its own stamps; the vehicle's settings are parameters ------------------

_STAMP = "timestamp"
_MICROSECOND = 1e-6


@contextmanager
def opened_ulog(path: str, most_bytes: int) -> Iterator[Log]:
    """The file's topics; NoLog for what is damaged beyond the library's own repairs."""
    from pyulog import ULog

    del most_bytes  # the whole file is read, which is no larger than it may be
    with broken_file():
        log = _ulog_log(ULog(path, disable_str_exceptions=True))
    yield log


def _ulog_log(file: Any) -> Log:
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


ULOG = log_format(opened_ulog, "ULog", ".ulg", ".ulog", needs="pyulog")

FORMAT = MDF, TDMS, ULOG
