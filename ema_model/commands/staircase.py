"""Staircase command: equal steps with a dwell on each, for standstill and quasi-static behaviour."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.commands.command import Array, Command
from ema_model.errors import InputError


@dataclass(frozen=True)
class Staircase(Command):
    """Rises by one step after every dwell."""

    name = "staircase"
    title = "Staircase"
    step_rad: float = 2e-3
    dwell_s: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.dwell_s <= 0.0:
            raise InputError(f"staircase: dwell_s must be above 0, not {self.dwell_s:g}")

    def at(self, time_s: Array) -> Array:
        return self.step_rad * np.floor(time_s / self.dwell_s + 1e-9)
