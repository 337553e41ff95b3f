"""Recordings of emaviz itself and of others for the Rerun viewer: the numbers of each entity on its timeline."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
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
        chunks.take(_sound(path))
        root = next((group for group in _GROUPS if chunks.has(group)), "")
        log = chunks.log([f"the {root}'s signals of a recording by emaviz"] if root else [], root)
    yield log


def _sound(path: str) -> Iterator[Any]:
    from emaviz.recording.entry import RecordingError
    from emaviz.recording.read import sound_chunks

    try:
        return sound_chunks(Path(path))
    except RecordingError as error:
        raise NoLog(str(error)) from None


FORMAT = log_format(__name__, "Rerun", ".rrd", doubtful=(".rrd",))
