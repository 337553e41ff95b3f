"""Writes a measurement to a file of any format."""

from __future__ import annotations

import os

from ema_model.files.opened import reason, refusal, shown
from ema_model.files.written import whole_file
from ema_model.recordings.formats import WRITTEN, format_of
from ema_model.recordings.measurement import Measurement
from ema_model.recordings.read import check_finite


def write_measurement(measurement: Measurement, path: str | os.PathLike[str]) -> None:
    """Writes all signals in the format that the suffix names; the file appears whole or not at all.

    An older file of that name is replaced; folders are not made.  Raises InputError for a place that cannot
    be written and for values that are not finite, which no reader would take back.
    """
    path = os.fspath(path)
    check_target(path)
    write = format_of(path, WRITTEN).write
    assert write is not None
    check_finite(path, measurement.signals, lambda row: f"sample {row + 1}")
    try:
        with whole_file(path) as draft:
            write(measurement.signals, os.fspath(draft))
    except OSError as error:
        raise refusal(path, f"cannot be written ({reason(error)}); check the disk and the permissions") from None


def check_target(path: str | os.PathLike[str]) -> None:
    """Raises InputError unless a measurement can be written there; to be asked before a long run."""
    path = os.fspath(path)
    if os.path.isdir(path):
        raise refusal(path, "is a folder; the name of a file is expected")
    format_of(path, WRITTEN)
    target = os.path.realpath(path)
    folder = os.path.dirname(target)
    if not os.path.isdir(folder):
        raise refusal(path, f"there is no folder {shown(os.path.dirname(path) or folder, 200)!r}; make it first")
    if os.path.exists(target) and not os.path.isfile(target):
        raise refusal(path, "is not a regular file; take another name")
    if not os.access(folder, os.W_OK):
        raise refusal(path, "no permission to write into its folder; take another folder")
