"""Parquet: a column per signal, or one with several numbers a row; ours say emaviz_schema = 1 in the metadata."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.parquet as pq

from ema_model.errors import quoted
from ema_model.files.limits import COLUMNS, megabytes
from ema_model.files.refusal import refusal, shown
from ema_model.recordings.formats import robot_dataset
from ema_model.recordings.formats.channels import MOST_COLUMNS
from ema_model.recordings.formats.format import Array, Columns, Format, check_size
from ema_model.recordings.formats.parquet_pages import Damaged, TooMany, footer_size, numbers_and_bytes

pc: Any = pyarrow.compute  # its functions are made when it is imported
_FOOTER_BYTES = 4_000_000
_BUFFER_BYTES = 1 << 20  # else a column's packed bytes are read at once
_MOST_PARTS = 2 * COLUMNS  # of any list in the footer: columns, row groups
_KEY, _VERSION = b"emaviz_schema", b"1"


def _header(path: str, max_bytes: int) -> list[str]:
    del max_bytes  # only the header is read
    with _opened(path) as file:
        version = (file.schema_arrow.metadata or {}).get(_KEY, _VERSION)
        if version != _VERSION:
            raise refusal(path, f"{_KEY.decode()} {shown(version.decode(errors='replace'))} is not known; expected 1")
        names = file.schema_arrow.names
        return list(_places(path, file.schema_arrow)) if len(set(names)) == len(names) else names


def _read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    with _opened(path) as file:
        schema = file.schema_arrow
        places = _places(path, schema)
        kinds = {name: _kind(schema, places[name]) for name in names}
        numeric = [name for name in names if _is_numeric(kinds[name])]
        if strict and len(numeric) < len(names):
            name = next(name for name in names if name not in numeric)
            raise refusal(
                path, f"column {quoted(name)!r} holds {shown(kinds[name])}; numbers are expected, store it as double"
            )
        fields = list(dict.fromkeys(places[name][0] for name in numeric))
        _check_contents(path, fields, file.metadata.num_rows, max_bytes)
        table = file.read(columns=fields)
    columns = dict(zip(fields, table.columns))
    del table  # each column goes when it is converted
    arrays = {}
    left = Counter(places[name][0] for name in numeric)
    for name in numeric:
        field, part = places[name]
        left[field] -= 1
        column = columns[field] if left[field] else columns.pop(field)
        if part is not None:
            column = _part(path, name, column, part)
        if not column.null_count:
            arrays[name] = column.to_numpy().astype(np.float64, copy=False)
        elif strict:
            row = np.flatnonzero(column.is_null().to_numpy())[0]
            raise refusal(
                path, f"{_place(row)}, column {quoted(name)!r}: blank; a number is expected, fill or remove the row"
            )
    return Columns(arrays, _place)


def _places(path: str, schema: pa.Schema) -> dict[str, tuple[str, int | None]]:
    """Where each column stands: a field, or one of the numbers that a field has for each row."""
    places: dict[str, tuple[str, int | None]] = {}
    parts = robot_dataset.names_of_parts(path)
    for field in schema:
        known = parts.get(field.name, [])
        size = len(known) if pa.types.is_list(field.type) else 0  # of another length than its rows say
        if pa.types.is_fixed_size_list(field.type):
            size = field.type.list_size
        if 0 < size <= MOST_COLUMNS:
            names = known if len(known) == size else [f"{i}" for i in range(size)]
            places |= {f"{field.name}.{name}": (field.name, i) for i, name in enumerate(names)}
        else:
            own = f".{known[0]}" if len(known) == 1 else ""
            places[f"{field.name}{own}"] = (field.name, None)
    return places


def _kind(schema: pa.Schema, place: tuple[str, int | None]) -> pa.DataType:
    kind = schema.field(place[0]).type
    return kind if place[1] is None else kind.value_type


def _part(path: str, name: str, rows: pa.ChunkedArray, part: int) -> pa.ChunkedArray:
    """One number of each row's list."""
    try:
        return pc.list_element(rows, part)
    except pa.ArrowInvalid:
        raise refusal(path, f"column {quoted(name)!r}: some rows have fewer numbers; export it again") from None


def _is_numeric(kind: pa.DataType) -> bool:
    return pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)


def _check_contents(path: str, names: Sequence[str], rows: int, max_bytes: int) -> None:
    """Raises InputError if the columns take more than `max_bytes` in memory, or on the way there."""
    with open(path, "rb") as file:
        try:
            numbers, unpacked = numbers_and_bytes(file, names)
        except Damaged:
            raise refusal(path, "is not a whole Parquet file (its contents are damaged); export it again") from None
        except TooMany:
            raise refusal(path, "has far too many pages; export it again with pages of 1 MB") from None
    check_size(path, max(numbers, rows * len(names), unpacked / 8), max_bytes)


def _write(signals: Mapping[str, Array], path: str) -> None:
    table = pa.table(dict(signals)).replace_schema_metadata({_KEY: _VERSION})
    # An open file, so that a name with odd characters is never taken for an address.
    with open(path, "wb") as file:
        pq.write_table(table, file)


def _place(row: int) -> str:
    return f"row {row + 1}"


@contextmanager
def _opened(path: str) -> Iterator[pq.ParquetFile]:
    """The Parquet file; what its library cannot read becomes an InputError."""
    with open(path, "rb") as file:
        _check_footer(path, file)
        try:
            with pq.ParquetFile(
                file, pre_buffer=False, buffer_size=_BUFFER_BYTES, thrift_container_size_limit=_MOST_PARTS
            ) as parquet:
                yield parquet
        except (pa.ArrowException, OSError, UnicodeError) as error:
            if "size limit" in str(error):
                raise refusal(path, f"has over {COLUMNS} columns, or far too many parts; keep fewer columns") from None
            problem = f"is not a whole Parquet file ({shown(error, 80)}); export it again"
            raise refusal(path, problem) from None


def _check_footer(path: str, file: BinaryIO) -> None:
    """Raises InputError for a list of contents out of all proportion: in memory it takes many times its size."""
    size = footer_size(file)
    if size > _FOOTER_BYTES:
        found = f"lists its contents in {megabytes(size)}, over the limit of {megabytes(_FOOTER_BYTES)}"
        raise refusal(path, f"{found}; keep fewer columns, or write larger row groups")
    file.seek(0)


FORMAT = Format(".parquet", "Parquet", _header, _read, _write)
