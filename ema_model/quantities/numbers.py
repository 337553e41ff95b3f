"""Numbers as they are written: rounding, intervals, units' prefixes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from ema_model.errors import InputError, quoted
from ema_model.quantities.si import BY_SHOWN

# --- intervals as they are told: each holds 90 % ----------------------------------------------------------------------

HALF_90 = 1.645  # σ of a normal distribution, on either side


# --- round numbers in a range, for axes -------------------------------------------------------------------------------


def round_numbers(low: float, high: float, about: float, steps: Sequence[float] = ()) -> list[float]:
    """About so many from low to high: 1, 2 or 5 times a power of ten apart, or the first of the steps that suffices."""
    rough = ((high - low) or 1.0) / about
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(one for one in steps or (size, 2.0 * size, 5.0 * size, 10.0 * size) if one >= 0.999 * rough)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [step * i for i in range(first, last + 1)]


# --- numbers as files and people write them: read, shown with so many digits, in a unit that suits their size ---------

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SMALLEST = 0.09995  # reads as 0.1, and is shown as it is; what is smaller gets the next prefix
_FINE = 1e-3  # an error that takes the next prefix
_EXPONENT = 1e-4  # what is smaller is told by a power of ten
_LONGEST = 1e6  # likewise, from which on
_FINE_AT = 0.1  # from which on its value keeps three digits
_LARGEST = 9995.0  # likewise, from which on a kilo is taken
_PREFIXES = {-6: "µ", -3: "m", 3: "k", 6: "M"}  # by the power of ten
_WITHOUT_PREFIX = ("kg", "1/", "°")  # how units begin that take a power of ten in place of one


def as_number(value: Any) -> float:
    """The number, or NaN for what is none (or too large to be one)."""
    try:
        return math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def check_number(value: Any, what: str) -> None:
    """InputError for what is no number at all; NaN and infinity are left to the check of the range.

    what: the name in the error, "the sample rate".
    """
    if math.isnan(as_number(value)) and not isinstance(value, float | np.floating):
        raise InputError(f"{what} must be a number, not {quoted(repr(value), 40)}")


def check_seed(value: Any) -> None:
    """InputError for what cannot begin random numbers."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise InputError(f"the seed must be a whole number from 0 on, not {quoted(repr(value), 40)}")


def number(value: float, digits: int = 3) -> str:
    """So many digits, without an exponent where that is readable: 0.0352, 1.30·10⁻⁵; – for what is no number."""
    if not math.isfinite(value):
        return "–"
    size = abs(value)
    if size != 0.0 and not _EXPONENT <= size < _LONGEST:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        return f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    decimals = max(0, digits - 1 - (math.floor(math.log10(size)) if size else 0))
    return f"{value:.{min(decimals, 8)}f}".replace("-", "−")


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """The factor to the prefix in which numbers up to `largest` read well, and the unit with it: 1000, 'mA'.

    A number as large as 0.1 needs none: 0.2 A, but 35 mA.
    """
    known = BY_SHOWN.get(unit)
    prefixes = known.prefixes if known is not None and largest > 0.0 else ""
    if "k" in prefixes and largest >= _LARGEST:
        return 1e-3, f"k{unit}"
    if "m" not in prefixes or largest >= _SMALLEST:
        return 1.0, unit
    return (1e3, f"m{unit}") if 1e3 * largest >= _SMALLEST else (1e6, f"µ{unit}")


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
        """With the prefix that the largest of the values (in SI units) asks for."""
        size = np.abs(np.asarray(values, dtype=float) * self.factor)
        factor, unit = prefixed(float(np.max(size[np.isfinite(size)], initial=0.0)), self.unit)
        return replace(self, unit=unit, factor=self.factor * factor)

    def powered(self, values: ArrayLike) -> Quantity:
        """As `scaled`, of any unit: 'kN·m/rad', and where none is said with a prefix, 13.8 '10⁻⁶ kg·m²'."""
        scaled = self.scaled(values)
        size = np.abs(np.asarray(values, dtype=float) * scaled.factor)
        largest = float(np.max(size[np.isfinite(size)], initial=0.0))
        if largest == 0.0 or _SMALLEST <= largest < _LARGEST:
            return scaled
        power = 3 * math.floor(math.log10(largest) / 3.0)
        bare = self.unit.startswith(_WITHOUT_PREFIX) or not self.unit or power not in _PREFIXES
        unit = f"10{str(power).translate(_RAISED)} {self.unit}".rstrip() if bare else f"{_PREFIXES[power]}{self.unit}"
        return replace(self, unit=unit, factor=self.factor * 10.0**-power)

    def text(self, value: float) -> str:
        """'35.2 mN·m', three digits."""
        return f"{number(value * self.factor)} {self.unit}".strip()


def with_uncertainty(value: float, half: float, unit: str) -> str:
    """'12.2 ± 0.70 mN·m', '(13.9 ± 0.32)·10⁻⁶ kg·m²': half the width of an interval with two digits."""
    shown = Quantity("", unit).scaled(value)
    if 0.0 < shown.factor * half < _FINE:  # 703.000 ± 0.087 µrad, not 0.703 ± 8.7·10⁻⁵ mrad
        shown = Quantity("", unit).scaled(1e-3 * value)
    if shown.factor * abs(value) >= _LONGEST or any(0.0 < shown.factor * abs(one) < _EXPONENT for one in (value, half)):
        shown = Quantity("", unit).powered([value])
        power, _, bare = shown.unit.partition(" ")
        if power.startswith("10"):
            return f"({with_uncertainty(shown.factor * value, shown.factor * half, '')})·{power} {bare}".rstrip()
    error = number(shown.factor * half, 2)
    decimals = len(error.partition(".")[2])
    digits = 3 if "·" in error or shown.factor * half >= _FINE_AT else decimals + _before(shown.factor * value)
    return f"{number(shown.factor * value, max(digits, 3))} ± {error} {shown.unit}".rstrip()


def _before(value: float) -> int:
    """Digits before the point; none or less for what is smaller than one."""
    return math.floor(math.log10(abs(value))) + 1 if value else 0


def amount(value: float, unit: str) -> str:
    """A size with its unit, prefixed so that it reads well: '35.2 mN·m', and where none is, '13.0·10⁻⁶ kg·m²'."""
    shown = Quantity("", unit).scaled(value)
    if 0.0 < shown.factor * abs(value) < _EXPONENT:  # the power that an uncertainty has
        shown = shown.powered([value])
        if shown.unit.startswith("10"):
            return f"{number(shown.factor * value)}·{shown.unit}"
    return shown.text(value)


# --- numbers as JSON has them -----------------------------------------------------------------------------------------

_Value = TypeVar("_Value")


def plain(value: _Value) -> _Value:
    """The value in types that JSON has; numbers that are not finite are None."""
    return cast(_Value, _plain(value))


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value
