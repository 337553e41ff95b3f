"""Those who asked to be told."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any


def notify(listeners: Sequence[Callable[..., None]], *values: Any) -> None:
    """Calls each listener with the values, in the order in which they came to listen."""
    for listener in listeners:
        listener(*values)
