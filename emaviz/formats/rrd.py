"""Recordings of emaviz itself and of others for the Rerun viewer: the numbers of each entity on its timeline."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ema_model.recordings.formats.channels import Log, NoLog, broken_file
from ema_model.recordings.formats.logs import log_format

_GROUPS = ("measurement", "reference", "monitor")  # of emaviz's own: the first that there is, is the recording
_TIMELINES = ("sim_time", "sensor_time", "time", "timestamp", "log_time")


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The numbers of all entities; NoLog for what rerun cannot read."""
    from emaviz.formats.chunks import Chunks

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


FORMAT = log_format(__name__, "Rerun", ".rrd", doubtful=(".rrd",))
