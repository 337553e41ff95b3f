"""Cells of a text understood one by one: what is no number, headers that come again, and text at the end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.csv as csv

from ema_model.errors import quoted
from ema_model.files.refusal import refusal, shown
from ema_model.recordings.formats.format import Array
from ema_model.recordings.formats.stamps import seconds
from ema_model.recordings.formats.text_clocks import since_one_moment
from ema_model.recordings.formats.text_layout import is_number, split
from ema_model.recordings.formats.text_table import TextTable, parsed, place_of

pc: Any = pyarrow.compute  # its functions are made when it is imported
_MOST_AT_THE_END = 200  # lines of text below the numbers
_NUMBER = r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*$|^\s*[+-]?(?i:nan|inf|infinity)\s*$"


def understood(
    table: TextTable, places: Sequence[int], strict: bool
) -> tuple[dict[int, Array | None], np.ndarray, list[str]]:
    """The columns from their text, the rows that are left, and what was left out."""
    other: dict[int, str] = {}  # by row: a line of another width

    def other_width(row: csv.InvalidRow) -> str:
        other[int(row.number or 0) - table.skipped - 1] = row.text
        return "skip" if len(other) <= 10 * _MOST_AT_THE_END else "error"

    options = csv.ParseOptions(delimiter=table.layout.separator, invalid_row_handler=other_width)
    try:
        whole = parsed(table, places, pa.string(), options, False)
    except pa.ArrowException as error:
        problem = f"cannot be read as a table ({shown(error, 80)})"
        raise refusal(table.path, f"{problem}; correct it, or name another header line") from None
    texts = {i: whole.column(f"{i}") for i in places}
    rows = np.delete(np.arange(whole.num_rows + len(other)), [i for i in other if 0 <= i < whole.num_rows + len(other)])
    rows = rows[: whole.num_rows]
    values = {i: _column(table, i, text) for i, text in texts.items()}
    stamps = table.stamps.intersection(table.clocks.values(), places)
    since_one_moment(stamps, texts, {i: (numbers, wrong) for i, (numbers, wrong, _) in values.items()})
    bad = np.all([one[1] for one in values.values()], axis=0) if values else np.zeros(rows.size, bool)
    blank = np.all([one[2] for one in values.values()], axis=0) if values else np.zeros(rows.size, bool)
    good = np.flatnonzero(~bad)
    last = int(rows[good[-1]]) if good.size else -1
    again = 0
    for row, text in other.items():
        is_cut = text.count('"') % 2 or any(map(is_number, split(text, table.layout.separator)))
        if row > last and not is_cut:
            continue  # text below the numbers
        if text.strip() not in table.layout.head:
            cells = len(split(text, table.layout.separator))
            odd = f"{cells} cell{'s' * (cells != 1)} where the header has {len(table.layout.cells)}"
            raise refusal(table.path, f"{place_of(table, row)}: {odd}; complete or remove the line")
        again += 1
    gone = bad & (rows > last)
    for at in np.flatnonzero(bad & ~blank & (rows < last)):
        cells = [str(texts[i][int(at)]).strip() for i in places]
        if not any(_is_head(table, i, cell) for i, cell in zip(places, cells)):
            break  # told below, with its cell
        again += 1
        gone[at] = True
    left = ~gone
    ends = int(np.count_nonzero(bad & ~blank & (rows > last))) + sum(row > last for row in other)
    if ends > _MOST_AT_THE_END:
        raise refusal(table.path, f"has {ends} lines below the numbers that are none; remove them")
    found: dict[int, Array | None] = {}
    for i, (numbers, wrong, _) in values.items():
        own = left & ~wrong if table.clocks else left
        if table.clocks:  # each is as long as it goes
            end = int(np.flatnonzero(~wrong)[-1]) + 1 if not wrong.all() else 0
            own = left & (np.arange(rows.size) < end)
        if (wrong & own).any():
            if strict:
                at = int(np.flatnonzero(wrong & own)[0])
                _refuse_cell(table, i, int(rows[at]), texts[i][at].as_py())
            found[i] = None
        else:
            found[i] = numbers[own]
    if strict and not good.size:
        raise refusal(table.path, "has 0 samples under its header; 100 or more are expected")
    notes = []
    if again:
        notes.append(f"the header is repeated {again} times; those lines are left out")
    if ends:
        notes.append(f"{ends} line{'s' * (ends != 1)} of text below the numbers left out")
    return found, rows[left], notes


def _is_head(table: TextTable, i: int, cell: str) -> bool:
    return bool(cell) and cell in (table.layout.cells[i], table.layout.units[i])


def _column(table: TextTable, i: int, text: pa.ChunkedArray) -> tuple[Array, np.ndarray, np.ndarray]:
    """A column's numbers, which of its cells are none, and which are blank."""
    blank = np.asarray(text.is_null())
    if i in table.stamps and not blank.all():
        whole = pc.fill_null(text, "")
        right = np.asarray(pc.match_substring_regex(whole, r"\d{1,2}:\d{2}:\d{2}"))
        values = np.full(len(text), np.nan)
        stamps = seconds(pa.chunked_array([whole.filter(pa.array(right))])) if right.any() else None
        if stamps is not None:
            values[right] = stamps
            return values, ~right, blank
        return values, np.ones(len(text), bool), blank
    if table.layout.thousands:
        text = pc.replace_substring(text, table.layout.thousands, "")
    if table.layout.decimal == ",":
        text = pc.replace_substring(text, ",", ".")
    right = np.asarray(pc.fill_null(pc.match_substring_regex(text, _NUMBER), False))
    kept = pc.if_else(pa.array(right), text.combine_chunks(), pa.scalar(None, pa.string()))
    values = pc.cast(pc.utf8_trim_whitespace(kept), pa.float64()).to_numpy(zero_copy_only=False)
    return values, ~right, blank


def _refuse_cell(table: TextTable, i: int, row: int, cell: str | None) -> None:
    where = f"{place_of(table, row)}, column {quoted(table.layout.cells[i])!r}"
    if not (cell or "").strip():
        raise refusal(table.path, f"{where}: blank; a number is expected, fill it or remove the line")
    raise refusal(table.path, f"{where}: a number is expected, found {shown(cell)!r}; correct it or remove the line")
