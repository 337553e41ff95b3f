"""Reads columns of a text: at full speed where its cells are plain numbers, else as text, cell by cell."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.csv as csv

from ema_model.errors import InputError
from ema_model.files.limits import megabytes
from ema_model.files.refusal import refusal
from ema_model.recordings.formats.format import Array, Columns, check_size
from ema_model.recordings.formats.text_cells import understood
from ema_model.recordings.formats.text_clocks import on_one_clock
from ema_model.recordings.formats.text_layout import SEPARATORS, Layout
from ema_model.recordings.formats.text_table import TextTable, parsed, place_of

_MOST_TEXT = 0.25  # of a file's limit, up to which cells are understood one by one


def read_table(table: TextTable, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    """The columns of those names; raises InputError as a format's `read` does."""
    places = [table.places[name] for name in names]
    needed = sorted({*places, *(table.clocks[i] for i in places if i in table.clocks)})
    found = _numbers_at_once(table, needed)
    kept: np.ndarray | None = None
    notes = _notes(table.layout)
    if found is None:
        _check_text(table, max_bytes)
        found, kept, done = understood(table, needed, strict)
        notes += done
    for i in () if strict else places:
        if found.get(i) is None:
            names = [name for name in names if table.places[name] != i]
    check_size(table.path, sum(values.size for values in found.values() if values is not None), max_bytes)
    arrays = {name: values for name in names if (values := found[table.places[name]]) is not None}
    clocks = None
    if table.clocks:
        arrays, done, clocks = on_one_clock(
            table.path, table.layout.cells, table.clocks, table.places, arrays, found, strict
        )
        notes += done
    return Columns(
        arrays,
        lambda row: place_of(table, row if kept is None or row >= kept.size else int(kept[row])),
        tuple(notes),
        clocks=clocks,
        layout=table.layout.told,
    )


def read_leaving_out(table: TextTable, names: Sequence[str], max_bytes: int) -> Columns | None:
    """The columns, for which lines are left out; None where that does not make them numbers."""
    try:
        found = read_table(table, names, max_bytes, True)
    except InputError:
        return None
    return found if len(found.notes) > len(_notes(table.layout)) else None


def _notes(layout: Layout) -> list[str]:
    notes = [] if layout.separator == "," else [f"columns are separated by {SEPARATORS[layout.separator]}"]
    return notes + (["numbers are written with a decimal comma"] if layout.decimal == "," else [])


def _numbers_at_once(table: TextTable, places: Sequence[int]) -> dict[int, Array | None] | None:
    """These columns if all of their cells are plain numbers."""
    if table.layout.thousands or table.clocks or table.stamps.intersection(places):
        return None
    try:
        whole = parsed(table, places, pa.float64(), csv.ParseOptions(delimiter=table.layout.separator), True)
    except pa.ArrowException:
        return None
    if any(column.null_count for column in whole.columns):
        return None
    return {i: whole.column(f"{i}").to_numpy() for i in places}


def _check_text(table: TextTable, max_bytes: int) -> None:
    """Cells that are looked at one by one take four times their file's size, and time."""
    if os.path.getsize(table.path) > _MOST_TEXT * max_bytes:
        most = megabytes(int(_MOST_TEXT * max_bytes))
        raise refusal(table.path, f"is over {most} and no plain table; cut it, or export one header line and numbers")
