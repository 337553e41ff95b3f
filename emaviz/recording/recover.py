"""Repairs recordings that runs left behind when they were killed."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from ema_model.errors import InputError
from ema_model.files.lock import FileLock
from ema_model.files.user_file import check_user_file
from ema_model.files.whole_file import lock_path, whole_file
from emaviz.recording.blueprint import Algorithm, Contents, build
from emaviz.recording.errors import RecordingError
from emaviz.recording.paths import free_name
from emaviz.recording.read import Recording, read, repair
from emaviz.recording.style import APPLICATION

_ENDING = ".rrd.part"


@dataclass(frozen=True)
class Recovered:
    """What became of one part; `path` is the recording, the damaged rest, or None if there was nothing in it."""

    part: Path
    path: Path | None
    message: str  # one line, for the user

    @property
    def ok(self) -> bool:
        """Whether there is a recording now."""
        return self.path is not None and self.path.suffix == ".rrd"

    def __str__(self) -> str:
        return self.message


def recover(folder: str | Path) -> list[Recovered]:
    """Repairs every .rrd.part in the folder whose writer is dead; one entry each, in order of name.

    An existing recording is never overwritten, and a part goes only after its repaired copy was read.  No error is
    raised for a part: it says so in its entry.  RecordingError if there is no such folder.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise RecordingError(f"{folder}: no such folder")
    found = []
    for part in sorted(path for path in folder.glob(f"*{_ENDING}") if path.is_file()):
        try:
            lock = FileLock.acquire(lock_path(part))
        except OSError as error:
            found.append(Recovered(part, part, f"{part.name}: cannot be recovered: {error.strerror}"))
            continue
        if lock is None:  # still being written
            continue
        try:
            if part.exists():  # its writer may have finished it in the meantime
                found.append(_recover(part))
        except OSError as error:
            found.append(Recovered(part, part, f"{part.name}: cannot be recovered: {error}"))
        finally:
            lock.release()
    return found


def recover_part(part: Path, target: Path, *, replace: bool = False) -> None:
    """Makes the whole recording `target` of one that was cut off, which then goes.

    RecordingError, and all stays as it was: the part is still being written, nothing in it can be read, the target
    exists (unless `replace`) or cannot be written.
    """
    _check_part(part)
    if target.suffix != ".rrd":
        raise RecordingError(f"{target}: the name of a recording must end in .rrd")
    if target.exists() and not replace:
        raise RecordingError(f"{target}: exists already; name another file with --out, or replace it with --force")
    try:
        lock = FileLock.acquire(lock_path(part))
        if lock is None:
            raise RecordingError(f"{part}: is still being written; end what writes it first")
        try:
            with whole_file(target) as draft:
                write_whole(part, draft)
            part.unlink()
        finally:
            lock.release()
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{target}: cannot be written ({error.strerror}); check the folder") from None


def write_whole(part: Path, copy: Path) -> None:
    """Writes what a part holds so far to `copy`, with a layout; RecordingError if that is nothing."""
    _check_part(part)
    try:
        repair(part, copy)
        # The layout comes last in a file, so a run that was killed has none.
        with tempfile.TemporaryDirectory(prefix="emaviz-") as folder:
            layout = Path(folder, "layout.rbl")
            build(_contents(read(copy))).save(APPLICATION, layout)
            repair(part, copy, layout)
        read(copy)
    except RecordingError as error:
        raise RecordingError(f"{part}: cannot be repaired: {error}") from None


def _check_part(part: Path) -> None:
    try:
        status = check_user_file(part, "a recording that was cut off (.part)")
    except InputError as error:
        raise RecordingError(str(error)) from None
    if status.st_size == 0:
        raise RecordingError(f"{part}: is empty; there is nothing to recover")


def _recover(part: Path) -> Recovered:
    stem = part.name.removesuffix(_ENDING)
    if part.stat().st_size == 0:
        part.unlink()
        return Recovered(part, None, f"{part.name}: was empty and is removed")
    copy = part.with_name(f"{part.name}.repaired")
    try:
        write_whole(part, copy)
    except RecordingError as error:
        copy.unlink(missing_ok=True)
        damaged = free_name(part.parent, stem, ".rrd.damaged")
        part.rename(damaged)
        return Recovered(part, damaged, f"{error}; kept as {damaged.name}")
    path = _publish(copy, part.with_name(f"{stem}.rrd"))
    part.unlink()
    return Recovered(part, path, f"{path.name}: recovered from a run that was interrupted")


def _contents(recording: Recording) -> Contents:
    return Contents(
        signals={group: list(signals) for group, signals in recording.signals.items()},
        algorithms={
            name: Algorithm(bool(len(trace.iteration)), bool(trace.monitor), trace.result is not None)
            for name, trace in recording.identification.items()
        },
        config=recording.config is not None,
    )


def _publish(copy: Path, target: Path) -> Path:
    """Gives the copy its name, or the next free one."""
    if target.exists():
        target = free_name(target.parent, f"{target.stem}-recovered", ".rrd")
    os.rename(copy, target)
    return target
