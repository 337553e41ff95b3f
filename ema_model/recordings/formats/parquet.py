"""Parquet: one float64 column per signal; the schema's metadata holds emaviz_schema = 1."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ema_model.recordings.formats.arrays import unpacks_to
from ema_model.recordings.formats.format import Array, Columns, Format
from ema_model.recordings.refusal import refusal, shown

_KEY, _VERSION = b"emaviz_schema", b"1"


def _header(path: str, max_bytes: int) -> list[str]:
    del max_bytes  # only the header is read
    with _opened(path) as file:
        version = (file.schema_arrow.metadata or {}).get(_KEY, _VERSION)
        if version != _VERSION:
            raise refusal(path, f"{_KEY.decode()} {shown(version.decode(errors='replace'))} is not known; expected 1")
        return file.schema_arrow.names


def _read(path: str, names: Sequence[str], max_bytes: int) -> Columns:
    with _opened(path) as file:
        # Runs of equal values pack so well that a small file can fill the memory.
        size = file.metadata.num_rows * len(names) * 8
        if size > max_bytes:
            raise unpacks_to(path, size, max_bytes)
        for name in names:
            kind = file.schema_arrow.field(name).type
            if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)):
                raise refusal(path, f"column {name!r} holds {shown(kind)}; numbers are expected, store it as double")
        table = file.read(columns=list(names))
    arrays = {}
    for name in names:
        column = table[name]
        if column.null_count:
            row = np.flatnonzero(column.is_null().to_numpy())[0]
            raise refusal(path, f"{_place(row)}, column {name!r}: blank; a number is expected, fill or remove the row")
        arrays[name] = column.to_numpy().astype(np.float64)
    return Columns(arrays, _place)


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
        try:
            with pq.ParquetFile(file) as parquet:
                yield parquet
        except (pa.ArrowException, OSError, UnicodeError) as error:
            problem = f"is not a whole Parquet file ({shown(error, 80)}); export it again"
            raise refusal(path, problem) from None


FORMAT = Format(".parquet", "Parquet", _header, _read, _write)
