"""The one place where numba's options stand.

`error_model="numpy"` lets LLVM vectorise the lanes (the default check for a division by zero blocks it).
Arithmetic stays strict IEEE: fastmath gains nothing here and would break the checks for NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba

scalar: Callable[[Any], Any] = numba.njit(forceinline=True, nogil=True, error_model="numpy")
"""A scalar piece of physics, inlined by LLVM into the kernel that calls it.

`forceinline` is what keeps a chain of such pieces vectorisable: one call left in the lane loop makes
the population kernel ten times slower.
"""

kernel: Callable[[Any], Any] = numba.njit(nogil=True, error_model="numpy", cache=True)
"""An outer kernel of one thread.  Cached, so it must live in a folder that `composition` writes."""

parallel_kernel: Callable[[Any], Any] = numba.njit(parallel=True, nogil=True, error_model="numpy", cache=True)
"""An outer kernel over blocks of lanes on all cores.  Call it through `composition.exclusive` only."""
