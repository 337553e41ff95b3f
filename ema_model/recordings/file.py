"""A file of any format as columns, and as a measurement once it is known which column is which signal.

`ema_model.recordings.read` is the way in; this is what it is built on.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ema_model.errors import InputError, did_you_mean
from ema_model.files.limits import FILE_BYTES, megabytes
from ema_model.files.refusal import listed, reason, refusal, shown
from ema_model.files.user_file import check_user_file
from ema_model.recordings.checks import check_finite, check_length, check_names, check_values, choose_columns
from ema_model.recordings.columns.mapping import ColumnMapping, apply_mapping, parse_mapping
from ema_model.recordings.columns.reading import Reading
from ema_model.recordings.delays import without_delays
from ema_model.recordings.formats import Format, format_of
from ema_model.recordings.formats.clocks import Clocks
from ema_model.recordings.formats.text_layout import Head, Hints
from ema_model.recordings.measurement import Measurement
from ema_model.recordings.side_file.read import SideFile, find_side_file, read_side_file

Array = NDArray[np.float64]
NONE = Hints()


def read_measurement(
    path: str | os.PathLike[str],
    mapping: ColumnMapping | Sequence[str] | None = None,
    *,
    side: SideFile | None = None,
    max_bytes: int = FILE_BYTES,
    hints: Hints = NONE,
) -> Measurement:
    """The measurement in a file, its name the file's stem, its notes what was found and left aside.

    `mapping`, or texts as of `--map`, says which columns are which signals; columns with canonical names
    need none.  `side` is what else is known; without it the file's side file is read, or its folder's, if there
    is one, and its mapping, window and segments are used.  A given mapping's entries go before the side file's.
    Raises InputError, one line with the file, the place in it and what to do, for whatever is wrong with the
    file; `max_bytes` bounds its size, on the disk and in memory.
    """
    path = os.fspath(path)
    check_file(path, max_bytes)
    notes = []
    if side is None:
        found = find_side_file(path)
        side = read_side_file(found) if found else SideFile()
        if found:
            notes.append(f"the side file {shown(found.name, 100)} is used")
    file_format = said_format(path, hints_of(path, side, hints))
    with _told(path):
        header = file_format.header(path, max_bytes)
        used = _merged(path, side, mapping, header)
        known, foreign = choose_columns(
            path, header, used, needs_time=side.kind == "run", looked_at=isinstance(mapping, ColumnMapping)
        )
        columns = file_format.read(path, known, max_bytes, True)
        check_length(path, next(iter(columns.arrays.values())).size)
        check_finite(path, columns.arrays, columns.place)
        signals, done = apply_mapping(columns.arrays, used)
        columns.arrays.clear()  # they are copied, and large; Arrow would keep their memory for later
        pa.default_memory_pool().release_unused()
    if side.kind == "map" and "time_s" not in signals:
        signals = {"time_s": np.arange(float(next(iter(signals.values())).size)), **signals}
        done = (*done, "a static map without time: time_s counts the samples")
    check_values(path, signals, columns.place)
    told = (*([columns.layout] if columns.layout else []), *columns.notes, *notes, *done)
    bare = _measurement(path, signals, told, foreign, side)
    name = " ".join(filter(None, (bare.name, columns.title)))
    clocks = columns.clocks and _of_signals(columns.clocks, used)
    measurement = replace(bare, name=name, reading=Reading(clocks=clocks, layout=columns.layout))
    measurement = without_delays(measurement, used)
    check_length(path, measurement.samples)
    if side.window_s is not None or side.segments is not None:
        try:
            measurement = measurement.selected(side.window_s, side.segments)
        except InputError as error:
            raise refusal(path, str(error).removeprefix(f"{shown(measurement.name, 100)}: ")) from None
        check_length(path, measurement.samples)
    return measurement


def read_header(path: str, max_bytes: int, hints: Hints = NONE) -> list[str]:
    """The columns' names in the file's order; InputError for a file that cannot be read as a table."""
    check_file(path, max_bytes)
    with _told(path):
        return said_format(path, hints).header(path, max_bytes)


def read_head(path: str | os.PathLike[str], *, max_bytes: int = FILE_BYTES, hints: Hints = NONE) -> Head | None:
    """The first lines of a text and the layout found in them, for a person to look at; None for another format.

    Raises InputError for what is no text, and for hints that do not fit it.
    """
    path = os.fspath(path)
    check_file(path, max_bytes)
    with _told(path):
        head = said_format(path, hints).head
        return head(path, max_bytes) if head is not None else None


def read_columns(path: str | os.PathLike[str], *, max_bytes: int = FILE_BYTES, hints: Hints = NONE) -> dict[str, Array]:
    """The columns of numbers as they stand in the file, for a mapping step to show; others are left out.

    Raises InputError for a file that cannot be read as a table at all; the values are not checked.
    """
    path = os.fspath(path)
    check_file(path, max_bytes)
    file_format = said_format(path, hints)
    with _told(path):
        names = [name for name in file_format.header(path, max_bytes) if name]
        check_names(path, names)
        if not names:
            raise refusal(path, "has no columns")
        # What is wrong with all of them is told as for a measurement.
        return (
            file_format.read(path, names, max_bytes, False).arrays
            or file_format.read(path, names, max_bytes, True).arrays
        )


def hints_of(path: str, side: SideFile, given: Hints = NONE) -> Hints:
    """What is said of a text's layout: as given, then as in the side file, which may stand beside other formats too."""
    return given.before(side.text) if format_of(path).hinted is not None else given


def said_format(path: str, hints: Hints) -> Format:
    """The file's format, reading it as somebody has said that it is laid out; InputError where it is no text."""
    found = format_of(path)
    if hints == NONE:
        return found
    if found.hinted is None:
        raise refusal(path, f"is {found.title}, no text; leave --header-line and --encoding out")
    return found.hinted(hints)


@contextmanager
def _told(path: str) -> Iterator[None]:
    """What the system cannot do becomes an InputError."""
    try:
        yield
    except OSError as error:
        raise refusal(path, f"cannot be read ({reason(error)}); check the disk and the permissions") from None
    except MemoryError:
        raise refusal(path, "does not fit into memory; split it, or keep fewer columns") from None


def _merged(
    path: str, side: SideFile, given: ColumnMapping | Sequence[str] | None, header: Sequence[str]
) -> ColumnMapping:
    """The mapping to use, given entries before the side file's; InputError if a column is missing."""
    if isinstance(given, str):
        given = [given]
    if given is not None and not isinstance(given, ColumnMapping):
        given = parse_mapping(given, header)
    merged = side.mapping or ColumnMapping()
    for entry in given.entries if given else ():
        merged = merged.with_entry(entry)
    for entry in merged.entries:
        if entry.column not in header:
            by_side = side.mapping is not None and entry in side.mapping.entries and side.path
            asker = f", which {shown(Path(side.path).name, 100)} asks for" if by_side and side.path else ""
            missing = f"no column {shown(entry.column)!r} for {entry.signal}{asker}"
            meant = did_you_mean(entry.column, header)
            raise refusal(path, f"{missing}; correct the mapping (present: {listed(header)}){meant}")
    return merged


def _of_signals(clocks: Clocks, mapping: ColumnMapping) -> Clocks:
    mapped = {entry.column for entry in mapping.entries}
    of = {name: clock for name, clock in clocks.of.items() if name not in mapped}
    of |= {entry.signal: clocks.of[entry.column] for entry in mapping.entries if entry.column in clocks.of}
    return replace(clocks, of=of)


def check_file(path: str, max_bytes: int) -> None:
    """Raises InputError for what is no file, an empty or too large a one."""
    status = check_user_file(path, "the file of a measurement")
    if status.st_size == 0:
        raise refusal(path, "is empty; a measurement of 100 samples or more is expected")
    if status.st_size > max_bytes:
        size = f"is {megabytes(status.st_size)} large, over the limit of {megabytes(max_bytes)}"
        raise refusal(path, f"{size}; split it, or record fewer samples")


def _measurement(
    path: str, signals: dict[str, Array], notes: Sequence[str], foreign: Sequence[str], side: SideFile
) -> Measurement:
    for values in signals.values():
        values.flags.writeable = False  # ours alone, so that it need not be copied
    notes = list(notes)
    named = [name for name in foreign if name]
    if named:
        notes.append(f"left aside, as their names are not known: {listed(named)}")
    bare = Measurement(signals)
    if not bare.is_uniform:
        off = f"samples lie up to {100.0 * bare.jitter:.3g} % of a period off a regular grid"
        notes.append(f"{off}; the median step is {bare.sample_period_s:.6g} s")
    return Measurement(bare.signals, Path(path).stem, tuple(notes), side)
