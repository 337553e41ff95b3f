"""A file that appears whole or not at all, whatever interrupts its writing."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ema_model.errors import InputError
from ema_model.files.lock import FileLock
from ema_model.files.user_file import open_user_file

_DRAFT = re.compile(r"\.[0-9a-f]{16}\.part")
_LOCK = ".lock"  # behind the name of what is being written
_TRIES = 5
_LONGEST_S = 10.0  # to wait for another who changes the same file, which takes milliseconds


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


def change_file(path: str | os.PathLike[str], change: Callable[[str], str], most_bytes: int) -> None:
    """Writes what `change` makes of the file's text, whole; of several who change it at once, each sees the last.

    What is no file of UTF-8 text of at most so many bytes counts as empty.  Raises what `change` raises, and OSError.
    """
    target = Path(os.path.realpath(path))
    lock = None
    with suppress(OSError):  # where no lock is to be had, the last one's text stands
        lock = FileLock.acquire(lock_path(target), _LONGEST_S)
    try:
        text = change(_text_of(target, most_bytes))
        with whole_file(target) as draft:
            draft.write_text(text, encoding="utf-8", newline="")
    finally:
        if lock is not None:
            lock.release()


def _text_of(path: Path, most_bytes: int) -> str:
    try:
        with open_user_file(path, "a text", most_bytes) as file:
            return file.read().decode("utf-8")
    except (InputError, OSError, UnicodeDecodeError):
        return ""


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

    A recording that was cut off (NAME.rrd.part) and a file that was to be changed (NAME.toml) stay as well, and lose
    their locks only.  Raises no OSError.
    """
    with suppress(OSError):
        names = os.listdir(folder)
        locked = {name.removesuffix(_LOCK) for name in names if name.endswith(_LOCK)}
        kept = {name for name in locked if name.endswith((".rrd.part", ".toml"))}
        for name in {*filter(_DRAFT.fullmatch, {*names, *locked}), *kept}:
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
