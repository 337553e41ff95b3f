"""Numbers as files and people write them."""

from __future__ import annotations

import math
from typing import Any


def as_number(value: Any) -> float:
    """The number, or NaN for what is none (or too large to be one)."""
    try:
        return math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
