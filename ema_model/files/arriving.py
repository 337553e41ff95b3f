"""A folder that recordings arrive in: which of them are whole."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

LOOK_S = 1.0  # between two looks
_As = tuple[int, int]  # size and time of the last change


class Watched:
    """Files as they grow: one has arrived once it is as it was at the look before, and again if it changes later."""

    def __init__(self) -> None:
        self._seen: dict[Path, _As] = {}
        self._arrived: dict[Path, _As] = {}

    def arrived(self, paths: Iterable[Path]) -> list[Path]:
        """Those that have stopped growing since the last call; to be called every `LOOK_S`."""
        before, self._seen = self._seen, {}
        for path in paths:
            try:
                at = path.stat()
            except OSError:  # it is gone again
                continue
            self._seen[path] = at.st_size, at.st_mtime_ns
        new = {path: at for path, at in self._seen.items() if before.get(path) == at != self._arrived.get(path)}
        self._arrived |= new
        return [*new]

    def take(self, paths: Iterable[Path]) -> None:
        """These count as arrived, as they were seen last."""
        self._arrived |= {path: self._seen[path] for path in paths if path in self._seen}

    def forget(self, paths: Iterable[Path]) -> None:
        """These arrive once more."""
        for path in paths:
            self._arrived.pop(path, None)
