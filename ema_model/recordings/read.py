"""Recordings of a known actuator: its file may say how its recordings' columns are named and what they are."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.files.limits import FILE_BYTES
from ema_model.recordings import ColumnMapping, Measurement, SideFile, parse_mapping, read_measurement
from ema_model.recordings.file import check_file
from ema_model.recordings.formats import format_of
from ema_model.recordings.side_file.read import find_side_file, read_side_file


def read_recording(
    path: str | os.PathLike[str], actuator: Actuator, mapping: Sequence[str] = (), *, max_bytes: int = FILE_BYTES
) -> Measurement:
    """A recording with its columns mapped: by `mapping` (texts as of `--map`), then its side file, then the actuator's.

    Columns that only the actuator's file maps may be missing.  Raises InputError as `read_measurement` does.
    """
    path = os.fspath(path)
    check_file(path, max_bytes)
    beside = find_side_file(path)
    side = read_side_file(beside) if beside else SideFile()
    kinds = {rule.kind for rule in actuator.rules_for(Path(path).stem)}
    if "map" in kinds and not side.path:
        side = replace(side, kind="map")
    if actuator.mapping and not (side.mapping and side.mapping.entries):
        side = replace(side, mapping=usual_mapping(actuator, format_of(path).header(path, max_bytes)))
    return read_measurement(path, list(mapping) or None, side=side, max_bytes=max_bytes)


def usual_mapping(actuator: Actuator, columns: Collection[str]) -> ColumnMapping:
    """The part of the actuator's mapping that these columns are in."""
    usual = parse_mapping(actuator.mapping, columns)
    return ColumnMapping(tuple(entry for entry in usual.entries if entry.column in columns))


def check_same_actuator(measurements: Sequence[Measurement]) -> None:
    """Raises InputError if maps and runs are mixed, which no one model can be held against at once."""
    if len({measurement.is_map for measurement in measurements}) > 1:
        raise InputError("static maps and runs cannot be compared together; compare them one after the other")
