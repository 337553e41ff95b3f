"""CSV: a header line, then numbers; commas, semicolons or tabs between them.

A file of another layout, as instruments write it, is read by `text_columns`.  A plain one is read at full speed.  Only
when that fails it is read again in blocks, and the one that fails is walked line by line, to name the bad cell.
"""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import BinaryIO, NoReturn

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from ema_model.errors import quoted
from ema_model.files.limits import LINE_BYTES, megabytes
from ema_model.files.refusal import listed, refusal, shown
from ema_model.recordings.formats.format import Array, Columns, Format, check_size
from ema_model.recordings.formats.text_columns import read_leaving_out, read_table
from ema_model.recordings.formats.text_layout import Head, Hints, find_layout, read_head, split
from ema_model.recordings.formats.text_table import TextTable, table_of

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
    arrays = {name: columns.pop(name).to_numpy() for name in names}
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
        raise refusal(path, f"line {first + 1}: {found}; add a header line")
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
