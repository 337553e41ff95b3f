"""Named arrays of any shape, as .npz and .mat files hold them, turned into columns."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ema_model.errors import InputError
from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.formats.format import Array, Columns
from ema_model.recordings.refusal import listed, refusal, shown

Shape = tuple[int, ...]
Kind = tuple[Shape, np.dtype[Any]]


def is_column(kind: Kind) -> bool:
    """Whether it holds two or more real numbers in a row or a column: (n,), (n, 1) or (1, n)."""
    shape, dtype = kind
    return dtype.kind in "fiub" and np.prod(shape, dtype=float) > 1 and sum(size != 1 for size in shape) == 1


def column_names(kinds: Mapping[str, Kind]) -> list[str]:
    """The names to offer as columns.

    Scalars, tables and text are left aside, since such files hold parameters and labels too; under a
    canonical name they stay, so that reading them says what is wrong with them.
    """
    return [name for name, kind in kinds.items() if is_column(kind) or name in SIGNALS]


def check_column(path: str, name: str, kind: Kind) -> None:
    """Raises InputError for what is no column of numbers."""
    shape, dtype = kind
    if dtype.kind not in "fiub":
        found = {"U": "text", "S": "text", "c": "complex numbers", "M": "dates", "O": "objects"}.get(
            dtype.kind, "no numbers"
        )
        raise refusal(path, f"column {shown(name)!r} holds {found}; real numbers are expected, store it as double")
    if 0 in shape:
        raise refusal(path, f"column {shown(name)!r} is empty; fill or remove it")
    if not is_column(kind):
        raise refusal(path, f"column {shown(name)!r} is {sizes(shape)}; one vector of numbers per signal is expected")


def sizes(shape: Shape) -> str:
    """A shape as people write it: "3×4"."""
    return "×".join(str(size) for size in shape) or "a single value"


def as_columns(path: str, arrays: Mapping[str, Any], aside: Iterable[str]) -> Columns:
    """Vectors of one length as float64 columns; `aside` names what the file holds besides.

    Raises InputError if the lengths differ.
    """
    columns: dict[str, Array] = {}
    with np.errstate(over="ignore"):  # an infinite value is told later, with its place
        for name, values in arrays.items():
            # A copy of its own, aligned and of this machine's byte order.
            columns[name] = np.array(values, np.float64).reshape(-1)
    check_lengths(path, columns)
    names = list(aside)
    notes = (f"left aside, as they are no columns of numbers: {listed(names)}",) if names else ()
    return Columns(columns, lambda row: f"sample {row + 1}", notes)


def check_lengths(path: str, columns: Mapping[str, Array]) -> None:
    """Raises InputError unless all have the length of the first."""
    names = list(columns)
    for name in names[1:]:
        if columns[name].size != columns[names[0]].size:
            found = f"{columns[name].size} values where {shown(names[0])!r} has {columns[names[0]].size}"
            raise refusal(path, f"column {shown(name)!r} has {found}; one length is expected, cut or resample it")


def check_size(path: str, kinds: Mapping[str, Kind], names: Sequence[str], max_bytes: int) -> None:
    """Raises InputError if the columns asked for take more than `max_bytes` in memory."""
    size = sum(8.0 * np.prod(kinds[name][0], dtype=float) for name in names)
    if size > max_bytes:
        raise unpacks_to(path, size, max_bytes)


def unpacks_to(path: str, size: float, max_bytes: int) -> InputError:
    """The error for a file that takes too much memory: a small one may declare, or unpack to, any size."""
    return refusal(path, f"unpacks to {size / 1e6:.6g} MB, over the limit of {max_bytes / 1e6:g} MB; split it")
