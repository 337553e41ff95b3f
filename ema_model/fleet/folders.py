"""Units as folders of recordings: which recording is of which unit, and whether all are of one type."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from ema_model.errors import InputError, quoted
from ema_model.recordings import check_one_actuator
from ema_model.recordings.recording_set import recordings_in


def units_in(folder: Path) -> dict[str, list[Path]]:
    """The recordings of each folder in a folder, by its name; InputError where there are not two with any."""
    inner = sorted(one for one in folder.iterdir() if one.is_dir() and not one.name.startswith("."))
    found = {one.name: recordings_in(one) for one in inner}
    found = {name: files for name, files in found.items() if files}
    if not found:
        raise InputError(f"{quoted(folder.name)}: holds no folders of recordings, of which each would be a unit")
    return found


def check_same_type(files: Iterable[str | os.PathLike[str]]) -> None:
    """InputError for recordings whose side files name different actuators: units are of one type."""
    check_one_actuator(files, "units that are compared are of one type")
