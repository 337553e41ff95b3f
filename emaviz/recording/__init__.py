"""Recordings in Rerun's .rrd format: written, read back, repaired and shown."""

from emaviz.recording.errors import RecordingError
from emaviz.recording.read import Recording, read
from emaviz.recording.writer import RecordingWriter

__all__ = ["Recording", "RecordingError", "RecordingWriter", "read"]
