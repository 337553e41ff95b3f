"""MCAP of ROS 2 and Foxglove: topics whose messages are CDR, Protobuf or JSON, each with its stamps."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ema_model.recordings.formats.channels import Log, broken_file
from ema_model.recordings.formats.logs import log_format
from emaviz.formats import mcap_chunks

# A message's own stamp goes before the time at which it was logged.
_TIMELINES = ("ros2_timestamp", "timestamp", "message_publish_time", "message_log_time")
_JSON = "json"


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The numbers of all topics; NoLog for what rerun cannot read."""
    from rerun.chunk import McapReader

    from emaviz.formats.chunks import Chunks

    with open(path, "rb") as file:
        mcap_chunks.check(file, most_bytes)
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
