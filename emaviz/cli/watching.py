"""A folder that recordings arrive in: which of them are whole."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

LOOK_S = 1.0  # between two looks


class Watched:
    """Files as they grow: one is whole once it is as it was at the look before."""

    def __init__(self) -> None:
        self._seen: dict[Path, tuple[int, int]] = {}

    def whole(self, paths: Iterable[Path]) -> list[Path]:
        """Those that have not changed since the last call; to be called every `LOOK_S`."""
        before, self._seen = self._seen, {}
        for path in paths:
            try:
                at = path.stat()
            except OSError:  # it is gone again
                continue
            self._seen[path] = at.st_size, at.st_mtime_ns
        return [path for path, at in self._seen.items() if before.get(path) == at]
