"""A scalar piece of physics as kernels have it: Python by itself runs its source, and raises where it has no value."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function by the kernels' arithmetic, to be called with numbers."""

    @numba.njit(error_model="numpy", fastmath={"contract"})
    def call(*values):
        return function(*values)

    return call
