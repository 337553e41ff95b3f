"""Parquet: one float64 column per signal; the schema's metadata holds emaviz_schema = 1."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ema_model.errors import quoted
from ema_model.files.limits import COLUMNS, megabytes
from ema_model.files.refusal import refusal, shown
from ema_model.recordings.formats.format import Array, Columns, Format, check_size
from ema_model.recordings.formats.parquet_pages import Damaged, TooMany, unpacked_bytes

_FOOTER_BYTES = 8_000_000
_MOST_PARTS = 2 * COLUMNS  # of any list in the footer: columns, row groups
_KEY, _VERSION = b"emaviz_schema", b"1"


def _header(path: str, max_bytes: int) -> list[str]:
    del max_bytes  # only the header is read
    with _opened(path) as file:
        version = (file.schema_arrow.metadata or {}).get(_KEY, _VERSION)
        if version != _VERSION:
            raise refusal(path, f"{_KEY.decode()} {shown(version.decode(errors='replace'))} is not known; expected 1")
        return file.schema_arrow.names


def _read(path: str, names: Sequence[str], max_bytes: int, strict: bool) -> Columns:
    with _opened(path) as file:
        schema = file.schema_arrow
        kinds = {name: schema.field(name).type for name in names}
        numeric = [name for name in names if _is_numeric(kinds[name])]
        if strict and len(numeric) < len(names):
            name = next(name for name in names if name not in numeric)
            raise refusal(
                path, f"column {quoted(name)!r} holds {shown(kinds[name])}; numbers are expected, store it as double"
            )
        check_size(path, _values(file.metadata, numeric), max_bytes)
        check_size(path, _unpacked_bytes(path, file.metadata, numeric) / 8, max_bytes)
        table = file.read(columns=numeric)
    columns = dict(zip(numeric, table.columns))
    del table  # each column goes when it is converted
    arrays = {}
    for name in numeric:
        column = columns.pop(name)
        if not column.null_count:
            arrays[name] = column.to_numpy().astype(np.float64, copy=False)
        elif strict:
            row = np.flatnonzero(column.is_null().to_numpy())[0]
            raise refusal(
                path, f"{_place(row)}, column {quoted(name)!r}: blank; a number is expected, fill or remove the row"
            )
    return Columns(arrays, _place)


def _is_numeric(kind: pa.DataType) -> bool:
    return pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)


def _values(metadata: pq.FileMetaData, names: Sequence[str]) -> int:
    """How many numbers the columns have: as their parts tell, which are what is read, or the file itself."""
    asked = set(names)
    total = 0
    for i in range(metadata.num_row_groups):
        group = metadata.row_group(i)
        chunks = [group.column(j) for j in range(group.num_columns)]
        total += sum(max(c.num_values, group.num_rows) for c in chunks if c.path_in_schema in asked)
    return max(total, metadata.num_rows * len(names))


def _unpacked_bytes(path: str, metadata: pq.FileMetaData, names: Sequence[str]) -> int:
    with open(path, "rb") as file:
        try:
            return unpacked_bytes(file, metadata, names)
        except Damaged:
            problem = "is not a whole Parquet file (a page's header is damaged); export it again"
            raise refusal(path, problem) from None
        except TooMany:
            raise refusal(path, "has far too many pages; export it again with pages of 1 MB") from None


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
            with pq.ParquetFile(file, pre_buffer=False, thrift_container_size_limit=_MOST_PARTS) as parquet:
                yield parquet
        except (pa.ArrowException, OSError, UnicodeError) as error:
            if "size limit" in str(error):
                raise refusal(path, f"has over {COLUMNS} columns, or far too many parts; keep fewer columns") from None
            problem = f"is not a whole Parquet file ({shown(error, 80)}); export it again"
            raise refusal(path, problem) from None


def _check_footer(path: str, file: BinaryIO) -> None:
    """Raises InputError for a list of contents out of all proportion: in memory it takes many times its size."""
    file.seek(-min(8, file.seek(0, os.SEEK_END)), os.SEEK_END)
    size, mark = int.from_bytes(file.read(4), "little"), file.read(4)
    file.seek(0)
    if mark == b"PAR1" and size > _FOOTER_BYTES:
        found = f"lists its contents in {megabytes(size)}, over the limit of {megabytes(_FOOTER_BYTES)}"
        raise refusal(path, f"{found}; keep fewer columns, or write larger row groups")


FORMAT = Format(".parquet", "Parquet", _header, _read, _write)
