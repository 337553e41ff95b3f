"""A recording that is chosen for Compare: its table, its mapping, and what was measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.files.limits import PAGE_BYTES
from ema_model.recordings import ColumnMapping, Measurement, prepared, read_side_file
from ema_model.recordings.health.card import Health, health_of
from ema_model.recordings.read import recorded
from ema_model.recordings.side_file.read import SideFile, find_side_file
from emaviz.session.data_folder import DataFolder

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Opened:
    """A chosen file: as a table until its columns are mapped, then also as a measurement."""

    name: str  # relative to the data folder
    path: Path
    columns: dict[str, Array]  # as they stand in the file
    mapping: ColumnMapping  # in use, or guessed
    recorded: Measurement | None = None  # as files name the signals, for any actuator
    measurement: Measurement | None = None  # as the chosen actuator's model needs it
    health: Health | None = None


def side_file_of(path: Path, folder: DataFolder) -> SideFile | None:
    """The side file of a recording, or of its folder; InputError where it leads out of the data folder."""
    beside, found = folder.beside(path), find_side_file(path)
    if found is None:
        return None
    if found != beside and not folder.holds(found):
        raise InputError(f"{found.name} leads out of the data folder; replace the link by the file")
    return read_side_file(found)


def measured(opened: Opened, actuator: Actuator, side: SideFile | None = None) -> Opened:
    """The same with what was measured and its health; `side` is the recording's side file, where it has one."""
    found = recorded(opened.path, actuator, side=side or SideFile(), max_bytes=PAGE_BYTES)
    measurement = prepared(found, actuator)
    return replace(opened, recorded=found, measurement=measurement, health=health_of(measurement, actuator))
