"""The one error of this package that a user is meant to read."""

from __future__ import annotations


class RecordingError(OSError):
    """A recording cannot be written, read, repaired or shown.  Its message is one line: what, where, what to do."""
