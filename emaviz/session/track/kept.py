"""What a session's file holds of Track: thresholds and identified flights, so that none is identified again."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from ema_model import faults
from ema_model.errors import InputError
from ema_model.tracking.flight import Flight
from ema_model.tracking.track import check_thresholds
from emaviz.session.described import taken

MOST = 2000  # flights, two kilobytes each; a unit with more is identified anew
_PART = "part of Track"
_K = len(faults.NAMES)


class SavedFlight(msgspec.Struct, frozen=True):
    """A flight, and the file that it was identified from, as it was then."""

    name: str
    numbers: str  # k, own and common, one after another, as base 64 of doubles
    excluded: str = ""
    file: str = ""  # its name in the folder
    changed: tuple[int, int] = (0, 0)  # its size and the time of its last change

    def is_of(self, path: Path) -> bool:
        """Whether a file is still the one."""
        try:
            return self.changed == as_it_is(path)
        except OSError:
            return False

    @property
    def flight(self) -> Flight:
        """InputError for numbers that are no flight's."""
        try:
            numbers = np.frombuffer(base64.b64decode(self.numbers, validate=True))
            k, own, common = np.split(numbers, [_K, _K + _K * _K])
            own, common = own.reshape(_K, _K), common.reshape(_K, -1)
            good = len(k) == _K and bool(np.all(np.isfinite(numbers)))
            good = good and np.allclose(own, own.T) and bool(np.all(np.linalg.eigvalsh(own) >= 0.0))
        except (binascii.Error, ValueError):
            good = False
        if not good:
            raise InputError(f"the session's {_PART} is damaged (a flight's numbers make no sense); save it anew")
        return Flight(self.name, k, own, common, self.excluded)


class SavedTrack(msgspec.Struct, frozen=True):
    """What is chosen, and the flights in order of time."""

    folder: str
    thresholds: dict[str, float]
    actuator: str = ""  # as a file, by which they were identified
    flights: tuple[SavedFlight, ...] = ()

    def __post_init__(self) -> None:
        check_thresholds(self.thresholds)


def as_it_is(path: Path) -> tuple[int, int]:
    """By which a file is known again; OSError where it is not there."""
    now = path.stat()
    return now.st_size, now.st_mtime_ns


def saved(
    folder: str, thresholds: Mapping[str, float], actuator: str, flights: Sequence[Flight], files: Mapping[Path, Flight]
) -> dict[str, Any]:
    """In what JSON can hold; files: what each flight was identified from."""
    by_flight = {id(one): path for path, one in files.items()}
    kept = tuple(_saved(one, by_flight.get(id(one))) for one in flights) if len(flights) <= MOST else ()
    return msgspec.to_builtins(SavedTrack(folder, dict(thresholds), actuator, kept))


def read(given: Any) -> SavedTrack:
    """What `saved` gave; InputError for what makes no sense."""
    return taken(SavedTrack, given, _PART)


def _saved(one: Flight, path: Path | None) -> SavedFlight:
    numbers = np.concatenate([one.k, one.own.ravel(), one.common.ravel()]).astype("<f8")
    told = SavedFlight(one.name, base64.b64encode(numbers.tobytes()).decode(), one.excluded)
    try:
        return told if path is None else msgspec.structs.replace(told, file=path.name, changed=as_it_is(path))
    except OSError:  # it is gone since
        return told
