"""A run with an effect beside the same run without: what the effect does, and which signal shows it most."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.recordings import Measurement

SHOWN = ("current_A", "user_position_rad", "motor_speed_rad_s")
_LEAST = 1e-3  # of a signal's range, rms


@dataclass(frozen=True, eq=False)
class WithEffect:
    """What an effect does in a run."""

    name: str
    run: str
    settings: Mapping[str, float]
    with_it: Measurement
    without: Measurement

    def change(self, name: str) -> tuple[float, NDArray[np.float64]]:
        """What changes in a signal, (samples,), and its rms as a share of the signal's range; 0 for next to nothing."""
        change = self.with_it[name] - self.without[name]
        share = float(np.sqrt(np.mean(change**2))) / (float(np.ptp(self.without[name])) or 1.0)
        return (share if share > _LEAST else 0.0), change

    @property
    def shows(self) -> str:
        """The signal that shows it most."""
        return max(SHOWN, key=lambda name: self.change(name)[0])

    @property
    def visibility(self) -> float:
        """How much of that signal's range changes, rms."""
        return self.change(self.shows)[0]
