"""Simulations side by side in threads, as many at once as numba may use.

A kernel of one thread leaves Python free while it runs.  Fits that do not need each other go on side by side, so do
the windows of each, and the blocks of lanes of each window: a descent's step is one block or two, and would leave most
of the cores idle.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextvars import copy_context
from functools import cache
from queue import Empty, SimpleQueue
from threading import Event
from typing import Any, TypeVar

import numba.core.config

from ema_model.stacks import refuse_after_fork

T = TypeVar("T")
R = TypeVar("R")

Tell = Callable[[str], None]

_settings: Any = numba.core.config
_SEEN_S = 0.02  # in which what a fit tells is passed on


class _Stopped(Exception):
    """A fit that goes on beside one that was stopped ends where it would tell how far it is."""


def fits(fitted: Callable[[T, Tell], R], each: Sequence[T], tell: Tell) -> list[R]:
    """What is fitted of each, in their order; each may have windows.

    What they tell is told in the caller's thread.  Where tell raises, to stop, all of them end first.
    """
    if _threads() == 1 or len(each) < 2:
        return [fitted(one, tell) for one in each]
    told: SimpleQueue[str] = SimpleQueue()
    stopped = Event()

    def say(text: str) -> None:
        if stopped.is_set():
            raise _Stopped
        told.put(text)

    begun = [_pool("fit", _threads()).submit(copy_context().run, fitted, one, say) for one in each]
    try:
        while not all(one.done() for one in begun) or not told.empty():
            try:
                tell(told.get(timeout=_SEEN_S))
            except Empty:
                continue
    except BaseException:
        stopped.set()
        for one in begun:
            one.cancel()
        wait(begun)
        raise
    return [one.result() for one in begun]


def windows(simulated: Callable[[T], R], each: Sequence[T]) -> list[R]:
    """What is simulated of each window, in their order; each may have blocks."""
    return _all("window", simulated, each)


def blocks(simulate: Callable[[slice], object], count: int) -> None:
    """Calls simulate(rows) for each block of lanes; ForkedError as of `stacks.find_stack`."""
    refuse_after_fork()
    _all("block", simulate, [slice(block, block + 1) for block in range(count)])


def _all(of: str, work: Callable[[T], R], items: Sequence[T]) -> list[R]:
    if _threads() == 1 or len(items) < 2:
        return [work(one) for one in items]
    contexts = [copy_context() for _ in items]  # what numpy ignores here, it ignores there
    return list(_pool(of, _threads()).map(lambda context, one: context.run(work, one), contexts, items))


def _threads() -> int:
    return int(_settings.NUMBA_NUM_THREADS)


@cache
def _pool(of: str, threads: int) -> ThreadPoolExecutor:
    """A pool for each: fits wait for windows, and windows for blocks, none for its own."""
    return ThreadPoolExecutor(threads, thread_name_prefix=of)
