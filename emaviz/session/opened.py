"""A recording that is chosen for Compare: its table, its mapping, and what was measured."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError, quoted
from ema_model.files.limits import PAGE_BYTES
from ema_model.files.refusal import shown
from ema_model.recordings import ColumnMapping, Measurement, hints_of, prepared, read_columns, read_head, read_side_file
from ema_model.recordings.formats.text_layout import Head, Hints
from ema_model.recordings.health.card import Health, health_of
from ema_model.recordings.read import how_to_read, recorded
from ema_model.recordings.side_file.read import SideFile, find_side_file
from emaviz.session.data_folder import DataFolder
from emaviz.session.inputs import digest, version_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Opened:
    """A chosen file: as a table until its columns are mapped, then also as a measurement."""

    name: str  # relative to the data folder
    path: Path
    columns: dict[str, Array]  # as they stand in the file; none where its layout is not clear
    mapping: ColumnMapping  # in use, or guessed
    head: Head | None = None  # of a text
    hints: Hints = field(default_factory=Hints)  # what was said of its layout
    recorded: Measurement | None = None  # as files name the signals, for any actuator
    measurement: Measurement | None = None  # as the chosen actuator's model needs it
    health: Health | None = None
    problem: str = ""  # why there are no columns
    version: str = ""  # of the file, when it was read

    def version_on(self, disk: str) -> str:
        """What was read, and how, if the file is of that version."""
        return f"{disk or self.version} {digest((self.mapping, self.hints))}"


def all_measured(opened: Iterable[Opened]) -> list[Measurement]:
    """What was measured in each; InputError for one whose columns are not known yet, and where there is none."""
    found: list[Measurement] = []
    for one in opened:
        if one.measurement is None:
            todo = "columns are not mapped yet; check them and press Use"
            if one.problem:
                todo = "table was not found; say under Columns… where it begins, or remove the file"
            raise InputError(f"{quoted(one.name)}: its {todo}")
        found.append(one.measurement)
    if not found:
        raise InputError("no measurement is chosen; upload one, or choose one of the data folder")
    return found


def side_file_of(path: Path, folder: DataFolder) -> SideFile | None:
    """The side file of a recording, or of its folder; InputError where it leads out of the data folder."""
    beside, found = folder.beside(path), find_side_file(path)
    if found is None:
        return None
    if found != beside and not folder.holds(found):
        raise InputError(f"{found.name} leads out of the data folder; replace the link by the file")
    return read_side_file(found)


def side_with(opened: Opened, folder: DataFolder, **said: Any) -> SideFile:
    """The recording's side file with what somebody has said now, which is kept beside the recording itself."""
    known = side_file_of(opened.path, folder) or SideFile()
    return replace(known, **said, path=str(folder.beside(opened.path)))


def read_opened(name: str, path: Path, actuator: Actuator, side: SideFile) -> Opened:
    """A file as its side file says it is to be read; a table only, where somebody must say which columns are which.

    InputError for what is no table; but of a text there are the first lines, for somebody to find the table by.
    """
    hints, version = hints_of(str(path), side), version_of(path)
    try:
        head = read_head(path, max_bytes=PAGE_BYTES, hints=hints)
    except InputError:  # which reading the columns tells, where it is what was said
        head = read_head(path, max_bytes=PAGE_BYTES)
    try:
        columns = read_columns(path, max_bytes=PAGE_BYTES, hints=hints)
    except InputError as error:
        if head is None:
            raise
        problem = str(error).removeprefix(f"{shown(path, 300)}: ")
        return Opened(name, path, {}, ColumnMapping(), head, hints, problem=problem, version=version)
    reading = how_to_read(path, actuator, side=side, columns=columns)
    table = Opened(name, path, columns, reading.proposed(columns), head, hints, version=version)
    return table if reading.is_guess else measured(table, actuator, side)


def guesses(opened: Opened, actuator: Actuator) -> bool:
    """Whether there are columns of which this actuator's file does not say what they are."""
    return how_to_read(opened.path, actuator, side=SideFile(text=opened.hints), columns=opened.columns).is_guess


def measured(opened: Opened, actuator: Actuator, side: SideFile | None = None) -> Opened:
    """The same with what was measured and its health; `side` is the recording's side file, where it has one."""
    version = version_of(opened.path)
    found = recorded(opened.path, actuator, side=side or SideFile(), max_bytes=PAGE_BYTES)
    measurement = prepared(found, actuator)
    return replace(
        opened, recorded=found, measurement=measurement, health=health_of(measurement, actuator), version=version
    )
