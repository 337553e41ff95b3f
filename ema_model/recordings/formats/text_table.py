"""The table in a text of an unusual layout: a header that is repeated, text at the end, stamps, several times.

Read at full speed where its cells are plain numbers, else as text, of which each cell is then understood.
"""

from __future__ import annotations

import codecs
import io
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.csv as csv

from ema_model.errors import InputError, quoted
from ema_model.files.limits import LINE_BYTES, megabytes
from ema_model.files.refusal import refusal, shown
from ema_model.quantities.signals import SIGNALS
from ema_model.quantities.units import find_unit
from ema_model.recordings.formats.channels import with_unit
from ema_model.recordings.formats.format import Array, Columns, check_size
from ema_model.recordings.formats.stamps import is_stamp, seconds
from ema_model.recordings.formats.text_clocks import is_time, on_one_clock, own_clocks, since_one_moment
from ema_model.recordings.formats.text_layout import SEPARATORS, Layout, is_number, lines_of, split

pc: Any = pyarrow.compute  # its functions are made when it is imported
_MOST_TEXT = 0.25  # of a file's limit, up to which cells are understood one by one
_MOST_AT_THE_END = 200  # lines of text below the numbers
_NUMBER = r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*$|^\s*[+-]?(?i:nan|inf|infinity)\s*$"


@dataclass(frozen=True)
class TextTable:
    """A text and its layout, and the columns that it gives."""

    path: str
    layout: Layout
    names: list[str]  # of the columns, in order; that of a column without one is ""
    places: dict[str, int]  # by name: the column in the file
    stamps: frozenset[int]  # columns of date and time
    clocks: dict[int, int]  # by column: the column of its own time; empty where all share one
    skipped: int  # lines above the numbers

    @property
    def is_plain(self) -> bool:
        """Whether there is nothing in the layout's first lines but a header and plain numbers below."""
        one = self.layout
        usual = one.encoding == "utf-8" and not one.thousands and not one.units_line and one.separator != "|"
        return usual and not self.stamps and not self.clocks and tuple(self.names) == one.cells


def table_of(path: str, layout: Layout, hint: str | None = None) -> TextTable:
    """The columns of a text so laid out."""
    lines = lines_of(path, hint)[0]
    row = [cell.strip() for cell in split(lines[layout.data_line - 1], layout.separator)]
    stamps = frozenset(i for i, cell in enumerate(row[: len(layout.cells)]) if is_stamp(cell))
    names = []
    for i, (cell, unit) in enumerate(zip(layout.cells, layout.units)):
        own = SIGNALS[cell].unit if cell in SIGNALS else ""
        is_said = bool(own) and (found := find_unit(unit, own)) is not None and found.is_si
        name = cell if is_said else with_unit(cell, unit) if cell else ""
        if cell and i in stamps:
            name = with_unit(cell if is_time(cell) else f"{cell} time", "s")
        elif cell and i == 0 and find_unit(unit, "s") and not is_time(cell):
            name = with_unit(f"{cell} time", unit)
        names.append(name)
    clocks = own_clocks(names)
    times = set(clocks.values())
    kept = [i for i in range(len(names)) if i not in times or i == min(times)]
    if not clocks:
        kept = list(range(len(names)))
    return TextTable(
        path, layout, [names[i] for i in kept], {names[i]: i for i in kept}, stamps, clocks, layout.data_line - 1
    )


def read_table(table: TextTable, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    """The columns of those names; raises InputError as a format's `read` does."""
    places = [table.places[name] for name in names]
    needed = sorted({*places, *(table.clocks[i] for i in places if i in table.clocks)})
    found = _numbers_at_once(table, needed)
    kept: np.ndarray | None = None
    notes = _notes(table.layout)
    if found is None:
        _check_text(table, max_bytes)
        found, kept, done = _understood(table, needed, strict)
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
        parsed = _parsed(table, places, pa.float64(), csv.ParseOptions(delimiter=table.layout.separator), True)
    except pa.ArrowException:
        return None
    if any(column.null_count for column in parsed.columns):
        return None
    return {i: parsed.column(f"{i}").to_numpy() for i in places}


def _parsed(
    table: TextTable, places: Sequence[int], kind: pa.DataType, options: csv.ParseOptions, threads: bool
) -> pa.Table:
    columns = [f"{i}" for i in range(len(table.layout.cells))]
    wanted = [f"{i}" for i in places]
    with Utf8(table) as text:
        return csv.read_csv(
            text,
            csv.ReadOptions(column_names=columns, skip_rows=table.skipped, use_threads=threads),
            options,
            csv.ConvertOptions(
                column_types=dict.fromkeys(wanted, kind),
                include_columns=wanted,
                null_values=[""],
                strings_can_be_null=True,
                decimal_point=table.layout.decimal,
            ),
        )


def _check_text(table: TextTable, max_bytes: int) -> None:
    """Cells that are looked at one by one take four times their file's size, and time."""
    if os.path.getsize(table.path) > _MOST_TEXT * max_bytes:
        most = megabytes(int(_MOST_TEXT * max_bytes))
        raise refusal(table.path, f"is over {most} and no plain table; cut it, or export one header line and numbers")


def _understood(
    table: TextTable, places: Sequence[int], strict: bool
) -> tuple[dict[int, Array | None], np.ndarray, list[str]]:
    """The columns from their text, the rows that are left, and what was left out."""
    other: dict[int, str] = {}  # by row: a line of another width

    def other_width(row: csv.InvalidRow) -> str:
        other[int(row.number or 0) - table.skipped - 1] = row.text
        return "skip" if len(other) <= 10 * _MOST_AT_THE_END else "error"

    options = csv.ParseOptions(delimiter=table.layout.separator, invalid_row_handler=other_width)
    try:
        parsed = _parsed(table, places, pa.string(), options, False)
    except pa.ArrowException as error:
        problem = f"cannot be read as a table ({shown(error, 80)})"
        raise refusal(table.path, f"{problem}; correct it, or name another header line") from None
    texts = {i: parsed.column(f"{i}") for i in places}
    rows = np.delete(
        np.arange(parsed.num_rows + len(other)), [i for i in other if 0 <= i < parsed.num_rows + len(other)]
    )
    rows = rows[: parsed.num_rows]
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


def place_of(table: TextTable, row: int) -> str:
    """Where a row of numbers stands: "line 12"."""
    seen = -1
    for number, line in enumerate(_lines(table), 1):
        if number > table.skipped and line.strip(b"\r\n"):
            seen += 1
            if seen == row:
                return f"line {number}"
    return "the last line"


def _lines(table: TextTable) -> Iterator[bytes]:
    with Utf8(table) as text:
        rest = b""
        while piece := text.read(1 << 20):
            block = rest + piece
            end = max(block.rfind(b"\n"), block.rfind(b"\r", 0, -1)) + 1
            yield from block[:end].splitlines(keepends=True)
            rest = block[end:]
            if len(rest) > LINE_BYTES:
                raise refusal(table.path, f"a line is over {megabytes(LINE_BYTES)} long; one row per line is expected")
        if rest:
            yield rest


class Utf8(io.RawIOBase):
    """The text in UTF-8, whatever it is stored in, to read from its first letter on."""

    def __init__(self, table: TextTable) -> None:
        super().__init__()
        encoding = table.layout.encoding
        self._file = open(table.path, "rb")
        mark = {"utf-8": 3, "utf-16-le": 2, "utf-16-be": 2}.get(encoding, 0) if table.layout.has_mark else 0
        self._file.seek(mark)
        self._decoder = codecs.getincrementaldecoder(encoding)("replace")
        self._is_utf8 = encoding == "utf-8"
        self._left = b""

    def readable(self) -> bool:
        """It is."""
        return True

    def read(self, size: int | None = -1) -> bytes:
        """So many bytes, fewer at the end."""
        if self._is_utf8:
            return self._file.read(-1 if size is None else size)
        if size is None or size < 0:
            return self._left + self._decoder.decode(self._file.read(), True).encode()
        while len(self._left) < size:
            piece = self._file.read(max(size, 1 << 16))
            self._left += self._decoder.decode(piece, not piece).encode()
            if not piece:
                break
        given, self._left = self._left[:size], self._left[size:]
        return given

    def close(self) -> None:
        """Closes the file."""
        self._file.close()
        super().close()
