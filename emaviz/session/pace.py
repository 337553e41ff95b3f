"""How far a job is that tells in words what it does: as far as its last run was when it said the same."""

from __future__ import annotations

import re

_NUMBERS = re.compile(r"\d+([.,]\d+)?")


class Pace:
    """Of jobs by their titles.  The first run of each has nothing to go by; later ones have the run before."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[dict[str, float], float]] = {}  # when each text was said first, and the whole, s
        self._title, self._said = "", dict[str, float]()

    def begin(self, title: str) -> None:
        """A run begins."""
        self._title, self._said = title, {}

    def at(self, text: str, elapsed_s: float) -> float | None:
        """It says this after that time; returns its share that is done, 0 … 1, if that is known."""
        step = _NUMBERS.sub("#", text)
        self._said.setdefault(step, elapsed_s)
        times, whole = self._known.get(self._title, ({}, 0.0))
        if step not in times or not whole > 0.0:
            return None
        since = elapsed_s - self._said[step]
        later = min((one for one in times.values() if one > times[step]), default=whole)
        return min(min(times[step] + since, later) / whole, 0.99)

    def end(self, elapsed_s: float) -> None:
        """It came to its end, and is what the next one is measured by."""
        self._known[self._title] = self._said, elapsed_s
