"""The session's part of the landscape: the cost over two k around an answer, on the compute thread."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.identification.landscape import Landscape, Way, extent, slices, ways
from ema_model.identification.words import landscape_words
from emaviz.session.identify.race import Race
from emaviz.session.job import Job, Run
from emaviz.session.signal import Signal
from emaviz.session.worker import Steps, Worker

Array = NDArray[np.floating]


class Landscapes:
    """Its job; what a stopped one has is kept."""

    def __init__(self, worker: Worker) -> None:
        self.job = Job(worker)
        self.grown: Signal[[Race, Landscape]] = Signal()  # called on the compute thread
        self.drawn: Signal[[Race, Mapping[str, Way]]] = Signal()  # to its end, or to where it was stopped
        self._ways: dict[Race, dict[str, Way]] = {}  # of the last race

    def draw(self, race: Race, x: int, y: int, through: Array, close: bool) -> bool:
        """Begins a slice along k x and y (0 … 7), the others held at through (8,); False while another run goes on.

        close: a few intervals wide, else all of 0 … 1.  InputError unless the two differ.
        """
        if x == y:
            raise InputError("a landscape needs two different k; choose another for one axis")
        best = race.best
        assert best is not None and best.k is not None and race.error is not None, "the race is over"
        answer, error = best.k, race.error
        interval = best.answer.uncertainty.interval90 if best.answer is not None else None
        across, upwards = (extent(through, k, interval, close) for k in (x, y))
        found: Landscape | None = None

        def work(asked: Run) -> Steps:
            nonlocal found
            asked("from where the searches ended to the answer")
            if race not in self._ways:
                self._ways = {race: ways(error, ends(race), answer)}
            for found in slices(error, through, x, y, across, upwards):
                self.grown(race, found)
                asked.say(f"{found.rows} of {len(found.upwards)} rows", found.share)
                if asked.stopping:
                    break
                yield

        def done() -> str | None:
            if found is None:
                return None
            self.drawn(race, self._ways[race])
            return landscape_words(found)

        return self.job.begin("Drawing the landscape", work, done)


def ends(race: Race) -> dict[str, Array]:
    """Where each search of a race ended, before any fit, (8,)."""
    return {name: track.last.k for name, track in race.tracks.items() if track.last is not None}
