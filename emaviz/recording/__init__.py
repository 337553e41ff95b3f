"""Recordings in Rerun's .rrd format: written, read back, repaired and shown.

rerun itself is imported where it is first used: it takes a second, and the app goes on where it is missing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from emaviz.recording.entry import RecordingError
from emaviz.recording.read import Recording, read

if TYPE_CHECKING:
    from emaviz.recording.writer import RecordingWriter

__all__ = ["Recording", "RecordingError", "RecordingWriter", "read"]


def __getattr__(name: str) -> Any:
    if name == "RecordingWriter":
        from emaviz.recording.writer import RecordingWriter

        return RecordingWriter
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
