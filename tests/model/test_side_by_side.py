"""Windows and blocks side by side: in order, nested, with errors and numpy's settings as without threads."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from numba.core import config

from ema_model import side_by_side
from ema_model.side_by_side import blocks, fits, windows


@pytest.fixture(params=[1, 2, 3])
def threads(request, monkeypatch):
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", request.param)
    return request.param


def test_what_is_simulated_comes_in_order_also_nested(threads):
    """Each of ten windows waits for its own seven blocks, and none of the windows for ever."""

    def window(place: int) -> list[int]:
        found = [0] * 7

        def block(rows: slice) -> None:
            found[rows.start] = 10 * place + rows.stop

        blocks(block, 7)
        return found

    assert windows(window, range(10)) == [[10 * place + i for i in range(1, 8)] for place in range(10)]


def test_as_many_run_at_once_as_there_are_threads(threads):
    together = threading.Barrier(threads, timeout=20.0)
    windows(lambda place: together.wait(), range(threads))


def test_an_error_comes_out_and_the_next_call_works(threads):
    with pytest.raises(ZeroDivisionError):
        windows(lambda place: 1 // (place - 2), range(5))
    assert windows(lambda place: place, range(3)) == [0, 1, 2]


def test_what_numpy_ignores_is_ignored_in_threads_too(threads):
    def overflows(place: int) -> float:
        return float(np.square(np.array([1e300]))[0])

    with np.errstate(over="ignore"):
        assert windows(overflows, range(3)) == [np.inf] * 3
    with np.errstate(over="raise"), pytest.raises(FloatingPointError):
        windows(overflows, range(3))


def test_a_single_one_needs_no_thread(monkeypatch):
    monkeypatch.setattr(side_by_side, "_pool", None)
    names = windows(lambda place: threading.current_thread().name, range(1))
    assert names == [threading.current_thread().name]


def test_fits_come_in_order_and_tell_in_the_callers_thread(threads):
    """Each has windows with blocks of their own."""
    told, names = [], set()

    def tell(text: str) -> None:
        told.append(text)
        names.add(threading.current_thread().name)

    def fitted(one: int, say) -> int:
        say(f"trying {one}")
        windows(lambda place: blocks(lambda rows: None, 3), range(4))
        return 10 * one

    assert fits(fitted, range(6), tell) == [0, 10, 20, 30, 40, 50]
    assert names == {threading.current_thread().name}
    assert sorted(told) == [f"trying {one}" for one in range(6)]


class Stop(Exception):
    pass


def test_where_telling_stops_none_of_the_fits_goes_on(threads):
    running = []

    def fitted(one: int, say) -> None:
        running.append(one)
        try:
            while True:
                say(f"trying {one}")
                time.sleep(0.001)
        finally:
            running.remove(one)

    def tell(text: str) -> None:
        raise Stop

    with pytest.raises(Stop):
        fits(fitted, range(6), tell)
    assert running == []
    assert fits(lambda one, say: one, range(3), tell) == [0, 1, 2], "the next ones are not stopped"


def test_an_error_of_a_fit_comes_out(threads):
    with pytest.raises(ZeroDivisionError):
        fits(lambda one, say: 1 // (one - 1), range(3), lambda text: None)
