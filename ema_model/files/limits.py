"""How large a file from elsewhere may be: said here once, with the reason, and used by all that read one.

A few kilobytes can unpack to any size, so a limit bounds three things alike: the file on the disk, the numbers that are
taken from it (8 bytes each), and whatever is unpacked on the way to them.  A file within it is read in less than three
times the limit of memory, and any other is refused in one line: in 20 s, either.
"""

from __future__ import annotations

FILE_BYTES = 1_000_000_000  # a measurement, on the command line: hours at 1 kHz, and three of it fit into 4 GB
PAGE_BYTES = 250_000_000  # a measurement, or an upload, on the page, whose memory all its users share
SESSION_BYTES = 500_000_000  # all files of a session together, unpacked on the disk
SESSION_FILES = 200
SETTINGS_BYTES = 8_000_000  # a session's JSON, which takes up to 25 times that as Python's objects
CHALLENGE_BYTES = 32_000_000  # a sealed challenge and its parts: four recordings of seconds
CHALLENGE_RECORDING_BYTES = 64_000_000  # one of those, unpacked in turn
TEXT_BYTES = 100_000  # an actuator file or a side file, which people write by hand

COLUMNS = 2_000  # of a measurement: loggers of whole cars have hundreds
ARRAYS = 5 * COLUMNS  # of a .npz or .mat file, columns or not
RUNS = 10_000  # of a measurement: each is looked at by itself
LINE_BYTES = 1_000_000  # of a CSV file: a number takes up to 25


def megabytes(size: float) -> str:
    """A size as the refusals write it: 250 MB."""
    return f"{size / 1e6:.6g} MB"
