"""The numbers that options take, checked while the options are read."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

from ema_model.files.refusal import shown


@dataclass(frozen=True)
class Number:
    """The type of an option that takes a finite number, from `low` to `high`."""

    low: float = -math.inf
    high: float = math.inf
    whole: bool = False

    def __call__(self, text: str) -> float:
        try:
            value = int(text) if self.whole else float(text)
        except ValueError:  # no number, or one of thousands of digits
            value = math.nan
        if not (self.low <= value <= self.high and math.isfinite(value)):
            raise argparse.ArgumentTypeError(f"must be {self._expected}, not {shown(text)!r}")
        return value

    @property
    def _expected(self) -> str:
        kind = "a whole number" if self.whole else "a finite number"
        return kind if math.isinf(self.low) else f"{kind} from {self.low} to {self.high}"


FINITE = Number()
SAMPLE_RATE = Number(1e-3, 1e9)  # Hz
SEED = Number(0, 2**63 - 1, whole=True)


def whole(low: int, high: int) -> Number:
    """The type of an option that takes a whole number from `low` to `high`."""
    return Number(low, high, whole=True)
