"""Kernels are compiled once a host: whoever comes first compiles, the others wait and load what it has kept."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from ema_model import kernel_cache
from ema_model.files.written import FileLock

_LONGEST_S = 300.0  # to wait: a compilation takes seconds, and whoever holds the lock may have been stopped


class Turns:
    """Who may compile a kernel, by the file that it is kept in: one process of this host at a time."""

    def __init__(self) -> None:
        self._held: dict[Path, FileLock] = {}

    def begin(self, path: Path) -> None:
        """Returns when nobody else compiles this kernel."""
        if path in self._held:
            return
        with suppress(OSError):  # no lock to be had in that folder: each compiles for itself
            if (lock := FileLock.acquire(path.with_name(f"{path.name}.lock"), _LONGEST_S)) is not None:
                self._held[path] = lock

    def end(self, path: Path) -> None:
        """Lets the next one look for the kernel."""
        if (lock := self._held.pop(path, None)) is not None:
            lock.release()


def share_kernels() -> None:
    """Makes this process take turns with the others of its host."""
    if kernel_cache.turns is None:
        kernel_cache.turns = Turns()
