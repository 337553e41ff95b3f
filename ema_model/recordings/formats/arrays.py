"""Named arrays of any shape, as .npz and .mat files hold them, turned into columns."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.files.refusal import listed, refusal, shown
from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.formats.format import Array, Columns, check_size

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


def take(
    path: str,
    kinds: Mapping[str, Kind],
    names: Sequence[str],
    max_bytes: int,
    strict: bool,
    values: Callable[[str], NDArray[Any]],
) -> Columns:
    """The columns asked for as float64; `values` gives each.  Unless `strict`, only those that are columns.

    Raises InputError for what is no column, takes too much memory, or has another length than the first.
    """
    if strict:
        for name in names:
            check_column(path, name, kinds[name])
    else:
        names = [name for name in names if is_column(kinds[name])]
    check_size(path, sum(np.prod(kinds[name][0], dtype=float) for name in names), max_bytes)
    columns: dict[str, Array] = {}
    with np.errstate(over="ignore"):  # an infinite value is told later, with its place
        for name in names:
            # Aligned, of this machine's byte order, and not a copy where it is so already.
            columns[name] = np.require(values(name).reshape(-1), np.float64, ["C", "A"])
    if strict:
        check_lengths(path, columns)
    aside = [name for name, kind in kinds.items() if not is_column(kind)]
    notes = (f"left aside, as they are no columns of numbers: {listed(aside)}",) if aside else ()
    return Columns(columns, lambda row: f"sample {row + 1}", notes)


def check_lengths(path: str, columns: Mapping[str, Array]) -> None:
    """Raises InputError unless all have the length of the first."""
    names = list(columns)
    for name in names[1:]:
        if columns[name].size != columns[names[0]].size:
            found = f"{columns[name].size} values where {shown(names[0])!r} has {columns[names[0]].size}"
            raise refusal(path, f"column {shown(name)!r} has {found}; one length is expected, cut or resample it")
