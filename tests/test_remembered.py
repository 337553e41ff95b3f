"""An answer is found once for each object, and goes with it."""

from __future__ import annotations

import gc
import weakref

from ema_model.remembered import remembered


class Thing:
    """Compared by identity."""


def test_an_answer_is_found_once_and_goes_with_its_object():
    asked = []

    @remembered(of=1)
    def answer(power, thing):
        asked.append(power)
        return [power]

    first, second = Thing(), Thing()
    assert answer(1, first) is answer(1, first)
    assert answer(1, first) is not answer(1, second)
    answer(2, first)
    assert asked == [1, 1, 2]
    found = weakref.ref(first)
    del first
    gc.collect()
    assert found() is None, "the object is not held"


def test_of_one_object_the_last_answers_are_remembered():
    asked = []

    @remembered(of=0)
    def answer(thing, number):
        asked.append(number)
        return number

    thing = Thing()
    for number in range(40):
        assert answer(thing, number) == number
    answer(thing, 39)
    assert len(asked) == 40
    answer(thing, 0)
    assert asked[-1] == 0 and len(asked) == 41
