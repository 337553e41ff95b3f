"""An error in floors beside what a true model's is: the one place of its number, its words, and its colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.comparison.residuals import Residuals
from ema_model.estimation import Floor
from ema_model.estimation.noise import POSITIONS, SPEED, band, least, spread
from ema_model.models import Window
from ema_model.quantities import number
from ema_model.text import Severity

_FAR = 2.0  # floors, from which on an error stands out, where a true model's is not as large


@dataclass(frozen=True)
class OverFloor:
    """rms of measurement − model over the floor of the same moment: 1 is the floor.

    Whether it is above its band is decided by the digits that are shown, so that words, colours and numbers agree.
    """

    error: float = math.nan
    band: tuple[float, float] = (math.nan, math.nan)  # between which nine of ten true models' errors lie

    @property
    def text(self) -> str:
        """'1.08'."""
        return number(self.error)

    @property
    def band_text(self) -> str:
        """'0.96 to 1.04'."""
        low, high = self.band
        return f"{low:.2f} to {high:.2f}"

    @property
    def is_above(self) -> bool:
        """Whether more is left than nine of ten true models leave."""
        return round(self.error, 2) > round(self.band[1], 2)

    @property
    def is_below(self) -> bool:
        """Whether less is left than they leave, so that the floor is estimated too high."""
        return round(self.error, 2) < round(self.band[0], 2)

    @property
    def severity(self) -> Severity:
        """Good up to the end of its band."""
        if math.isnan(self.error):
            return "note"
        return "good" if not self.is_above else "warning" if self.error < _FAR else "bad"

    @property
    def more(self) -> str:
        """'8 % more is left than noise explains' of a true model's error; "" where no more is."""
        if not self.is_above:
            return ""
        much = f"{100.0 * (self.error - 1.0):.0f} % more" if self.error < _FAR else "more"
        return f"{much} is left than noise explains"

    @property
    def beside_band(self) -> str:
        """'1.08 times the floor; a true model's is 0.96 to 1.04 (90 % interval): 8 % more is left than …'"""
        told = f"{self.text} times the floor; a true model's is {self.band_text} (90 % interval)"
        if self.is_below:
            return f"{told}: the floor is estimated too high"
        return f"{told}: {self.more}" if self.more else told


UNKNOWN = OverFloor()


def is_counted(signal: str, among: Sequence[str]) -> bool:
    """Whether a signal's error is pooled: a speed is mostly a position's difference, and counts where there is none."""
    return signal != SPEED or not set(POSITIONS) & set(among)


def squares(residuals: Residuals, signal: str, among: NDArray[np.bool_] | None = None) -> tuple[float, float]:
    """Sum of the squared error over the floor, and of what its blocks count; none at the drive's limits.

    among: (blocks,), those to take; all without it.
    """
    used = np.isfinite(residuals.values[signal]) & ~residuals.saturated
    used = used if among is None else used & among
    weights = (np.ones(residuals.blocks) if residuals.counts is None else residuals.counts)[used]
    ratio = residuals.values[signal][used] / residuals.sigma[signal][used]
    return float(weights @ ratio**2), float(weights.sum())


def ratio(residuals: Residuals, signals: Sequence[str], among: NDArray[np.bool_] | None = None) -> float:
    """rms of the error over its floor, pooled over signals; 0 where nothing is counted."""
    squared, counted = np.sum([squares(residuals, name, among) for name in signals], axis=0)
    return float(np.sqrt(squared / counted)) if counted else 0.0


def by_signal(
    residuals: Residuals, windows: Sequence[Window], floors: Sequence[Floor], recording: int | None = None
) -> dict[str, OverFloor]:
    """The error of each signal alone, with its own band; recording: the one, from 0, that counts; all without it."""
    parts = [(one, part) for one, part in zip(windows, floors) if recording in (None, one.recording)]
    among = None if recording is None else residuals.recording == recording
    found = {}
    for name in residuals.values:
        its = [part for window, part in parts if name in window.measured]
        if its and squares(residuals, name, among)[1]:
            names = [[name]] * len(its)
            found[name] = OverFloor(ratio(residuals, [name], among), band(spread(its, names), least(its, names)))
    return found
