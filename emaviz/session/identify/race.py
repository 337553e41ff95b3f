"""A race of optimisers: the same recording, one iteration of each in turn, told and recorded as it goes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.faults import performance_coefficient
from ema_model.identification.fit import CorrectedError
from ema_model.identification.objective import Objective
from ema_model.identification.run import SEARCH_SHARE, Identification, Progress, by_one_error, steps
from ema_model.quantities.numbers import amount
from ema_model.recordings import Measurement
from ema_model.simulation import plant
from emaviz.session.job import Run
from emaviz.session.settings import SLIDERS, Settings
from emaviz.session.worker import Steps

Array = NDArray[np.float64]
OpenFile = Callable[[str], Measurement]  # by the name of a file in the data folder

MOST_FRAMES = 200  # of a swarm, kept to look at again
_LOOK_S = 0.01  # whether a file is read; sliders are answered in between
_CURRENT_EVERY = 4  # iterations


@dataclass(frozen=True, eq=False)
class Frame:
    """A swarm at one iteration."""

    iteration: int
    population: NDArray[np.float32]  # (n, 8)
    k: Array  # (8,), the best so far
    rmse: float  # A, of the best


@dataclass(eq=False)
class Track:
    """One optimiser of a race.  Written on the compute thread, read on any."""

    algorithm: str
    iterations: int
    rmse: list[float] = field(default_factory=list)  # A, uncorrected, of the best after each iteration
    last: Progress | None = None
    frames: list[Frame] = field(default_factory=list)  # every `stride` iterations
    stride: int = 1
    current_A: Array | None = None  # (blocks,), of the best
    answer: Identification | None = None
    fitting: tuple[str, float] | None = None  # after the last iteration: what goes on, and its share done

    @property
    def share(self) -> float:
        """Of its work that is done, 0 … 1."""
        if self.answer is not None:
            return 1.0
        if self.fitting is not None:
            return SEARCH_SHARE + (1.0 - SEARCH_SHARE) * min(self.fitting[1], 0.99)
        return SEARCH_SHARE * len(self.rmse) / (self.iterations + 1.0)

    @property
    def corrected(self) -> list[float]:
        """A, of the best after each iteration, and of the answer where a fit went on from there; once it is there."""
        answer = self.answer
        if answer is None:
            return []
        return [*map(float, answer.corrected_history), *([answer.corrected_rmse] if answer.polished else [])]

    @property
    def k(self) -> Array | None:
        """(8,), the best so far, or the answer."""
        if self.answer is not None:
            return self.answer.k
        return None if self.last is None else self.last.k

    def add(self, at: Progress) -> None:
        """An iteration; of long searches every second frame is given up again."""
        self.rmse.append(at.rmse)
        self.last = at
        if at.iteration % self.stride == 0:
            if len(self.frames) >= MOST_FRAMES:
                self.frames, self.stride = self.frames[::2], 2 * self.stride
            if at.iteration % self.stride == 0:
                self.frames.append(Frame(at.iteration, at.population.astype(np.float32), at.k, at.rmse))


@dataclass(eq=False)
class Race:
    """What is identified, by whom, and how far they are."""

    settings: Settings
    tracks: dict[str, Track]
    time_s: Array  # (blocks,), of the current that is fitted
    measured_A: Array  # (blocks,)
    truth: Array | None  # (8,), of the sliders' plant
    measurement: Measurement  # what is identified
    objective: Objective  # and its cost
    known: bool = False  # the actuator's own parameters are exact, as in a simulation of the same file
    growing: Path | None = None  # of the recording, while it is written
    path: Path | None = None  # and once it is whole
    error: CorrectedError | None = None  # by which all answers are compared, once all are there

    @property
    def source(self) -> str:
        """What is identified, as a person reads it."""
        return self.settings.source or "the sliders' plant"

    @property
    def share(self) -> float:
        """Of the work that is done, 0 … 1."""
        return sum(track.share for track in self.tracks.values()) / len(self.tracks)

    @property
    def said(self) -> str:
        """What goes on."""
        going = [track for track in self.tracks.values() if track.answer is None]
        if len(self.tracks) == 1 and going and going[0].fitting is None and going[0].rmse:
            at = f"iteration {len(going[0].rmse) - 1} of {going[0].iterations}"
            return f"{at}, uncorrected error {amount(going[0].rmse[-1], 'A')}"
        fitting = next((track.fitting[0] for track in going if track.fitting is not None), "fitting the answer")
        return "searching" if any(track.fitting is None for track in going) else fitting

    @property
    def answers(self) -> list[Identification]:
        """Of the optimisers that have ended."""
        return [track.answer for track in self.tracks.values() if track.answer is not None]

    @property
    def ran_whole(self) -> bool:
        """Whether nobody stopped it."""
        return not any(answer.stopped for answer in self.answers)

    @property
    def best(self) -> Track | None:
        """The one to believe, of the least error that is shown: corrected once all are there, uncorrected before."""
        begun = [track for track in self.tracks.values() if track.rmse]
        return min(begun, key=lambda track: self.errors_of(track)[-1], default=None)

    def errors_of(self, track: Track) -> list[float]:
        """A, as they are shown: corrected by one fit for all once all are there, uncorrected of the search before."""
        return list(track.rmse) if self.error is None else track.corrected

    def performance(self) -> dict[str, float]:
        """Performance coefficient, % (T 5.4), by algorithm; empty unless several have ended and the truth is known."""
        errors = [(answer.algorithm, answer.error_percent, answer.elapsed_s) for answer in self.answers]
        known = [(name, error, elapsed) for name, error, elapsed in errors if error is not None]
        if len(known) < 2 or not sum(error * elapsed for _, error, elapsed in known):
            return {}
        coefficients = performance_coefficient([one[1] for one in known], [one[2] for one in known])
        return {name: float(value) for (name, _, _), value in zip(known, coefficients)}


def target(
    settings: Settings, actuator: Actuator, open_file: OpenFile
) -> Generator[None, None, tuple[Measurement, Array | None]]:
    """Steps that end with the recording to identify, and the true k if it is the sliders' plant."""
    if settings.source != SLIDERS:
        return (yield from _elsewhere(lambda: open_file(settings.source))), None
    run = plant.to_identify(settings.run(), actuator, settings.k, settings.fitness, settings.effects)
    return settings.sensors.record(run, settings.seed), settings.k


def _elsewhere(read: Callable[[], Measurement]) -> Generator[None, None, Measurement]:
    """Reads on a thread of its own: a large file takes seconds, in which the sliders shall answer."""
    found: list[Measurement] = []
    failed: list[Exception] = []

    def work() -> None:
        try:
            found.append(read())
        except Exception as error:
            failed.append(error)

    thread = threading.Thread(target=work, name="emaviz-read", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_LOOK_S)
        yield
    if failed:
        raise failed[0]
    return found[0]


def begin(settings: Settings, objective: Objective, truth: Array | None, known: bool | None = None) -> Race:
    """A race that has not started; known: see `Race`, by default where the truth is."""
    window = objective.windows[0]
    time = objective.measurements[0].time_s[0] + window.block_s * (1.0 + np.arange(window.blocks))
    tracks = {name: Track(name, settings.iterations) for name in settings.algorithms}
    measured_A = objective.target[: window.blocks]
    return Race(
        settings,
        tracks,
        time,
        measured_A,
        truth,
        objective.recorded[0],
        objective,
        known=truth is not None if known is None else known,
    )


def run(race: Race, asked: Run, tell: Callable[[Progress | None], object]) -> Steps:
    """All optimisers to their ends, an iteration of each in turn; once asked to end, each keeps the best it has.

    tell(progress): after each iteration; progress is None while the answer is fitted, and after its end.
    """
    objective = race.objective
    settings = race.settings

    def fitting(track: Track) -> Callable[[str, float], None]:
        def told(text: str, share: float) -> None:
            track.fitting = text, max(share, track.fitting[1] if track.fitting else 0.0)
            tell(None)

        return told

    searches = {
        name: steps(
            objective,
            name,
            population=settings.population,
            iterations=settings.iterations,
            seed=settings.seed,
            truth=race.truth,
            parameters_known=race.known,
            on_fit=fitting(race.tracks[name]),
        )
        for name in race.tracks
    }
    begun = False
    while searches:
        for name, search in list(searches.items()):
            track = race.tracks[name]
            try:
                at = search.send(asked.stopping) if begun else next(search)
            except StopIteration as finished:
                track.answer = finished.value
                track.current_A = objective.currents(finished.value.k)[0, : len(race.time_s)]
                del searches[name]
                tell(None)
            else:
                track.add(at)
                track.iterations = at.iterations
                if at.iteration % _CURRENT_EVERY == 0:
                    track.current_A = objective.currents(at.k)[0, : len(race.time_s)]
                tell(at)
            yield
        begun = True
    compared = by_one_error(race.answers)
    for track, answer in zip((track for track in race.tracks.values() if track.answer is not None), compared):
        track.answer = answer
    race.error = compared[0].corrected_error
    tell(None)
