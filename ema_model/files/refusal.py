"""One clear line for a file that cannot be used."""

from __future__ import annotations

import os
from collections.abc import Iterable

from ema_model.errors import InputError, quoted

_NAMES_SHOWN = 12


def shown(value: object, limit: int = 40) -> str:
    """Foreign text on one line, cut to `limit` characters; see `quoted`."""
    return quoted(value, limit)


def listed(names: Iterable[str]) -> str:
    """Foreign names joined by commas, the first dozen of them."""
    names = list(names)
    more = [f"… ({len(names)} in all)"] if len(names) > _NAMES_SHOWN else []
    return ", ".join([shown(name.strip()) or "(unnamed)" for name in names[:_NAMES_SHOWN]] + more) or "none"


def refusal(path: str | os.PathLike[str], problem: str) -> InputError:
    """The error to raise: the file's name as given, then what is wrong, where, and what to do."""
    return InputError(f"{shown(os.fspath(path), 300)}: {problem}")


def reason(error: Exception) -> str:
    """What the system says about an error, on one line."""
    return shown(" ".join(str(getattr(error, "strerror", None) or error).split()), 80)
