"""One line of the data health card."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Severity = Literal["good", "note", "warning"]
MARKS: dict[Severity, str] = {"warning": "▲", "note": "●", "good": "✓"}  # before a sentence, the worst first


@dataclass(frozen=True)
class Finding:
    """What one check found: a plain sentence with its number and unit, and the numbers, units in their names."""

    check: str
    severity: Severity
    sentence: str
    values: dict[str, float] = field(default_factory=dict)
    signal: str | None = None
