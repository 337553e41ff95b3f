"""Step command (T 3.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.commands.command import Array, Command


@dataclass(frozen=True)
class Step(Command):
    """From one position to another at a time; the thesis's 1 rad cannot be reached within 0.5 s."""

    name = "step"
    place = 1  # the thesis's four come first
    title = "Step"
    initial_rad: float = 0.0
    final_rad: float = 1.0
    time_s: float = 0.01

    def at(self, time_s: Array) -> Array:
        return np.where(time_s < self.time_s - 1e-12, self.initial_rad, self.final_rad)
