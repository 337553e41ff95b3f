"""The one place where numba's options stand.

`error_model="numpy"` lets LLVM vectorise the lanes (the default check for a division by zero blocks it).
Of fastmath only `contract` is allowed, a product and a sum rounded once: it makes the kernels a quarter
faster and changes nothing for NaN and infinity.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numba
from numba.core import config
from numba.core.codegen import get_host_cpu_features
from numba.extending import register_jitable

from ema_model.kernel_cache import kept

# Waiting threads sleep: spinning ones would take the cores from the browser, and from a kernel next to them.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")


def _take_whole_vectors() -> None:
    """On processors of Intel LLVM takes half of AVX-512's width, which saves some programs' clock and costs ours half.

    What somebody has said of the processor (NUMBA_CPU_FEATURES) stands.
    """
    settings: Any = config
    features = get_host_cpu_features()
    if settings.CPU_FEATURES is None and settings.CPU_NAME is None and "+avx512f" in features:
        settings.CPU_FEATURES = f"{features},-prefer-256-bit"


_take_whole_vectors()

_MODEL = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}

scalar: Callable[[Any], Any] = register_jitable(forceinline=True, no_cfunc_wrapper=True, **_MODEL)
"""A scalar piece of physics, inlined by LLVM into the kernel that calls it; Python runs it as it is written.

`forceinline` is what keeps a chain of such pieces vectorisable: one call left in the lane loop makes
the population kernel ten times slower.  Without ways in for Python and C, which numba makes for what it
compiles, the library's kernels are compiled in two thirds of the time, to the same machine code.
"""

passed_on: Callable[[Any], Any] = numba.njit(inline="always", **_MODEL)
"""A function that hands on its first argument: numba leaves it out, which saves its compilation."""

kernel: Callable[[Any], Any] = kept(numba.njit(**_MODEL))
"""An outer kernel of one thread.  Kept in the cache, so it must live in a package that `stacks` makes."""

parallel_kernel: Callable[[Any], Any] = kept(numba.njit(parallel=True, **_MODEL))
"""An outer kernel over blocks of lanes on all cores.  Call it through `stacks.exclusive` only."""

recursion: Callable[[Any], Any] = numba.njit(**_MODEL)
"""A loop over time that Python calls, of one thread; compiled anew in each process, so only what does so quickly."""
