"""What a recording says of itself in a list: its settings and what was found."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from ema_model.identification.run import algorithm_title
from ema_model.quantities.numbers import amount, number
from ema_model.quantities.titles import in_sentence, parameter_title, unit_of


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
        """The best answer: k, rmse_A, corrected_rmse_A (not in older files), error_percent, evaluations, elapsed_s,
        healthy, alarms, stopped.
        """
        return self.found.get(self.best or "")


def error_key(*answers: Mapping[str, Any] | None) -> str:
    """Of the error by which answers are compared: the corrected one where all of them have it."""
    have = all(answer.get("corrected_rmse_A") is not None for answer in answers if answer)
    return "corrected_rmse_A" if have else "rmse_A"


def error_said(answer: Mapping[str, Any], *others: Mapping[str, Any]) -> str:
    """An answer's error, by the key that it shares with others."""
    key = error_key(answer, *others)
    return f"{'corrected' if key == 'corrected_rmse_A' else 'uncorrected'} error {amount(answer[key], 'A')}"


def setting(name: str, value: Any) -> tuple[str, str]:
    """A setting as a person reads it: ('amplitude', '5.00 mrad') of ('amplitude_rad', '0.005')."""
    told = _told(value, unit_of(name))
    if name == "algorithms":
        told = ", ".join(algorithm_title(one) for one in told.split(", "))
    return in_sentence(parameter_title(name)), told


def _told(value: Any, unit: str) -> str:
    """A recording keeps its settings as text."""
    try:
        read = json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return str(value)
    if isinstance(read, bool) or not isinstance(read, int | float):
        return ", ".join(map(str, read)) if isinstance(read, list) else str(value)
    if isinstance(read, int) and not unit:
        return str(read)
    return amount(read, unit) if unit else number(read)
