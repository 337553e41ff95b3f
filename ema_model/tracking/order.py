"""The flights of a unit in order of time, as their files' names tell it: by the numbers in them, date or count."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence, Sized
from itertools import pairwise
from pathlib import Path

from ema_model.errors import InputError, quoted
from ema_model.recordings import check_one_actuator
from ema_model.recordings.formats import FORMATS
from ema_model.recordings.recording_set import recordings_in
from ema_model.tracking.evidence import LEAST_FLIGHTS

_NUMBER = re.compile(r"\d+")


def flights_in(folder: Path) -> list[Path]:
    """The recordings of a folder in order; InputError where it is none, holds none, or a name tells no time."""
    found = recordings_in(folder)
    if not found:
        raise InputError(f"{quoted(folder)}: holds no recording ({', '.join(FORMATS)})")
    for inner in (path for path in sorted(folder.iterdir()) if path.is_dir()):
        if recordings_in(inner):
            told = f"{quoted(folder)}: there are recordings beside it in its folder {quoted(inner.name)}"
            raise InputError(f"{told}; a folder holds the flights of one unit, so move them or name the files")
    return in_order(found)


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Flights in order of time; InputError for a name that tells none."""
    return sorted(paths, key=_when)


def check_order(paths: Sequence[Path]) -> None:
    """InputError for flights out of order, at the same time, or of several actuators, by what their files say."""
    for before, after in pairwise(paths):
        if _when(before) == _when(after):
            raise InputError(
                f"{quoted(before.name)} and {quoted(after.name)}: have the same number or date in their names, so that "
                "nothing tells which flew first; rename them"
            )
        if _when(before) > _when(after):
            raise InputError(
                f"{quoted(after.name)}: comes after {quoted(before.name)}, though its name says that it flew before; "
                "give the flights in order of time"
            )
    check_one_actuator(paths, "the flights are of one unit")


def check_enough(flights: Sized, where: str) -> None:
    """InputError for fewer flights than a trend needs; where: what was named."""
    if len(flights) < LEAST_FLIGHTS:
        told = "1 flight tells" if len(flights) == 1 else f"{len(flights)} flights tell"
        raise InputError(f"{quoted(where)}: {told} no trend; give {LEAST_FLIGHTS} or more, or use `emaviz identify`")


def _when(path: Path) -> tuple[int, ...]:
    numbers = tuple(int(one) for one in _NUMBER.findall(path.stem))
    if not numbers:
        raise InputError(f"{quoted(path.name)}: its name has no number or date that tells when it flew; rename it")
    return numbers
