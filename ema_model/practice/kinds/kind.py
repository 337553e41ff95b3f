"""What a kind of challenge does with its truth, as its own file tells it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ema_model.actuator import Actuator
from ema_model.text import InWords

Truth = Mapping[str, Any]
Progress = Callable[[str, float], object]  # what goes on, and how much of it is done, 0 … 1


@dataclass(frozen=True)
class Revealed:
    """The answer: sentences, and whether what was found agrees; None where nothing was found yet."""

    lines: tuple[str, ...]
    agrees: bool | None = None


class Kind(ABC):
    """KeyError, TypeError or ValueError from these tell a truth that makes no sense."""

    @abstractmethod
    def make(self, truth: Truth, actuator: Actuator, folder: Path, tell: Progress) -> None:
        """Writes the recordings into an empty folder."""

    @abstractmethod
    def reveal(self, truth: Truth, actuator: Actuator, found: InWords | None) -> Revealed:
        """found: what was found in them, of the kind of result that the challenge is about."""

    @abstractmethod
    def command(self, folder: str, thresholds: Mapping[str, float]) -> str:
        """The command line that goes on."""
