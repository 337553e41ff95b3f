"""Which effects and faults look so much alike in these recordings that no refit would tell them apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SAME_CHI2 = 25.0  # between two of them, below which they cannot be told apart
_SAME_DIRECTION = 1.0 - 0.98**2  # sin² between their signatures, likewise


def alike(signatures: Mapping[str, Array]) -> dict[str, tuple[str, ...]]:
    """Effects and faults whose signatures no refit is expected to tell apart, by name."""
    return {
        name: tuple(other for other, its in signatures.items() if other != name and _same(own, its))
        for name, own in signatures.items()
    }


def _same(one: Array, other: Array) -> bool:
    first, second, shared = one @ one, other @ other, one @ other
    if min(first, second) == 0.0:
        return False
    apart = 1.0 - max(shared, 0.0) ** 2 / (first * second)
    return bool(apart < _SAME_DIRECTION or max(first, second) * apart < _SAME_CHI2)
