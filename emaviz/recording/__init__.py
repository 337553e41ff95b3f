"""Recordings in Rerun's .rrd format: written, read back, repaired and shown."""

from emaviz.recording.errors import RecordingError
from emaviz.recording.writer import RecordingWriter

__all__ = ["RecordingError", "RecordingWriter"]
