"""The flights of a unit: their files in order of time, and k of each."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError, quoted
from ema_model.identification.run import Progress, identify
from ema_model.identification.search import Objective
from ema_model.recordings import Measurement, check_one_actuator
from ema_model.recordings.formats import FORMATS
from ema_model.recordings.recording_set import long_enough, recordings_in
from ema_model.tracking.evidence import LEAST_FLIGHTS

# --- one flight as the tracking sees it: k as its recording tells it, and how sure that is, in two parts --------------

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Flight:
    """k̂ = k + common · u + e, the eccentricity as a vector in the places of k6 and k7 (see `estimation.problem`).

    u are the unit's base parameters in σ of their tolerances: the same numbers in all its flights, so that they move
    no trend.  e is the flight's own: its sensors' noise, its start, the model's own error on its command.
    """

    name: str
    k: Array  # (8,), unbounded: noise may take it beyond 0 and 1
    own: Array  # (8, 8), covariance of e
    common: Array  # (8, base parameters)
    excluded: str = ""  # why it says nothing of k; empty where it does


# --- the flights of a unit in order of time, as their files' names tell it: by the numbers in them, date or count -----

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


# --- recordings of flights → k of each, with what its identification leaves open --------------------------------------

UNFIT = "the model does not fit this flight, whatever k"
UNTOLD = "this flight hardly tells k"
_UNTOLD_OF = 4  # of the k, from which on a flight is of no use


def identified(
    recording: Measurement,
    name: str,
    actuator: Actuator,
    seed: int = 0,
    on_iteration: Callable[[Progress], None] | None = None,
) -> Flight:
    """One flight by the robust identification; excluded where the model does not fit it or it tells too little."""
    sure = identify(Objective([recording], actuator), seed=seed, on_iteration=on_iteration).uncertainty
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
    left_out: Callable[[str], None] = lambda line: None,
) -> Iterator[Flight]:
    """One after another; of several, one that is too short is left out.  Raises InputError for what cannot be read."""

    def read_next(numbered: tuple[int, Path]) -> Measurement:
        number, path = numbered
        on_flight(number, path.name)
        return read(path)

    for (_, path), recording in long_enough(enumerate(paths), read_next, left_out):
        yield identified(recording, path.stem, actuator, seed)
