"""The actuators that one may choose: those that come with the package, and those of the data folder."""

from __future__ import annotations

from pathlib import Path

from ema_model.actuator import Actuator, load_actuator
from ema_model.files.shipped import shipped_folder
from emaviz.session.data_folder import DataFolder

UPLOADED = "uploaded: "  # before the names of those of the data folder


def shipped_actuators() -> dict[str, Path]:
    """The actuator files that come with the package, by the names in them."""
    return {load_actuator(path).name: path for path in sorted(shipped_folder("actuators").glob("*.toml"))}


def names(folder: DataFolder) -> list[str]:
    """All of them."""
    return [*shipped_actuators(), *(UPLOADED + name for name in folder.actuator_files())]


def named(name: str, folder: DataFolder) -> Actuator:
    """One of `names`; InputError for another, or a file that is no actuator."""
    path = shipped_actuators().get(name)
    return load_actuator(folder.actuator(name.removeprefix(UPLOADED)) if path is None else path)
