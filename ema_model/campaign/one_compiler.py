"""Kernels are compiled once a host: whoever comes first compiles, the others wait and load what it has kept."""

from __future__ import annotations

import time
from pathlib import Path

from ema_model.files.lock import FileLock
from ema_model.kernel_cache import kept

_POLL_S = 0.05
_LONGEST_S = 300.0  # to wait: a compilation takes seconds, and whoever holds the lock may have been stopped


class Turns:
    """Who may compile a kernel, by the file that it is kept in: one process of this host at a time."""

    def __init__(self) -> None:
        self._held: dict[Path, FileLock] = {}

    def begin(self, path: Path) -> None:
        """Returns when nobody else compiles this kernel."""
        until = time.monotonic() + _LONGEST_S
        while path not in self._held and time.monotonic() < until:
            try:
                lock = FileLock.acquire(path.with_name(f"{path.name}.lock"))
            except OSError:  # no lock to be had in that folder: each compiles for itself
                return
            if lock is not None:
                self._held[path] = lock
                return
            time.sleep(_POLL_S)

    def end(self, path: Path) -> None:
        """Lets the next one look for the kernel."""
        if (lock := self._held.pop(path, None)) is not None:
            lock.release()


def share_kernels() -> None:
    """Makes this process take turns with the others of its host."""
    if kept.turns is None:
        kept.turns = Turns()
