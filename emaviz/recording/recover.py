"""Repairs what runs that were killed left behind."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from emaviz.recording.blueprint import Algorithm, Contents, build
from emaviz.recording.errors import RecordingError
from emaviz.recording.lock import FileLock
from emaviz.recording.paths import free_name, lock_of
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
    for part in sorted(folder.glob(f"*{_ENDING}")):
        try:
            lock = FileLock.acquire(lock_of(part))
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


def _recover(part: Path) -> Recovered:
    stem = part.name.removesuffix(_ENDING)
    if part.stat().st_size == 0:
        part.unlink()
        return Recovered(part, None, f"{part.name}: was empty and is removed")
    copy, layout = part.with_name(f"{part.name}.repaired"), part.with_name(f"{part.name}.rbl")
    try:
        repair(part, copy)
        # The layout comes last in a file, so a run that was killed has none.
        build(_contents(read(copy))).save(APPLICATION, layout)
        repair(part, copy, layout)
        read(copy)
    except RecordingError as error:
        copy.unlink(missing_ok=True)
        damaged = free_name(part.parent, stem, ".rrd.damaged")
        part.rename(damaged)
        return Recovered(part, damaged, f"{part.name}: cannot be repaired, kept as {damaged.name}: {error}")
    finally:
        layout.unlink(missing_ok=True)
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
