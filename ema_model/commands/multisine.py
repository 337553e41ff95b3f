"""Multisine command: several frequencies at once, for identification in one short test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ema_model.commands.command import Array, Command
from ema_model.errors import InputError


@dataclass(frozen=True)
class Multisine(Command):
    """The mean of sines with Schroeder's phases (IEEE Trans. Inf. Theory 16, 1970), which keep the peak low."""

    name = "multisine"
    title = "Multisine"
    amplitude_rad: float = 5e-3
    frequencies_Hz: tuple[float, ...] = (2.0, 6.0, 14.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.frequencies_Hz:
            raise InputError("multisine: frequencies_Hz must name one frequency or more (1+3+7)")
        if not all(0.0 < f < 1e4 for f in self.frequencies_Hz):
            raise InputError("multisine: frequencies_Hz must lie between 0 and 10000 Hz")

    def at(self, time_s: Array) -> Array:
        n = len(self.frequencies_Hz)
        phases = [-np.pi * i * (i + 1) / n for i in range(n)]
        waves = [np.sin(2.0 * np.pi * f * time_s + p) - np.sin(p) for f, p in zip(self.frequencies_Hz, phases)]
        return self.amplitude_rad * np.mean(waves, axis=0)
