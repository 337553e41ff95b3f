"""Recordings of flights → k of each, with what its identification leaves open."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from ema_model.actuator import Actuator
from ema_model.identification.objective import Objective
from ema_model.identification.run import Progress, identify
from ema_model.recordings import Measurement
from ema_model.recordings.recording_set import long_enough
from ema_model.tracking.flight import Flight

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
