"""Arrow's columns as numpy's, and back, without pandas.

Arrow's own `to_numpy` and `array` import pandas where it is installed, to see whether something is pandas': a third of
a second, before the first file is read.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa


def as_numpy(column: Any) -> np.ndarray:
    """Numbers or truth values of an Arrow array, chunked or not; blank ones are NaN, among integers as doubles."""
    if not (pa.types.is_boolean(column.type) or pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
        return column.to_numpy()
    if pa.types.is_boolean(column.type):
        return as_numpy(column.cast(pa.uint8())).astype(bool if not column.null_count else float)
    blank = column.null_count > 0
    dtype = np.dtype(column.type.to_pandas_dtype())
    values = np.empty(len(column), np.dtype(float) if blank and dtype.kind != "f" else dtype)
    at = 0
    for chunk in column.chunks if isinstance(column, pa.ChunkedArray) else [column]:
        if len(chunk):
            part = values[at : at + len(chunk)]
            part[:] = np.frombuffer(chunk.buffers()[1], dtype, len(chunk), chunk.offset * dtype.itemsize)
            if chunk.null_count:
                part[~as_numpy(chunk.is_valid())] = np.nan
            at += len(chunk)
    return values


def mask(values: np.ndarray) -> Any:
    """Truth values, as Arrow takes them."""
    bytes_ = pa.py_buffer(np.ascontiguousarray(values, bool).view(np.uint8))
    return pa.Array.from_buffers(pa.uint8(), len(values), [None, bytes_]).cast(pa.bool_())
