"""Recordings of flights → k of each, with what its identification leaves open."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ema_model.actuator import Actuator
from ema_model.errors import InputError, quoted
from ema_model.identification.objective import Objective
from ema_model.identification.run import identify
from ema_model.recordings import Measurement
from ema_model.recordings.formats import FORMATS
from ema_model.tracking.flight import Flight

UNFIT = "the model does not fit this flight, whatever k"
UNTOLD = "this flight hardly tells k"
_UNTOLD_OF = 4  # of the k, from which on a flight is of no use


def flights_in(folder: Path) -> list[Path]:
    """The recordings of a folder in the order of their names; InputError where it is none or holds none."""
    if not folder.is_dir():
        raise InputError(f"{quoted(folder)}: is no folder; name the folder of one unit's flights")
    found = sorted(path for path in folder.iterdir() if path.is_file() and path.suffix.lower() in FORMATS)
    if not found:
        raise InputError(f"{quoted(folder)}: holds no recording ({', '.join(FORMATS)})")
    inner = next((path for path in sorted(folder.iterdir()) if path.is_dir()), None)
    if inner is not None and any(path.suffix.lower() in FORMATS for path in inner.iterdir() if path.is_file()):
        raise InputError(
            f"{quoted(folder)}: has recordings in {quoted(inner.name)} too; a folder holds one unit's flights"
        )
    return found


def identified(recording: Measurement, name: str, actuator: Actuator, seed: int = 0) -> Flight:
    """One flight by the robust identification; excluded where the model does not fit it or it tells too little."""
    sure = identify(Objective([recording], actuator), seed=seed).uncertainty
    excluded = ""
    if not sure.adequate:
        excluded = UNFIT
    elif len(sure.hardly_known) >= _UNTOLD_OF:
        excluded = UNTOLD
    return Flight(name, sure.unbounded, sure.own, sure.common, excluded)


def identify_all(
    paths: Sequence[Path],
    read: Callable[[Path], Measurement],
    actuator: Actuator,
    seed: int = 0,
    on_flight: Callable[[int, str], None] = lambda number, name: None,
) -> Iterator[Flight]:
    """One after another; a recording that cannot be read raises InputError."""
    for number, path in enumerate(paths):
        on_flight(number, path.name)
        yield identified(read(path), path.stem, actuator, seed)
