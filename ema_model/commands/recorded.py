"""A command taken from a recording."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ema_model.commands.command import Array, Command


@dataclass(frozen=True)
class Recorded(Command):
    """Samples of a command, linear between them (holding them adds 0.05 A to the fit), constant outside."""

    name = "recorded"
    title = "From a recording"
    time_s: Array = field(default_factory=lambda: np.zeros(1))
    command_rad: Array = field(default_factory=lambda: np.zeros(1))
    file: str = ""

    def at(self, time_s: Array) -> Array:
        return np.interp(time_s, self.time_s - self.time_s[0], self.command_rad)

    def settings(self) -> dict[str, Any]:
        return {"file": self.file, "samples": len(self.time_s)}
