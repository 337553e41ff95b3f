"""Names of the files around a recording, and the checks before one is started."""

from __future__ import annotations

import itertools
import os
import shutil
from pathlib import Path

from ema_model.files.lock import FileLock
from ema_model.files.whole_file import lock_path
from emaviz.recording.errors import RecordingError

MIN_FREE_BYTES = 200_000_000


def part_of(target: Path) -> Path:
    """NAME.rrd.part: where NAME.rrd grows until it is whole."""
    return target.with_name(target.name + ".part")


def free_name(folder: Path, stem: str, ending: str) -> Path:
    """folder/stem+ending, or stem-2, stem-3, … if that exists."""
    for number in itertools.count(1):
        path = folder / f"{stem}{'' if number == 1 else f'-{number}'}{ending}"
        if not path.exists():
            return path
    raise AssertionError("unreachable")


def free_bytes(folder: Path) -> int:
    """Bytes free for this user on the folder's disk."""
    return shutil.disk_usage(folder).free


def claim(target: Path, min_free_bytes: int) -> FileLock:
    """Checks that a recording can start at `target` and takes its lock.

    A part left there by a process that died is moved aside, for `recover` to find.
    Raises RecordingError: wrong name, no such folder, not writable, disk full, being recorded by another.
    """
    folder = target.parent
    if target.suffix != ".rrd":
        raise RecordingError(f"{target}: the name of a recording must end in .rrd")
    if target.is_dir():
        raise RecordingError(f"{target}: is a folder; a file name is needed")
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder; create it or record elsewhere")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise RecordingError(f"{folder}: not writable; record elsewhere")
    free = free_bytes(folder)
    if free < min_free_bytes:
        raise RecordingError(
            f"{folder}: {free / 1e6:.0f} MB free, {min_free_bytes / 1e6:.0f} MB are needed to record; free some space"
        )
    part = part_of(target)
    try:
        lock = FileLock.acquire(lock_path(part))
    except OSError as error:
        raise RecordingError(f"{folder}: cannot record there: {error.strerror}") from error
    if lock is None:
        raise RecordingError(f"{target}: is being recorded already; choose another name")
    if part.exists():
        part.rename(free_name(folder, f"{target.stem}-interrupted", ".rrd.part"))
    return lock
