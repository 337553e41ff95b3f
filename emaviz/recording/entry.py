"""What a recording says of itself in a list: its settings and what was found."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any


@dataclass(frozen=True)
class Entry:
    """One recording of the folder."""

    name: str
    at: datetime
    size_bytes: int
    settings: dict[str, Any] = field(default_factory=dict)  # of an identification; empty for others
    found: dict[str, dict[str, Any]] = field(default_factory=dict)  # its answers by algorithm
    best: str | None = None  # the algorithm to believe
    kind: str = "run"  # identification, discovery, comparison …
    says: str = ""  # what came of it, in a line

    @property
    def answer(self) -> dict[str, Any] | None:
        """The best answer: k, rmse_A, error_percent, evaluations, elapsed_s, healthy, alarms, stopped."""
        return self.found.get(self.best or "")


def as_text(value: Any) -> str:
    """A setting as a person reads it."""
    return value if isinstance(value, str) else json.dumps(value)
