"""Writes a side file, over the one that is there: comments and order stay."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ema_model.errors import InputError
from ema_model.files.limits import TEXT_BYTES
from ema_model.files.refusal import reason, refusal
from ema_model.files.toml_text import toml_of
from ema_model.files.toml_write import inline, toml_text
from ema_model.files.whole_file import change_file
from ema_model.recordings.columns.mapping import MappedColumn
from ema_model.recordings.side_file.read import SideFile, parse_side_file


def write_side_file(side: SideFile, path: str | os.PathLike[str]) -> None:
    """Writes the side file, whole or not at all, in place of an older one.  Raises InputError if it cannot."""

    def changed(text: str) -> str:
        try:
            return _over(text, side, parse_side_file(text, os.fspath(path)))
        except InputError:  # what it replaces is none
            return _over("", side, SideFile())

    _change(path, changed)


def change_side_file(path: str | os.PathLike[str], otherwise: SideFile, **said: Any) -> None:
    """Writes what is said now into the side file as it is now, which another may have changed in the meantime.

    otherwise: what it says besides where there is none yet.  Raises InputError if it cannot, or the file is none.
    """

    def changed(text: str) -> str:
        known = parse_side_file(text, os.fspath(path))
        return _over(text, replace(known if text else otherwise, **said), known)

    _change(path, changed)


def _change(path: str | os.PathLike[str], change: Callable[[str], str]) -> None:
    try:
        change_file(path, change, TEXT_BYTES)
    except OSError as error:
        raise refusal(path, f"cannot be written ({reason(error)}); check the disk and the permissions") from None


def _over(text: str, side: SideFile, known: SideFile) -> str:
    """The file's text; `known`, which the older text says, keeps its spelling."""
    window = dict(zip(("from_s", "to_s"), side.window_s or ()))
    spelt = toml_of(text).get("mapping", {})
    same = known.mapping.entries if known.mapping else ()
    entries = side.mapping.entries if side.mapping else ()
    tables = {
        "window": {name: value for name, value in window.items() if math.isfinite(value)},
        "text": _given(header_line=side.text.header_line, encoding=side.text.encoding),
        "sensors": side.sensors,
        "mapping": {one.signal: inline(spelt[one.signal]) if one in same else _column(one) for one in entries},
    }
    document = {
        **_given(schema=1, kind=side.kind, actuator=side.actuator, sampling=side.sampling),
        **_given(segments=None if side.segments is None else list(side.segments)),
        **{name: table for name, table in tables.items() if table},
    }
    return toml_text(document, text)


def _given(**said: Any) -> dict[str, Any]:
    return {name: inline(value) for name, value in said.items() if value is not None}


def _column(entry: MappedColumn) -> Any:
    """One entry on a line, in which any column's name can stand."""
    unit = {"unit": entry.unit} if entry.unit else {}
    return inline({"column": entry.column, **unit, **entry.numbers})
