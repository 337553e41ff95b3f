"""Round numbers in a range, for axes."""

from __future__ import annotations

import math
from collections.abc import Sequence


def round_numbers(low: float, high: float, about: float, steps: Sequence[float] = ()) -> list[float]:
    """About so many from low to high: 1, 2 or 5 times a power of ten apart, or the first of the steps that suffices."""
    rough = ((high - low) or 1.0) / about
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(one for one in steps or (size, 2.0 * size, 5.0 * size, 10.0 * size) if one >= 0.999 * rough)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [step * i for i in range(first, last + 1)]
