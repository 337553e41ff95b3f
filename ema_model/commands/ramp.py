"""Ramp command (T 3.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.commands.command import Array, Command


@dataclass(frozen=True)
class Ramp(Command):
    """A constant speed from a start time on."""

    name = "ramp"
    place = 2  # the thesis's four come first
    title = "Ramp"
    slope_rad_s: float = 1e-3
    initial_rad: float = 0.0
    time_s: float = 0.0

    def at(self, time_s: Array) -> Array:
        return self.initial_rad + self.slope_rad_s * np.maximum(time_s - self.time_s, 0.0)
