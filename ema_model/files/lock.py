"""A file lock that dies with its process: tells a recording being written from one left behind."""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from pathlib import Path

import filelock

_NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.EINVAL)  # what such file systems answer


class FileLock:
    """An exclusive lock on `path`, held from `acquire` to `release` or the end of the process.

    The operating system drops the lock when the process ends in whatever way, so that, unlike a process
    number written in a file, it never outlives its owner and cannot be mistaken for another's.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        # Where a file system has no such locks, a marker that outlives a killed process is no substitute.
        self._lock = filelock.FileLock(path, thread_local=False, fallback_to_soft=False)

    @classmethod
    def acquire(cls, path: Path, wait_s: float = 0.0) -> FileLock | None:
        """The lock, or None if somebody living still holds it after `wait_s`, or the file system has none.

        OSError if the folder cannot be written.
        """
        if not path.parent.is_dir():  # which filelock would make
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path.parent))
        taken = cls(path)
        try:
            taken._lock.acquire(wait_s)
        except filelock.Timeout:
            return None
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                raise
            return None
        return taken

    @staticmethod
    def is_held(path: Path) -> bool:
        """Whether somebody living holds the lock; a file that a killed process left is no lock."""
        if not path.exists():
            return False
        try:
            lock = FileLock.acquire(path)
        except OSError:
            return False
        if lock is not None:
            lock.release()
        return lock is None

    def release(self) -> None:
        """Removes the file and unlocks; a second call does nothing."""
        if self._lock.is_locked:
            with suppress(OSError):  # while it is held: another's must not go; Windows keeps open files
                self.path.unlink(missing_ok=True)
            self._lock.release()
