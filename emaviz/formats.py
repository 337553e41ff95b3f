"""Formats of recordings that rerun reads, which the science must not know: its own, and MCAP.

They join the family of `ema_model.recordings.formats` when this is imported, as the command line and the session do,
and do their work in the process that reads logs, so that rerun is loaded there alone.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.compute

from ema_model.recordings.formats import add_format
from ema_model.recordings.formats.channels import Channel, Log, NoLog, broken_file, log_format
from ema_model.recordings.formats.json import decoded, numbers_of_records

# --- Rerun's chunks as channels: each entity's numbers, on its timeline, whatever message they came from --------------

pc: Any = pyarrow.compute  # its functions are made when it is imported
_NAMES = "SeriesLines:names"
_RAW = "McapMessage:data"
_LEFT_OUT = ("McapChannel:", "McapSchema:", "McapStatistics:", "RecordingInfo:", "SeriesLines:", "CoordinateFrame:")
_MOST_WIDE = 64  # numbers of one sample of an array


class Chunks:
    """Collects the chunks of a file, entity by entity; a timeline of theirs is the entity's clock."""

    def __init__(self, timelines: Sequence[str], most_bytes: int) -> None:
        self._timelines, self._most_bytes, self._bytes = timelines, most_bytes, 0
        self._parts: dict[tuple[str, str, str], list[tuple[pa.Array, pa.Array]]] = {}
        self._names: dict[str, list[str]] = {}

    def take(self, stream: Iterable[Any]) -> None:
        """Takes all chunks of a stream."""
        for chunk in stream:
            batch = chunk.to_record_batch()
            self._bytes += batch.nbytes
            if self._bytes > 3 * self._most_bytes:
                raise NoLog("it unpacks to more than a measurement may take")
            entity = str(chunk.entity_path)
            columns = dict(zip(batch.schema.names, batch.columns))
            if _NAMES in columns and entity not in self._names:
                self._names[entity] = [str(name) for name in columns[_NAMES][0].as_py() or ()]
            times = [field.name for field in batch.schema if _is_time(field.type)]
            timeline = next((name for name in self._timelines if name in times), next(iter(times), ""))
            if chunk.is_static or entity.startswith("/__") or not timeline:
                continue
            for name, values in columns.items():
                if ":" in name and not name.startswith(_LEFT_OUT) and pa.types.is_list(values.type):
                    self._parts.setdefault((entity, name, timeline), []).append((columns[timeline], values))

    def has(self, root: str) -> bool:
        """Whether there are numbers below a root."""
        return any(entity.startswith(f"/{root}/") for entity, _, _ in self._parts)

    def log(self, notes: Sequence[str] = (), root: str = "") -> Log:
        """The channels of the entities below `root`."""
        channels: list[Channel] = []
        clocks: dict[str, Any] = {}
        aside: list[str] = []
        for (entity, name, timeline), parts in self._parts.items():
            if root and not entity.startswith(f"/{root}/"):
                continue
            path = tuple(part for part in entity.removeprefix(f"/{root}" if root else "").split("/") if part)
            stamps = pa.chunked_array([part[0] for part in parts])
            lists = pa.chunked_array([part[1] for part in parts]).combine_chunks()
            lengths = pc.fill_null(pc.list_value_length(lists), 0).to_numpy()
            if not lengths.size or lengths[0] == 0 or not (lengths == lengths[0]).all():
                aside.append(".".join(path))
                continue
            time = stamps.cast(pa.int64()).to_numpy() * 1e-9
            clock = f"{entity} {timeline}"
            clocks[clock] = lambda time=time: time
            values = lists.flatten()
            if name == _RAW:
                found = _json(values, path)
            else:
                found = list(_flat(values, path, int(lengths[0]), self._names.get(entity, ())))
            if not found:
                aside.append(".".join(path))
            for inner, numbers in found:
                holds = numbers.dtype.kind in "iub"
                channels.append(Channel(inner, numbers.size, lambda n=numbers: n, clock=clock, holds=holds))
        return Log(channels, clocks, notes=tuple(notes), left_aside=tuple(aside))


def _is_time(kind: pa.DataType) -> bool:
    return pa.types.is_timestamp(kind) or pa.types.is_duration(kind)


def _json(values: pa.Array, path: tuple[str, ...]) -> list[tuple[tuple[str, ...], np.ndarray]]:
    """What JSON messages hold, a record each."""
    texts = [one.values.to_numpy().tobytes() for one in values]
    try:
        records = decoded(b"[" + b",".join(texts) + b"]")
    except (ValueError, RecursionError):
        return []
    return [((*path, *inner), numbers) for inner, numbers in numbers_of_records(records)]


def _flat(
    values: pa.Array, path: tuple[str, ...], width: int, names: Sequence[str]
) -> Iterator[tuple[tuple[str, ...], np.ndarray]]:
    """Numbers, structs of them and lists of one length, `width` of them a sample."""
    kind = values.type
    if pa.types.is_struct(kind):
        for field in kind:
            yield from _flat(pc.struct_field(values, [field.name]), (*path, field.name), width, ())
    elif pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
        lengths = pc.fill_null(pc.list_value_length(values), 0).to_numpy()
        if lengths.size and 0 < lengths[0] * width <= _MOST_WIDE and (lengths == lengths[0]).all():
            yield from _flat(pc.list_flatten(values), path, width * int(lengths[0]), ())
    elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
        if values.null_count or width > _MOST_WIDE:
            return
        numbers = values.cast(pa.int8()).to_numpy() if pa.types.is_boolean(kind) else values.to_numpy()
        if width == 1:
            yield path, numbers
            return
        for i in range(width):
            own = names[i] if len(names) == width else f"{i}"
            yield (*path[:-1], f"{path[-1]}.{own}" if path else own), numbers[i::width]


# --- files of the Rerun viewer ----------------------------------------------------------------------------------------

_GROUPS = ("measurement", "reference", "monitor")  # of emaviz's own: the first that there is, is the recording
_TIMELINES = ("sim_time", "sensor_time", "time", "timestamp", "log_time")


@contextmanager
def opened_rrd(path: str, most_bytes: int) -> Iterator[Log]:
    """The numbers of all entities; NoLog for what rerun cannot read."""

    with broken_file():
        chunks = Chunks(_TIMELINES, most_bytes)
        chunks.take(_decoded(path))
        root = next((group for group in _GROUPS if chunks.has(group)), "")
        log = chunks.log([f"the {root}'s signals of a recording by emaviz"] if root else [], root)
    yield log


def _decoded(path: str) -> Iterator[Any]:
    """The chunks of a file.  Some damage ends the process of the native reader, which here is the sandbox's."""
    from rerun.chunk import RrdReader

    try:
        with broken_file():
            yield from RrdReader(path).stream()
    except NoLog:  # whose text is the native reader's, with the path in it
        raise NoLog("its contents cannot be decoded") from None


# --- whether an MCAP file's chunks unpack to what they declare, by the specification (mcap.dev/spec) ------------------
# Rerun's reader never ends on some chunks that do not; so each is unpacked here first, and its checksum compared.

_MAGIC = b"\x89MCAP0\r\n"
_CHUNK, _DATA_END, _FOOTER = 6, 15, 2
_CODECS = {"": None, "zstd": "zstd", "lz4": "lz4"}


def check(file: BinaryIO, most_bytes: int) -> None:
    """Raises NoLog for records that run beyond the file, chunks that do not unpack, and more than `most_bytes`."""
    length = file.seek(0, os.SEEK_END)
    file.seek(0)
    if file.read(len(_MAGIC)) != _MAGIC:
        raise NoLog("it does not begin as one")
    unpacked = 0
    while file.tell() < length - len(_MAGIC):
        head = file.read(9)
        if len(head) < 9:
            raise NoLog("it is cut short")
        kind, size = struct.unpack("<BQ", head)
        if size > length - file.tell():
            raise NoLog("it is cut short")
        if kind == _FOOTER:
            return
        if kind != _CHUNK:
            file.seek(size, os.SEEK_CUR)
            continue
        unpacked += _check_chunk(file.read(size), most_bytes - unpacked)
    raise NoLog("it has no footer")


def _check_chunk(record: bytes, most_bytes: int) -> int:
    """Bytes that a chunk unpacks to."""
    try:
        size, checksum, name_length = struct.unpack_from("<QII", record, 16)
        name = record[32 : 32 + name_length].decode("ascii")
        (packed_size,) = struct.unpack_from("<Q", record, 32 + name_length)
        packed = record[40 + name_length :]
    except (struct.error, UnicodeDecodeError):
        raise NoLog("a chunk has no head") from None
    if name not in _CODECS or packed_size != len(packed):
        raise NoLog("a chunk is packed in an unknown way")
    if size > most_bytes:
        raise NoLog("it unpacks to more than a measurement may take")
    codec = _CODECS[name]
    try:
        records = pa.decompress(packed, size, codec=codec) if codec else pa.py_buffer(packed)
    except (OSError, ValueError, pa.ArrowException):
        raise NoLog("a chunk does not unpack") from None
    if records.size != size or (checksum and zlib.crc32(records) != checksum):
        raise NoLog("a chunk unpacks to something else than it declares")
    at = 0
    while not checksum and at < size:  # its records are to be looked at one by one
        at += 9 + int.from_bytes(memoryview(records)[at + 1 : at + 9], "little")
        if at > size:
            raise NoLog("a message is cut short")
    return size


# --- MCAP of ROS 2 and Foxglove: topics whose messages are CDR, Protobuf or JSON, each with its stamps ----------------

# A message's own stamp goes before the time at which it was logged.
_MCAP_TIMELINES = ("ros2_timestamp", "timestamp", "message_publish_time", "message_log_time")
_JSON = "json"


@contextmanager
def opened_mcap(path: str, most_bytes: int) -> Iterator[Log]:
    """The numbers of all topics; NoLog for what rerun cannot read."""
    from rerun.chunk import McapReader

    with open(path, "rb") as file:
        check(file, most_bytes)
    with broken_file():
        info = McapReader(path).info()
        chunks = Chunks(_MCAP_TIMELINES, most_bytes)
        decoders = [one for one in McapReader.available_decoders() if one not in ("raw", "schema", "stats", "urdf")]
        if any(channel.message_encoding == _JSON for channel in info.channels):
            decoders.append("raw")
        chunks.take(McapReader(path, decoders=decoders).stream())
        log = chunks.log()
    yield log


add_format(log_format(opened_mcap, "MCAP", ".mcap"))
add_format(log_format(opened_rrd, "Rerun", ".rrd", doubtful=(".rrd",)))
