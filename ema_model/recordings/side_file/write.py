"""Writes a side file, over the one that is there: comments and order stay."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ema_model.files.limits import TEXT_BYTES
from ema_model.files.refusal import reason, refusal
from ema_model.files.toml_write import inline, toml_text
from ema_model.files.whole_file import change_file
from ema_model.recordings.columns.mapping import MappedColumn
from ema_model.recordings.side_file.read import SideFile, parse_side_file


def write_side_file(side: SideFile, path: str | os.PathLike[str]) -> None:
    """Writes the side file, whole or not at all, in place of an older one.  Raises InputError if it cannot."""
    _change(path, lambda text: toml_text(document(side), text))


def change_side_file(path: str | os.PathLike[str], otherwise: SideFile, **said: Any) -> None:
    """Writes what is said now into the side file as it is now, which another may have changed in the meantime.

    otherwise: what it says besides where there is none yet.  Raises InputError if it cannot, or the file is none.
    """

    def changed(text: str) -> str:
        known = parse_side_file(text, os.fspath(path)) if text else otherwise
        return toml_text(document(replace(known, **said)), text)

    _change(path, changed)


def _change(path: str | os.PathLike[str], change: Callable[[str], str]) -> None:
    try:
        change_file(path, change, TEXT_BYTES)
    except OSError as error:
        raise refusal(path, f"cannot be written ({reason(error)}); check the disk and the permissions") from None


def document(side: SideFile) -> dict[str, Any]:
    """What stands in the file."""
    window = dict(zip(("from_s", "to_s"), side.window_s or ()))
    tables = {
        "window": {name: value for name, value in window.items() if math.isfinite(value)},
        "text": _given(header_line=side.text.header_line, encoding=side.text.encoding),
        "sensors": side.sensors,
        "mapping": {entry.signal: _column(entry) for entry in (side.mapping.entries if side.mapping else ())},
    }
    return {
        **_given(schema=1, kind=side.kind, actuator=side.actuator, sampling=side.sampling),
        **_given(segments=None if side.segments is None else list(side.segments)),
        **{name: table for name, table in tables.items() if table},
    }


def _given(**said: Any) -> dict[str, Any]:
    return {name: inline(value) for name, value in said.items() if value is not None}


def _column(entry: MappedColumn) -> Any:
    """One entry on a line, in which any column's name can stand."""
    unit = {"unit": entry.unit} if entry.unit else {}
    return inline({"column": entry.column, **unit, **entry.numbers})
