"""Linear chirp command (T 3.8)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.commands.command import Array, Command
from ema_model.errors import InputError


@dataclass(frozen=True)
class Chirp(Command):
    """A sine whose frequency rises linearly until the end time and stays there: 2π(f₀t + ½(f₁ − f₀)t²/T)."""

    name = "chirp"
    place = 4  # the thesis's four come first
    title = "Chirp"
    amplitude_rad: float = 5e-3
    start_Hz: float = 0.0
    end_Hz: float = 15.0
    end_time_s: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.end_time_s <= 0.0:
            raise InputError(f"chirp: end_time_s must be above 0, not {self.end_time_s:g}")

    def at(self, time_s: Array) -> Array:
        swept = np.minimum(time_s, self.end_time_s)
        rise = (self.end_Hz - self.start_Hz) / self.end_time_s
        cycles = self.start_Hz * swept + 0.5 * rise * swept**2 + self.end_Hz * (time_s - swept)
        return self.amplitude_rad * np.sin(2.0 * np.pi * cycles)
