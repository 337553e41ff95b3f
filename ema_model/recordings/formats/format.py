"""What a format's file declares."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.files.opened import megabytes, refusal
from ema_model.recordings.formats.clocks import Clocks
from ema_model.recordings.formats.text_layout import Head, Hints

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Columns:
    """Numbers as they stand in a file, not yet checked."""

    arrays: dict[str, Array]
    place: Callable[[int], str]  # the sample's index → where it stands: "line 2", "row 1"
    notes: tuple[str, ...] = ()
    title: str = ""  # what the file calls the run, beside its own name
    clocks: Clocks | None = None  # of the columns, where they have several
    layout: str = ""  # what was found out by itself of how the file is laid out, for a person to look at


def check_size(path: str, numbers: float, max_bytes: int) -> None:
    """Raises InputError if so many numbers take more memory than `max_bytes`: a small file may declare any number."""
    if 8.0 * numbers > max_bytes:
        size = f"unpacks to {megabytes(8.0 * numbers)}, over the limit of {megabytes(max_bytes)}"
        raise refusal(path, f"{size}; split it, or keep fewer columns")


@dataclass(frozen=True)
class Format:
    """One kind of file.

    `header` returns the columns' names, in the file's order.  `read` returns those asked for (float64, one
    length; NaN stands for itself, a blank cell is refused); unless `strict`, those that are columns of numbers by
    themselves, of whatever length.  `write` takes signals of one length and the file to make; formats that are only
    read have none.  The first two raise InputError for files that are not well formed or take more than `max_bytes`
    in memory; all may raise OSError.
    """

    suffix: str
    title: str
    header: Callable[[str, int], list[str]]  # path, max_bytes in memory
    read: Callable[[str, Sequence[str], int, bool], Columns]  # path, names, max_bytes in memory, strict
    write: Callable[[Mapping[str, Array], str], None] | None = None
    others: tuple[str, ...] = ()  # further suffixes of the same kind of file
    doubtful: tuple[str, ...] = ()  # suffixes that files of other things have as well: notes, settings, a run's record
    hinted: Callable[[Hints], Format] | None = None  # the same for a text of which somebody has said the layout
    head: Callable[[str, int], Head | None] | None = None  # path, max_bytes: a text's first lines; None for no text

    @property
    def suffixes(self) -> tuple[str, ...]:
        """All of them, the usual one first."""
        return (self.suffix, *self.others)
