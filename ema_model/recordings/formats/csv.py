"""CSV: a header line, then numbers; commas, semicolons or tabs between them.

A file is read at full speed.  Only when that fails it is walked line by line, to name the bad cell.
"""

from __future__ import annotations

import codecs
import csv
import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

import pyarrow as pa
import pyarrow.csv as pc

from ema_model.recordings.formats.format import Array, Columns, Format
from ema_model.recordings.refusal import listed, refusal, shown

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


def _header(path: str, max_bytes: int) -> list[str]:
    del max_bytes  # only the header is read
    return _dialect(path).names


def _read(path: str, names: Sequence[str], max_bytes: int) -> Columns:
    del max_bytes  # the file's size bounds it: a number takes 8 bytes in memory and as text 2 or more
    dialect = _dialect(path)
    try:
        with open(path, "rb") as file:
            table = pc.read_csv(
                file,
                pc.ReadOptions(column_names=dialect.names, skip_rows=dialect.header_lines),
                pc.ParseOptions(delimiter=dialect.separator),
                pc.ConvertOptions(
                    column_types={name: pa.float64() for name in names},
                    include_columns=list(names),
                    null_values=[""],
                    decimal_point=dialect.decimal,
                ),
            )
    except pa.ArrowException as error:
        _explain(path, dialect, names, error)
    if any(column.null_count for column in table.columns):
        _explain(path, dialect, names, "blank cells")
    notes = []
    if dialect.separator != ",":
        notes.append(f"columns are separated by {_SEPARATORS[dialect.separator]}")
    if dialect.decimal != ".":
        notes.append("numbers are written with a decimal comma")
    arrays = {name: table[name].to_numpy() for name in names}
    return Columns(arrays, lambda row: _place(path, dialect, row), tuple(notes))


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
        raise refusal(path, "is not text in UTF-8; export it again as CSV in UTF-8")
    lines = re.split(r"\r\n|\r|\n", text)
    first = next((i for i, line in enumerate(lines) if line.strip()), None)
    if first is None:
        raise refusal(path, "is empty; a header line and 100 samples or more are expected")
    if first == len(lines) - 1 and len(head) == _HEAD_BYTES:
        raise refusal(path, f"line {first + 1} is over 64 kB long; a header line with the columns' names is expected")
    separator = max(_SEPARATORS, key=lines[first].count)
    names = [name.strip() for name in _cells(lines[first], separator)]
    if any(_NUMBER.fullmatch(name) for name in names):
        found = f"names of columns are expected, found {listed(names)}"
        raise refusal(path, f"line {first + 1}: {found}; add a header line")
    # The last line may be cut.
    cells = (cell for line in lines[first + 1 : -1] for cell in line.split(separator))
    comma = separator != "," and any(re.fullmatch(r"\s*[+-]?[0-9]*,[0-9]+(e[+-]?[0-9]+)?\s*", c, re.I) for c in cells)
    return _Dialect(names, first + 1, separator, "," if comma else ".")


def _cells(line: str, separator: str) -> list[str]:
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def _rows(path: str, dialect: _Dialect) -> Iterator[tuple[int, str]]:
    """Number and text of the lines that hold a row."""
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(file, 1):
            if number > dialect.header_lines and line != "\n":
                yield number, line.removesuffix("\n")


def _place(path: str, dialect: _Dialect, row: int) -> str:
    number, _ = next(itertools.islice(_rows(path, dialect), row, None), (dialect.header_lines + row + 1, ""))
    return f"line {number}"


def _explain(path: str, dialect: _Dialect, names: Sequence[str], error: object) -> NoReturn:
    """Raise InputError for the first line that is ragged, blank or not a number where `names` ask for one."""
    width = len(dialect.names)
    wanted = [(dialect.names.index(name), name) for name in names]
    for number, line in _rows(path, dialect):
        cells = _cells(line, dialect.separator)
        if len(cells) != width:
            hint = "write numbers with a decimal point" if len(cells) == 2 * width else "complete or remove the line"
            found = f"{len(cells)} cell{'s' * (len(cells) != 1)} where the header has {width}"
            raise refusal(path, f"line {number}: {found}; {hint}")
        for column, name in wanted:
            cell = cells[column].strip()
            if not cell:
                problem = "blank; a number is expected, fill it or remove the line"
                raise refusal(path, f"line {number}, column {name!r}: {problem}")
            if not _is_number(cell, dialect.decimal):
                problem = f"a number is expected, found {shown(cell)!r}; correct it or remove the line"
                raise refusal(path, f"line {number}, column {name!r}: {problem}")
    if next(_rows(path, dialect), None) is None:
        raise refusal(path, "has 0 samples under its header; 100 or more are expected")
    raise refusal(path, f"cannot be read as CSV ({shown(error, 80)}); export it again")


def _is_number(cell: str, decimal: str) -> bool:
    if decimal == ",":
        cell = cell.replace(".", "?").replace(",", ".")
    return _NUMBER.fullmatch(cell) is not None


FORMAT = Format(".csv", "CSV", _header, _read, _write)
