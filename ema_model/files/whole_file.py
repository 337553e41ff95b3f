"""A file that appears whole or not at all, whatever interrupts its writing."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ema_model.files.lock import FileLock

_DRAFT = re.compile(r"\.[0-9a-f]{16}\.part")
_LOCK = ".lock"  # behind the name of what is being written
_TRIES = 5


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Gives a draft to write, in the same folder; at the end it takes the file's place, after a failure it goes.

    A link is followed, so that it stays one.  Raises what writing the draft raises, and OSError.
    """
    target = Path(os.path.realpath(path))
    draft, lock = new_draft(target.parent)
    try:
        yield draft
        os.replace(draft, target)
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        if lock is not None:
            lock.release()


def new_draft(folder: Path) -> tuple[Path, FileLock | None]:
    """A hidden name in the folder, and the lock that tells `remove_abandoned` that its owner lives.

    The lock is None where the file system has none.  OSError if the folder cannot be written.
    """
    for _ in range(_TRIES):
        draft = folder / f".{secrets.token_hex(8)}.part"
        # Who removes abandoned drafts may come between the making of a lock's file and its locking.
        if (lock := FileLock.acquire(lock_path(draft))) is not None:
            return draft, lock
        lock_path(draft).unlink(missing_ok=True)
    return folder / f".{secrets.token_hex(8)}.part", None


def lock_path(path: Path) -> Path:
    """NAME.lock: locked as long as the process lives that writes NAME."""
    return path.with_name(path.name + _LOCK)


def remove_abandoned(folder: str | os.PathLike[str]) -> None:
    """Removes the drafts and locks in the folder whose processes were killed; those of living ones stay.

    A recording that was cut off (NAME.rrd.part) stays as well, and loses its lock only.  Raises no OSError.
    """
    with suppress(OSError):
        names = os.listdir(folder)
        locked = {name.removesuffix(_LOCK) for name in names if name.endswith(_LOCK)}
        recordings = {name for name in locked if name.endswith(".rrd.part")}
        for name in {*filter(_DRAFT.fullmatch, {*names, *locked}), *recordings}:
            _remove(Path(folder, name))


def _remove(path: Path) -> None:
    with suppress(OSError):
        if (lock := FileLock.acquire(lock_path(path))) is None:
            return
        try:
            if _DRAFT.fullmatch(path.name):
                path.unlink(missing_ok=True)
        finally:
            lock.release()
