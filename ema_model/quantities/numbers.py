"""Numbers as files and people write them: read, shown with so many digits, in a unit that suits their size."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

_PREFIXED = frozenset(("rad", "m", "A", "V", "N·m", "N", "rad/s", "m/s", "s"))
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SMALLEST = 0.3  # shown as it is; what is smaller gets the next prefix


def as_number(value: Any) -> float:
    """The number, or NaN for what is none (or too large to be one)."""
    try:
        return math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def number(value: float, digits: int = 3) -> str:
    """So many digits, without an exponent where that is readable: 0.0352, 1.30·10⁻⁵; – for what is no number."""
    if not math.isfinite(value):
        return "–"
    size = abs(value)
    if size != 0.0 and not 1e-4 <= size < 1e6:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        return f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    decimals = max(0, digits - 1 - (math.floor(math.log10(size)) if size else 0))
    return f"{value:.{min(decimals, 8)}f}".replace("-", "−")


@dataclass(frozen=True)
class Quantity:
    """shown = factor · value in SI units."""

    title: str
    unit: str
    factor: float = 1.0
    symbol: str = ""

    @property
    def short_label(self) -> str:
        """'I_eq [A]': for an axis that is too short for the title."""
        return f"{self.symbol or self.title} [{self.unit}]" if self.unit else self.symbol or self.title

    @property
    def label(self) -> str:
        """'Residual torque [mN·m]'."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def scaled(self, values: ArrayLike) -> Quantity:
        """With milli or micro where the largest of the values (in SI units) asks for it."""
        size = np.abs(np.asarray(values, dtype=float) * self.factor)
        largest = float(np.max(size[np.isfinite(size)], initial=0.0))
        if self.unit not in _PREFIXED or largest == 0.0:
            return self
        for factor, prefix in ((1.0, ""), (1e3, "m")):
            if largest * factor >= _SMALLEST:
                return replace(self, unit=prefix + self.unit, factor=self.factor * factor)
        return replace(self, unit="µ" + self.unit, factor=self.factor * 1e6)

    def text(self, value: float) -> str:
        """'35.2 mN·m', three digits."""
        return f"{number(value * self.factor)} {self.unit}".strip()
