"""MCAP files."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

import pyarrow as pa

from ema_model.recordings.formats.channels import Log, NoLog, broken_file, log_format

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
_TIMELINES = ("ros2_timestamp", "timestamp", "message_publish_time", "message_log_time")
_JSON = "json"


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The numbers of all topics; NoLog for what rerun cannot read."""
    from rerun.chunk import McapReader

    from emaviz.formats.rrd import Chunks

    with open(path, "rb") as file:
        check(file, most_bytes)
    with broken_file():
        info = McapReader(path).info()
        chunks = Chunks(_TIMELINES, most_bytes)
        decoders = [one for one in McapReader.available_decoders() if one not in ("raw", "schema", "stats", "urdf")]
        if any(channel.message_encoding == _JSON for channel in info.channels):
            decoders.append("raw")
        chunks.take(McapReader(path, decoders=decoders).stream())
        log = chunks.log()
    yield log


FORMAT = log_format(__name__, "MCAP", ".mcap")
