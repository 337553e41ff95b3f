"""Reads a measurement from a file of any format."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from ema_model.measurement.checks import check_length, check_values, choose_columns
from ema_model.measurement.formats import Columns, format_of
from ema_model.measurement.measurement import Measurement
from ema_model.measurement.refusal import listed, reason, refusal


def read_measurement(path: str | os.PathLike[str], *, max_bytes: int = 2_000_000_000) -> Measurement:
    """The measurement in a file, its name the file's stem, its notes what was found and left aside.

    Raises InputError, one line with the file, the place in it and what to do, for whatever is wrong with the
    file; `max_bytes` bounds its size, on the disk and in memory.
    """
    path = os.fspath(path)
    _check_file(path, max_bytes)
    file_format = format_of(path)
    try:
        known, foreign = choose_columns(path, file_format.header(path))
        columns = file_format.read(path, known, max_bytes)
    except OSError as error:
        raise refusal(path, f"cannot be read ({reason(error)}); check the disk and the permissions") from None
    except MemoryError:
        raise refusal(path, "does not fit into memory; split it, or keep fewer columns") from None
    check_length(path, columns.arrays["time_s"].size)
    check_values(path, columns.arrays, columns.place)
    return _measurement(path, columns, foreign)


def _check_file(path: str, max_bytes: int) -> None:
    """Raises InputError for what is no file, an empty or too large a one."""
    try:
        status = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise refusal(path, "no such file; check the name and the folder") from None
    except (OSError, ValueError) as error:
        raise refusal(path, f"cannot be read ({reason(error)}); check the name and the permissions") from None
    if stat.S_ISDIR(status.st_mode):
        raise refusal(path, "is a folder; the file of a measurement is expected")
    if not stat.S_ISREG(status.st_mode):
        raise refusal(path, "is not a regular file; the file of a measurement is expected")
    if status.st_size == 0:
        raise refusal(path, "is empty; a measurement of 100 samples or more is expected")
    if status.st_size > max_bytes:
        size = f"is {status.st_size / 1e6:.6g} MB large, over the limit of {max_bytes / 1e6:g} MB"
        raise refusal(path, f"{size}; split it, or record fewer samples")


def _measurement(path: str, columns: Columns, foreign: list[str]) -> Measurement:
    for values in columns.arrays.values():
        values.flags.writeable = False  # ours alone, so that it need not be copied
    notes = list(columns.notes)
    named = [name for name in foreign if name]
    if named:
        notes.append(f"left aside, as their names are not known: {listed(named)}")
    bare = Measurement(columns.arrays)
    if not bare.is_uniform:
        off = f"samples lie up to {100.0 * bare.jitter:.3g} % of a period off a regular grid"
        notes.append(f"{off}; the median step is {bare.sample_period_s:.6g} s")
    return Measurement(bare.signals, Path(path).stem, tuple(notes))
