"""What a function found, remembered as long as the object lives of which it was asked.

`lru_cache` keeps its arguments: a fit of 4 MB, and its recordings, stay for a number that nobody asks for any more.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar
from weakref import WeakKeyDictionary

Values = ParamSpec("Values")
Found = TypeVar("Found")

_MOST = 32


def remembered(of: int) -> Callable[[Callable[Values, Found]], Callable[Values, Found]]:
    """A decorator of a function of hashable values, given by their place; of: the place of the object.

    Of one object the last 32 answers are remembered.  They must not hold the object, which would never go then.
    """

    def decorate(function: Callable[Values, Found]) -> Callable[Values, Found]:
        known: WeakKeyDictionary[object, dict[tuple[object, ...], Found]] = WeakKeyDictionary()

        @wraps(function)
        def asked(*values: Values.args, **named: Values.kwargs) -> Found:
            assert not named, "answers are remembered by the places of values"
            others = (*values[:of], *values[of + 1 :])
            answers = known.setdefault(values[of], {})
            try:
                return answers[others]
            except KeyError:
                found = answers[others] = function(*values, **named)
                for oldest in list(answers)[:-_MOST]:
                    answers.pop(oldest, None)  # another thread may have done so
                return found

        return asked

    return decorate
