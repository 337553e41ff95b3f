"""MCAP of ROS 2 and Foxglove: topics whose messages are CDR, Protobuf or JSON, each with its stamps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ema_model.recordings.formats.channels import Log
from ema_model.recordings.formats.logs import log_format

# A message's own stamp goes before the time at which it was logged.
_TIMELINES = ("ros2_timestamp", "timestamp", "message_publish_time", "message_log_time")
_JSON = "json"


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The numbers of all topics; NoLog for what rerun cannot read."""
    from rerun.chunk import McapReader

    from emaviz.formats.chunks import Chunks, told

    with told():
        info = McapReader(path, recover=True).info()
        if sum(one.uncompressed_size_bytes for one in info.compression) > most_bytes:
            raise MemoryError
        chunks = Chunks(_TIMELINES, most_bytes)
        decoders = [one for one in McapReader.available_decoders() if one not in ("raw", "schema", "stats", "urdf")]
        if any(channel.message_encoding == _JSON for channel in info.channels):
            decoders.append("raw")
        chunks.take(McapReader(path, decoders=decoders, recover=True).stream())
        log = chunks.log()
    yield log


FORMAT = log_format(__name__, "MCAP", ".mcap")
