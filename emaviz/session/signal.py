"""What happens, and those who asked to be told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, ParamSpec

Values = ParamSpec("Values")


class Signal(Generic[Values]):
    """One thing that happens; called with its values, it tells everyone on the thread of whoever calls."""

    def __init__(self) -> None:
        self._listeners: list[Callable[..., object]] = []

    def connect(self, listener: Callable[Values, object]) -> None:
        """Has a listener called each time, after those that came before it."""
        self._listeners.append(listener)

    def disconnect(self, listener: Callable[Values, object]) -> None:
        """The listener is not called any more; ValueError if it never was."""
        self._listeners.remove(listener)

    def __call__(self, *values: Values.args, **named: Values.kwargs) -> None:
        for listener in tuple(self._listeners):
            listener(*values, **named)
