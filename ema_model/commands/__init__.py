"""The commands: each subclass of `Command` in a file of this folder is one, found by its `name`.

To add a command, add a class to `command`, or a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from ema_model.commands.command import Command, Recorded
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.members import classes

__all__ = ["COMMANDS", "Command", "Recorded", "command"]

# A recorded command is made from a file, not from settings.
COMMANDS: dict[str, type[Command]] = {
    one.name: one
    for one in sorted(classes(__name__, Command), key=lambda one: (one.place, one.name))
    if one is not Recorded
}


def command(name: str, settings: Mapping[str, Any] | None = None) -> Command:
    """The command of that name with some settings changed; text values are read as the setting's type."""
    if name not in COMMANDS:
        like = did_you_mean(name, COMMANDS)
        names = ", ".join(COMMANDS)
        raise InputError(f"no command {quoted(name)!r}; commands are {names}, or a recording's file{like}")
    cls = COMMANDS[name]
    known = {f.name: f.default for f in fields(cls)}
    read: dict[str, Any] = {}
    for setting, value in (settings or {}).items():
        if setting not in known:
            like = did_you_mean(setting, known)
            raise InputError(f"{name} has no setting {quoted(setting)!r}; it has {', '.join(known)}{like}")
        read[setting] = _number(name, setting, value, known[setting])
    return cls(**read)


def _number(name: str, setting: str, value: Any, like: Any) -> Any:
    try:
        if isinstance(like, tuple):
            parts = value.split("+") if isinstance(value, str) else value
            return tuple(float(part) for part in parts)
        return float(value)
    except (TypeError, ValueError):
        expected = "numbers joined by + (1+3+7)" if isinstance(like, tuple) else "a number"
        raise InputError(f"{name}: {setting} must be {expected}, not {quoted(value)!r}") from None
