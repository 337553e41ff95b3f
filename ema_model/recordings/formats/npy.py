"""NumPy's .npy: a structured array gives a column per field, a matrix its columns."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from ema_model.files.opened import refusal, shown
from ema_model.recordings.formats.channels import (
    Channel,
    Log,
    Matrix,
    NoLog,
    broken_file,
    in_columns,
    log_format,
    without_ones,
)


@contextmanager
def opened(path: str, most_bytes: int) -> Iterator[Log]:
    """The array's columns; NoLog for what is none."""
    del most_bytes  # a map of the file is no larger than the file
    with broken_file():  # the header is a Python expression, which fails in any way
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(array, np.memmap):
        raise NoLog("it is no array of numbers")
    yield Log(_channels(path, array))


def _channels(path: str, array: Any) -> list[Channel]:
    if array.dtype.names:
        rows = array.reshape(-1)
        kinds = {name: array.dtype[name] for name in array.dtype.names}
        return [
            Channel((name,), rows.size, lambda name=name: np.array(rows[name]))
            for name, kind in kinds.items()
            if kind.kind in "fiub" and not kind.shape
        ]
    if array.dtype.kind not in "fiub":
        raise refusal(path, f"holds {shown(array.dtype)}; numbers are expected, store it as double")
    size = without_ones(array.shape)
    if len(size) == 2 and (columns := in_columns([Matrix(("data",), size, lambda: array.reshape(size))])[0]):
        return [replace(one, values=lambda one=one: np.array(one.values())) for one in columns]
    shape = "×".join(map(str, array.shape)) or "a single value"
    raise refusal(path, f"is {shape}; a structured array, or a matrix with a column for each signal is expected")


FORMAT = log_format(__name__, "NumPy array", ".npy")
