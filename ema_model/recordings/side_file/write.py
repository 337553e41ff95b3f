"""Writes a side file."""

from __future__ import annotations

import json
import math
import os

from ema_model.files.refusal import reason, refusal
from ema_model.files.whole_file import whole_file
from ema_model.recordings.columns.mapping import MappedColumn
from ema_model.recordings.side_file.read import SideFile


def write_side_file(side: SideFile, path: str | os.PathLike[str]) -> None:
    """Writes the side file, whole or not at all; an older one is replaced.  Raises InputError if it cannot."""
    path = os.fspath(path)
    try:
        with whole_file(path) as draft:
            draft.write_text(side_text(side), encoding="utf-8", newline="\n")
    except OSError as error:
        raise refusal(path, f"cannot be written ({reason(error)}); check the disk and the permissions") from None


def side_text(side: SideFile) -> str:
    """The side file as TOML."""
    lines = ["schema = 1", f"kind = {_quoted(side.kind)}"]
    if side.actuator is not None:
        lines.append(f"actuator = {_quoted(side.actuator)}")
    if side.sampling is not None:
        lines.append(f"sampling = {_quoted(side.sampling)}")
    if side.segments is not None:
        lines.append(f"segments = [{', '.join(str(number) for number in side.segments)}]")
    if side.window_s is not None:
        names = zip(("from_s", "to_s"), side.window_s)
        lines += ["", "[window]", *(f"{name} = {value!r}" for name, value in names if math.isfinite(value))]
    said = {"header_line": side.text.header_line, "encoding": side.text.encoding and _quoted(side.text.encoding)}
    if any(said.values()):
        lines += ["", "[text]", *(f"{name} = {value}" for name, value in said.items() if value)]
    if side.sensors:
        lines += ["", "[sensors]", *(f"{name} = {value!r}" for name, value in side.sensors.items())]
    if side.mapping is not None and side.mapping.entries:
        lines += ["", "[mapping]", *(f"{entry.signal} = {_column(entry)}" for entry in side.mapping.entries)]
    return "\n".join(lines) + "\n"


def _column(entry: MappedColumn) -> str:
    """One entry as an inline table, in which any column's name can stand."""
    parts = [f"column = {_quoted(entry.column)}"]
    if entry.unit:
        parts.append(f"unit = {_quoted(entry.unit)}")
    parts += [f"{name} = {value!r}" for name, value in entry.numbers.items()]
    return "{ " + ", ".join(parts) + " }"


def _quoted(text: str) -> str:
    # JSON's strings are TOML's, but for this control character; lone surrogates have no place in UTF-8.
    clean = text.encode("utf-8", "replace").decode("utf-8")
    return json.dumps(clean, ensure_ascii=False).replace("\x7f", "\\u007f")
