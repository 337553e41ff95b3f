"""What a format's file declares."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Columns:
    """Numbers as they stand in a file, not yet checked."""

    arrays: dict[str, Array]
    place: Callable[[int], str]  # the sample's index → where it stands: "line 2", "row 1"
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Format:
    """One kind of file.

    `header` returns the columns' names, in the file's order.  `read` returns those asked for (float64, one
    length; NaN stands for itself, a blank cell is refused).  `write` takes signals of one length and the
    file to make.  The first two raise InputError for files that are not well formed; all may raise OSError.
    """

    suffix: str
    title: str
    header: Callable[[str, int], list[str]]  # path, max_bytes in memory
    read: Callable[[str, Sequence[str], int], Columns]  # path, names, max_bytes in memory
    write: Callable[[Mapping[str, Array], str], None]
