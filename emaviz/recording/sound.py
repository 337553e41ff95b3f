"""The chunks of a Rerun file whose damage would end this process, looked at by a program of its own first.

Rerun's native reader aborts on some contents that cannot be decoded, and on a name with a NUL in it, which the C
interface between Arrow's libraries cannot hand on.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from emaviz.recording import binary
from emaviz.recording.errors import RecordingError

_TIMEOUT_S = 120.0
_NUL, _NUL_IN_A_TYPE = b"\0", b"\\0"  # as the program prints a name, and one within a type


def sound_chunks(path: Path, content: str | None = None) -> Iterator[Any]:
    """The chunks of a file (rerun.chunk.Chunk), of all entities or of one; RecordingError where they are no whole ones.

    Raises, too, whatever the native reader makes of damage that it survives.
    """
    try:
        binary.run("rrd", "verify", str(path), timeout_s=_TIMEOUT_S)
        with tempfile.TemporaryFile() as described:
            binary.run("rrd", "print", "-vv", str(path), timeout_s=_TIMEOUT_S, output=described)
            sound = not _has_nul(described)
    except RecordingError:  # its last line is about itself, or advice for its makers
        sound = False
    if not sound:
        raise RecordingError("its contents cannot be decoded")
    from rerun.chunk import RrdReader

    stream = RrdReader(path).stream()
    return iter(stream if content is None else stream.filter(content=content))


def _has_nul(described: IO[bytes]) -> bool:
    described.seek(0)
    return any(_NUL in line or (b" type: " in line and _NUL_IN_A_TYPE in line) for line in described)
