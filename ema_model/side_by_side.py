"""Simulations side by side in threads, as many at once as numba may use.

A kernel of one thread leaves Python free while it runs.  The windows of a fit are simulated side by side, and so are
the blocks of lanes of each: a descent's step is one block or two, and would leave most of the cores idle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from functools import cache
from typing import Any, TypeVar

import numba.core.config

from ema_model.stacks import refuse_after_fork

T = TypeVar("T")
R = TypeVar("R")

_settings: Any = numba.core.config


def windows(simulated: Callable[[T], R], each: Sequence[T]) -> list[R]:
    """What is simulated of each window, in their order; each may have blocks."""
    return _all("window", simulated, each)


def blocks(simulate: Callable[[slice], object], count: int) -> None:
    """Calls simulate(rows) for each block of lanes; ForkedError as of `stacks.find_stack`."""
    refuse_after_fork()
    _all("block", simulate, [slice(block, block + 1) for block in range(count)])


def _all(of: str, work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    threads = int(_settings.NUMBA_NUM_THREADS)
    if threads == 1 or len(items) < 2:
        return [work(one) for one in items]
    contexts = [copy_context() for _ in items]  # what numpy ignores here, it ignores there
    return list(_pool(of, threads).map(lambda context, one: context.run(work, one), contexts, items))


@cache
def _pool(of: str, threads: int) -> ThreadPoolExecutor:
    """A pool for each: what waits in one for the other never waits for itself."""
    return ThreadPoolExecutor(threads, thread_name_prefix=of)
