"""CSV and other text: cells, columns, tables, and the rigs' layouts."""

from __future__ import annotations

import codecs
import io
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, NoReturn

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.csv as csv
import pyarrow.csv as pc

from ema_model.errors import InputError, quoted
from ema_model.files.opened import LINE_BYTES, listed, megabytes, refusal, shown
from ema_model.quantities import SIGNALS
from ema_model.recordings.column_names import find_unit, is_time, readings
from ema_model.recordings.formats.arrow import as_numpy, mask
from ema_model.recordings.formats.channels import beside_time, tokens, with_unit
from ema_model.recordings.formats.format import (
    Array,
    Clocks,
    Columns,
    Format,
    between,
    check_size,
    covered,
    is_state,
    main_clock,
    rule,
)
from ema_model.recordings.formats.text_layout import (
    SEPARATORS,
    Head,
    Hints,
    Layout,
    find_layout,
    is_number,
    is_stamp,
    lines_of,
    read_head,
    seconds,
    split,
)

# --- a text as UTF-8, whatever it is stored in ------------------------------------------------------------------------


class Utf8(io.RawIOBase):
    """To read from its first letter on."""

    def __init__(self, path: str, layout: Layout) -> None:
        super().__init__()
        encoding = layout.encoding
        self._file = open(path, "rb")
        mark = {"utf-8": 3, "utf-16-le": 2, "utf-16-be": 2}.get(encoding, 0) if layout.has_mark else 0
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


class Aligned(io.RawIOBase):
    """A text with one blank where several part two columns, and without labels before its numbers."""

    def __init__(self, text: Utf8, layout: Layout) -> None:
        super().__init__()
        self._text = text
        self._separator, self._is_labelled = layout.separator.encode(), layout.is_labelled
        self._rest, self._left = b"", b""

    def readable(self) -> bool:
        """It is."""
        return True

    def read(self, size: int | None = -1) -> bytes:
        """So many bytes, fewer at the end."""
        whole = size is None or size < 0
        while whole or len(self._left) < (size or 0):
            piece = self._text.read(1 << 16)
            block = self._rest + piece
            end = block.rfind(b"\n") + 1 if piece else len(block)
            self._rest = block[end:]
            self._left += b"".join(self._plain(line) + b"\n" for line in block[:end].splitlines())
            if not piece:
                break
            if len(self._rest) > LINE_BYTES:
                raise pa.ArrowInvalid("a line is too long")
        given, self._left = (self._left, b"") if whole else (self._left[:size], self._left[size:])
        return given

    def _plain(self, line: bytes) -> bytes:
        if self._separator == b" ":
            line = b" ".join(line.split())
        if not self._is_labelled:
            return line
        cells = line.strip(self._separator + b" \t").split(self._separator)
        return self._separator.join(cell.rpartition(b":")[2].strip() for cell in cells)


# --- cells of a text understood one by one: what is no number, headers that come again, and text at the end -----------

compute: Any = pyarrow.compute  # its functions are made when it is imported
_MOST_AT_THE_END = 200  # lines of text below the numbers
_NUMBER_CELL = r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*$|^\s*[+-]?(?i:nan|inf|infinity)\s*$"


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
    blank = as_numpy(text.is_null())
    if i in table.stamps and not blank.all():
        whole = compute.fill_null(text, "")
        right = as_numpy(compute.match_substring_regex(whole, r"\d{1,2}:\d{2}:\d{2}"))
        values = np.full(len(text), np.nan)
        stamps = seconds(pa.chunked_array([whole.filter(mask(right))])) if right.any() else None
        if stamps is not None:
            values[right] = stamps
            return values, ~right, blank
        return values, np.ones(len(text), bool), blank
    if table.layout.thousands:
        text = compute.replace_substring(text, table.layout.thousands, "")
    if table.layout.decimal == ",":
        text = compute.replace_substring(text, ",", ".")
    right = as_numpy(compute.match_substring_regex(text, _NUMBER_CELL)) == 1.0  # a blank is NaN
    kept = compute.if_else(mask(right), text.combine_chunks(), pa.nulls(len(text), pa.string()))
    values = as_numpy(compute.cast(compute.utf8_trim_whitespace(kept), pa.float64()))
    return values, ~right, blank


def _refuse_cell(table: TextTable, i: int, row: int, cell: str | None) -> None:
    where = f"{place_of(table, row)}, column {quoted(table.layout.cells[i])!r}"
    if not (cell or "").strip():
        raise refusal(table.path, f"{where}: blank; a number is expected, fill it or remove the line")
    raise refusal(table.path, f"{where}: a number is expected, found {shown(cell)!r}; correct it or remove the line")


# --- reads columns of a text: at full speed where its cells are plain numbers, else as text, cell by cell -------------

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
    return {i: as_numpy(whole.column(f"{i}")) for i in places}


def _check_text(table: TextTable, max_bytes: int) -> None:
    """Cells that are looked at one by one take four times their file's size, and time."""
    if os.path.getsize(table.path) > _MOST_TEXT * max_bytes:
        most = megabytes(int(_MOST_TEXT * max_bytes))
        raise refusal(table.path, f"is over {most} and no plain table; cut it, or export one header line and numbers")


# --- texts in which each channel has a column of its own time, as loggers with a buffer for each export them ----------


def own_clocks(names: Sequence[str]) -> dict[int, int]:
    """By column, that of its own time: times before as many others each, or named after them, t_speed and speed."""
    times = [i for i, name in enumerate(names) if is_time(name)]
    units = {one.unit for i in times for one in readings(names[i])[:1]}
    if len(times) < 2 or len(units) != 1:
        return {}
    ends = [*times[1:], max(i for i, name in enumerate(names) if name) + 1]
    if times[0] == 0 and len({end - start for start, end in zip(times, ends)}) == 1 and ends[0] > 1:
        return {i: start for start, end in zip(times, ends) for i in range(start, end)}
    after = {i: beside_time(names[i]) for i in times}
    clocks = {i: i for i in times}
    for i, name in enumerate(names):
        if name and i not in after:
            found = [time for time, rest in after.items() if rest and rest <= tokens(name)]
            if len(found) != 1:
                return {}
            clocks[i] = found[0]
    return clocks if all(after.values()) else {}


def since_one_moment(
    stamps: Iterable[int], texts: Mapping[int, pa.ChunkedArray], values: Mapping[int, tuple[Array, np.ndarray]]
) -> None:
    """Lets stamps of several clocks, each counted from its own first, count from the first clock's; in place.

    stamps: their columns; values: the seconds by column, and which cells are none.
    """
    times = [i for i in sorted(stamps) if not values[i][1].all()]
    begins = [texts[i][int(np.argmin(values[i][1]))].as_py() for i in times]
    for i, begin in zip(times[1:], begins[1:]):
        since = seconds(pa.chunked_array([[begins[0], begin]]))
        if since is not None:
            values[i][0][:] += since[1]


def on_one_clock(
    path: str,
    titles: Sequence[str],
    clocks: Mapping[int, int],
    places: Mapping[str, int],
    arrays: dict[str, Array],
    found: Mapping[int, Array | None],
    strict: bool,
) -> tuple[dict[str, Array], list[str], Clocks | None]:
    """The columns on the time with the most samples, see `format`; what was done, in words and by column.

    titles: of the file's columns; clocks: by column, that of its time; places: a name's column; found: numbers by
    column, each as long as it goes; strict: only where all were recorded.
    """
    times = {i: time for i in sorted(set(clocks.values())) if (time := found.get(i)) is not None}
    if not times:
        return arrays, [], None
    main = int(main_clock({f"{i}": time.size for i, time in times.items()}))
    time = times[main]
    timed = {name: clocks[places[name]] for name in arrays if places[name] in clocks and places[name] not in times}
    own = {name: times[clock] for name, clock in timed.items() if clock in times}
    moved = {name: one for name, one in own.items() if not np.array_equal(one, time)}
    states = {name for name in moved if not readings(name)[0].unit and is_state(arrays[name])}
    within = np.ones(time.size, bool)
    for name, one in moved.items() if strict else ():
        within &= covered(time, one, name in states)
    if strict and not within.any():
        raise refusal(path, "its columns have no time in common; choose others, or record them together")
    result = {}
    for name, values in arrays.items():
        if places[name] in times:
            result[name] = time[within]
        elif name in moved:
            length = min(moved[name].size, values.size)
            result[name] = between(time, moved[name][:length], values[:length], name in states)[within]
        else:
            result[name] = values[within] if values.size == time.size else values
    if not moved:
        return result, [], None
    done = rule(bool(states))
    notes = [f"each with a time of its own, brought onto one {done}: {listed(moved)}"]
    if lost := int(np.count_nonzero(~within)):
        notes.append(f"{lost} samples are left out, where one of these was not recorded")
    called = {clock: f"{titles[clock]} in column {clock + 1}" for clock in times}
    of = {name: called[timed[name] if name in moved else main] for name in own}
    return result, notes, Clocks(of, called[main], done)


# --- the table in a text of an unusual layout: its columns, where they stand, and where its rows do -------------------


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
        usual = one.encoding == "utf-8" and not one.thousands and not one.units_line and one.separator not in "| "
        return usual and one.header_line > 0 and not self.stamps and not self.clocks and tuple(self.names) == one.cells


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


def parsed(
    table: TextTable, places: Sequence[int], kind: pa.DataType, options: csv.ParseOptions, threads: bool
) -> pa.Table:
    """The columns at those places, each cell of one kind; pyarrow's error where a cell is none, or a line is odd."""
    columns = [f"{i}" for i in range(len(table.layout.cells))]
    wanted = [f"{i}" for i in places]
    with Utf8(table.path, table.layout) as text:
        return csv.read_csv(
            Aligned(text, table.layout) if table.layout.separator == " " or table.layout.is_labelled else text,
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
    with Utf8(table.path, table.layout) as text:
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


# --- CSV: a header line, then numbers; commas, semicolons or tabs between them ----------------------------------------
# A file of another layout, as instruments write it, is read by `text_columns`. A plain one is read at full speed.
# Only when that fails it is read again in blocks, and the one that fails is walked line by line, to name the bad
# cell.

_HEAD_BYTES = 65_536
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)(e[+-]?[0-9]+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}


@dataclass(frozen=True)
class _Dialect:
    """How a file's text is laid out."""

    names: list[str]
    header_lines: int  # up to and with the header
    separator: str
    decimal: str


def hinted(hints: Hints) -> Format:
    """The format for a file of which somebody has said how it is laid out."""

    def header(path: str, max_bytes: int) -> list[str]:
        del max_bytes  # only the header is read
        unusual = _unusual(path, hints)
        return unusual.names if unusual else _dialect(path).names

    def read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
        unusual = _unusual(path, hints)
        return read_table(unusual, names, max_bytes, strict) if unusual else _read(path, names, max_bytes, strict)

    def head(path: str, max_bytes: int) -> Head:
        del max_bytes
        return read_head(path, hints)

    return Format(".csv", "CSV", header, read, _write, (".txt", ".tsv", ".asc", ".lvm"), (".txt",), hinted, head)


def _unusual(path: str, hints: Hints) -> TextTable | None:
    """The table of a text that has more than a header line and plain numbers below it."""
    layout = find_layout(path, hints)
    if layout is None:
        return None
    table = table_of(path, layout, hints.encoding)
    if hints != Hints() or not table.is_plain:
        return table
    dialect = _dialect(path)
    plain = (dialect.names, dialect.header_lines, dialect.separator, dialect.decimal)
    return None if plain == (table.names, layout.header_line, layout.separator, layout.decimal) else table


def _read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    dialect = _dialect(path)
    _check_size(path, dialect, names, max_bytes)
    table = _table(path, dialect, names)
    if table is None and strict and (found := _left_out(path, dialect, names, max_bytes)):
        return found
    if table is None:
        if strict:
            _explain(path, dialect, names)
        names = _numeric(path, dialect, names)
        if not names:
            return Columns({}, lambda row: _place(path, dialect, row))
        table = _table(path, dialect, names)
    if table is None:
        _explain(path, dialect, names)
    notes = []
    if dialect.separator != ",":
        notes.append(f"columns are separated by {_SEPARATORS[dialect.separator]}")
    if dialect.decimal != ".":
        notes.append("numbers are written with a decimal comma")
    columns = dict(zip(names, table.columns))
    del table  # each column goes when it is converted
    arrays = {name: as_numpy(columns.pop(name)) for name in names}
    return Columns(arrays, lambda row: _place(path, dialect, row), tuple(notes))


def _left_out(path: str, dialect: _Dialect, names: Sequence[str], max_bytes: int) -> Columns | None:
    """The columns, if all that is wrong in a table is its header again, or text at its end."""
    layout = find_layout(path, Hints())
    if layout is None or layout.header_line != dialect.header_lines:
        return None
    _check_lines(path, dialect)
    return read_leaving_out(table_of(path, layout), names, max_bytes)


def _check_lines(path: str, dialect: _Dialect) -> None:
    for _ in _blocks(path, dialect):  # refuses a line that is too long
        pass


def _table(path: str, dialect: _Dialect, names: Sequence[str]) -> pa.Table | None:
    """These columns at full speed; None if not all of them are columns of numbers."""
    try:
        with open(path, "rb") as file:
            table = _parsed(file, dialect, dialect.header_lines, {name: pa.float64() for name in names}, names)
    except pa.ArrowException:
        return None
    return None if any(column.null_count for column in table.columns) else table


def _parsed(
    file: BinaryIO | pa.NativeFile,
    dialect: _Dialect,
    skip: int,
    kinds: Mapping[str, pa.DataType],
    names: Sequence[str],
) -> pa.Table:
    return pc.read_csv(
        file,
        pc.ReadOptions(column_names=dialect.names, skip_rows=skip),
        pc.ParseOptions(delimiter=dialect.separator),
        pc.ConvertOptions(
            column_types=kinds, include_columns=list(names), null_values=[""], decimal_point=dialect.decimal
        ),
    )


def _write(signals: Mapping[str, Array], path: str) -> None:
    # The shortest digits that read back exactly.
    with open(path, "wb") as file:
        pc.write_csv(pa.table(dict(signals)), file, pc.WriteOptions(quoting_header="none"))


def _dialect(path: str) -> _Dialect:
    """The layout, from the file's first bytes; InputError if they are no text or hold no header."""
    with open(path, "rb") as file:
        head = file.read(_HEAD_BYTES)
    try:
        # Incremental, since the head may end within a character.
        text = codecs.getincrementaldecoder("utf-8-sig")().decode(head, final=len(head) < _HEAD_BYTES)
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise refusal(path, "is not text in UTF-8, nor a table in another encoding; export it again as CSV in UTF-8")
    lines = re.split(r"\r\n|\r|\n", text)
    first = next((i for i, line in enumerate(lines) if line.strip()), None)
    if first is None:
        raise refusal(path, "is empty; a header line and 100 samples or more are expected")
    if first == len(lines) - 1 and len(head) == _HEAD_BYTES:
        raise refusal(path, f"line {first + 1} is over 64 kB long; a header line with the columns' names is expected")
    separator = max(_SEPARATORS, key=lines[first].count)
    names = [name.strip() for name in split(lines[first], separator)]
    if any(_NUMBER.fullmatch(name) for name in names):
        found = f"names of columns are expected, found {listed(names)}"
        advice = "add a header line"
        if len(names) == 1:  # odrive/ODrive, tools/odrive/utils.py: oscilloscope_dump
            advice += (
                "; of one number a line, as odrivetool's oscilloscope_dump writes, put several signals side by side"
            )
        raise refusal(path, f"line {first + 1}: {found}; {advice}")
    # The last line may be cut.
    cells = (cell for line in lines[first + 1 : -1] for cell in line.split(separator))
    comma = separator != "," and any(re.fullmatch(r"\s*[+-]?[0-9]*,[0-9]+(e[+-]?[0-9]+)?\s*", c, re.I) for c in cells)
    return _Dialect(names, first + 1, separator, "," if comma else ".")


def _check_size(path: str, dialect: _Dialect, names: Sequence[str], max_bytes: int) -> None:
    """Raises InputError if the columns take more than `max_bytes` in memory."""
    # A row takes a sign for each column at least, its separator or the line's end: most files need no counting.
    if 8.0 * os.path.getsize(path) / len(dialect.names) * len(names) <= max_bytes:
        return
    rows = 0
    with open(path, "rb") as file:
        while piece := file.read(LINE_BYTES):
            rows += piece.count(b"\n") + piece.count(b"\r") - piece.count(b"\r\n")
    check_size(path, rows * len(names), max_bytes)


def _blocks(path: str, dialect: _Dialect) -> Iterator[tuple[int, bytes]]:
    """The lines below the header in blocks, each with its first line's number; all lines end in \\n.

    Raises InputError for a line that is too long to be a row.
    """
    number, rest = 1, b""
    with open(path, "rb") as file:
        while piece := file.read(LINE_BYTES):
            block = rest + piece
            end = max(block.rfind(b"\n"), block.rfind(b"\r", 0, -1)) + 1  # a last \r may belong to a \n to come
            block, rest = block[:end].replace(b"\r\n", b"\n").replace(b"\r", b"\n"), block[end:]
            yield from _below_header(number, block, dialect)
            number += block.count(b"\n")
            if len(rest) > LINE_BYTES:
                found = f"line {number} is over {megabytes(LINE_BYTES)} long"
                raise refusal(path, f"{found}; one row of numbers per line is expected")
        yield from _below_header(number, rest, dialect)


def _below_header(number: int, block: bytes, dialect: _Dialect) -> Iterator[tuple[int, bytes]]:
    """The block without the header's lines, if a row is left."""
    header = max(dialect.header_lines + 1 - number, 0)
    if header:
        block = block.split(b"\n", header)[header] if block.count(b"\n") >= header else b""
    if block.strip(b"\r\n"):
        yield number + header, block


def _place(path: str, dialect: _Dialect, row: int) -> str:
    for number, block in _blocks(path, dialect):
        ends = np.flatnonzero(np.frombuffer(block, np.uint8) == ord("\n"))
        if len(ends) == 0 or ends[-1] != len(block) - 1:
            ends = np.append(ends, len(block))
        rows = np.flatnonzero(np.diff(ends, prepend=-1) > 1)  # a blank line is no row
        if row < len(rows):
            return f"line {number + rows[row]}"
        row -= len(rows)
    return "the last line"


def _numeric(path: str, dialect: _Dialect, names: Sequence[str]) -> list[str]:
    """Those of the columns that hold numbers, and no blank cell; InputError if the rows are not of one width."""
    numeric = list(names)
    for number, block in _blocks(path, dialect):
        if not numeric or _problem(block, dialect, numeric) is None:
            continue
        try:
            found = _parsed(pa.BufferReader(block), dialect, 0, {}, numeric)
        except pa.ArrowException as error:
            _explain_block(path, dialect, [], number, block, error)
        numeric = [
            name
            for name, column in zip(numeric, found.columns)
            if not column.null_count and (pa.types.is_integer(column.type) or pa.types.is_floating(column.type))
        ]
    return numeric


def _problem(block: bytes, dialect: _Dialect, names: Sequence[str]) -> object:
    """Why the columns cannot be read from these lines; None if they can."""
    try:
        table = _parsed(pa.BufferReader(block), dialect, 0, {name: pa.float64() for name in names}, names)
    except pa.ArrowException as error:
        return error
    return "blank cells" if any(column.null_count for column in table.columns) else None


def _explain(path: str, dialect: _Dialect, names: Sequence[str]) -> NoReturn:
    """Raise InputError for the first line that is ragged, blank or not a number where `names` ask for one."""
    empty = True
    for number, block in _blocks(path, dialect):
        empty = False
        problem = _problem(block, dialect, names)
        if problem is not None:
            _explain_block(path, dialect, names, number, block, problem)
    if empty:
        raise refusal(path, "has 0 samples under its header; 100 or more are expected")
    raise refusal(path, "cannot be read as CSV; export it again")


def _explain_block(
    path: str, dialect: _Dialect, names: Sequence[str], first: int, block: bytes, problem: object
) -> NoReturn:
    width = len(dialect.names)
    wanted = [(dialect.names.index(name), name) for name in names]
    for number, line in enumerate(block.decode(errors="replace").split("\n"), first):
        if not line:
            continue
        cells = split(line, dialect.separator)
        if len(cells) != width:
            hint = "write numbers with a decimal point" if len(cells) == 2 * width else "complete or remove the line"
            found = f"{len(cells)} cell{'s' * (len(cells) != 1)} where the header has {width}"
            raise refusal(path, f"line {number}: {found}; {hint}")
        for column, name in wanted:
            cell = cells[column].strip()
            if not cell:
                blank = "blank; a number is expected, fill it or remove the line"
                raise refusal(path, f"line {number}, column {quoted(name)!r}: {blank}")
            if not _is_number(cell, dialect.decimal):
                found = f"a number is expected, found {shown(cell)!r}; correct it or remove the line"
                raise refusal(path, f"line {number}, column {quoted(name)!r}: {found}")
    raise refusal(path, f"cannot be read as CSV from line {first} on ({shown(problem, 80)}); export it again")


def _is_number(cell: str, decimal: str) -> bool:
    if decimal == ",":
        cell = cell.replace(".", "?").replace(",", ".")
    return _NUMBER.fullmatch(cell) is not None


FORMAT = hinted(Hints())
