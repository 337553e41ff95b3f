"""Sine command (T 3.7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.commands.command import Array, Command


@dataclass(frozen=True)
class Sine(Command):
    """A sine about a bias."""

    name = "sine"
    place = 3  # the thesis's four come first
    title = "Sine"
    amplitude_rad: float = 5e-3
    frequency_Hz: float = 15.0
    bias_rad: float = 0.0

    def at(self, time_s: Array) -> Array:
        return self.bias_rad + self.amplitude_rad * np.sin(2.0 * np.pi * self.frequency_Hz * time_s)
