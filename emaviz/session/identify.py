"""Identification without a screen: searches, their race, the landscape."""

from __future__ import annotations

import copy
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field, fields
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.faults import NAMES, performance_coefficient
from ema_model.identification.fit import CorrectedError
from ema_model.identification.run import (
    ALGORITHMS,
    SEARCH_SHARE,
    Identification,
    Progress,
    by_one_error,
    in_one_line,
    landscape_words,
    steps,
)
from ema_model.identification.search import Landscape, Objective, Way, extent, slices, ways
from ema_model.quantities import amount
from ema_model.recordings import Measurement
from ema_model.result import restored, stored
from ema_model.simulation import plant
from emaviz.session.jobs import Job, Run, Signal, Steps, Worker, elsewhere
from emaviz.session.session_file import Inputs, Provenance, Whole
from emaviz.session.settings import SLIDERS, Settings, title

if TYPE_CHECKING:
    from emaviz.recording.identification import IdentificationStory

# --- a race of optimisers: the same recording, one iteration of each in turn, told and recorded as it goes ------------

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
    landscape: Landscape | None = None  # as it was drawn last
    ways: dict[str, Way] = field(default_factory=dict)  # from where the searches ended

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


@dataclass(frozen=True, eq=False)
class StoredRace:
    """A race that is over, as a session's file has it beside its settings."""

    tracks: dict[str, Track]
    time_s: Array
    measured_A: Array
    truth: Array | None
    measurement: Measurement
    objective: Objective
    known: bool
    error: CorrectedError | None
    landscape: Landscape | None
    ways: dict[str, Way]
    recording: str  # its file's name, "" without one
    at: str

    @classmethod
    def of(cls, given: Any) -> StoredRace:
        """What was stored; InputError for what is damaged, or of another version."""
        return restored(given, cls, StoredRace._check)

    def _check(self) -> None:
        """Whatever is raised says that parts do not fit each other."""
        tracks = self.tracks.values()
        ended = [one.answer is not None and one.last is not None and bool(one.rmse) for one in tracks]
        lengths = {len(one.current_A) for one in tracks if one.current_A is not None}
        fits = ended and all(ended) and {*self.tracks} <= {*ALGORITHMS}
        fits = fits and {len(one.k) for one in tracks if one.k is not None} == {len(NAMES)}
        if not (fits and lengths <= {len(self.time_s)} == {len(self.measured_A)}):
            raise ValueError("parts that do not fit each other")
        for one in tracks:
            _ = one.answer and (one.answer.to_dict(), str(one.answer.document))
        datetime.fromisoformat(self.at)


def target(
    settings: Settings, actuator: Actuator, open_file: OpenFile
) -> Generator[None, None, tuple[Measurement, Array | None]]:
    """Steps that end with the recording to identify, and the true k if it is the sliders' plant."""
    if settings.source != SLIDERS:
        # A large file takes seconds, in which the sliders shall answer.
        return (yield from elsewhere(lambda: open_file(settings.source), "emaviz-read", _LOOK_S)), None
    run = plant.to_identify(settings.run(), actuator, settings.k, settings.fitness, settings.effects)
    return settings.sensors.record(run, settings.seed), settings.k


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


# --- the session's part of the landscape: the cost over two k around an answer, on the compute thread -----------------

Floats = NDArray[np.floating]


class Landscapes:
    """Its job; what a stopped one has is kept."""

    def __init__(self, worker: Worker) -> None:
        self.job = Job(worker)
        self.grown: Signal[[Race, Landscape]] = Signal()  # called on the compute thread
        self.drawn: Signal[[Race, Mapping[str, Way]]] = Signal()  # to its end, or to where it was stopped

    def draw(self, race: Race, x: int, y: int, through: Floats, close: bool) -> bool:
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
            race.ways = race.ways or ways(error, ends(race), answer)
            for found in slices(error, through, x, y, across, upwards):
                self.grown(race, found)
                asked.say(f"{found.rows} of {len(found.upwards)} rows", found.share)
                if asked.stopping:
                    break
                yield

        def done() -> str | None:
            if found is None:
                return None
            race.landscape = found
            self.drawn(race, race.ways)
            return landscape_words(found)

        return self.job.begin("Drawing the landscape", work, done)


def ends(race: Race) -> dict[str, Floats]:
    """Where each search of a race ended, before any fit, (8,)."""
    return {name: track.last.k for name, track in race.tracks.items() if track.last is not None}


# --- the session's part of Identify: a race of searches against one recording, kept as a recording of its own ---------

_SEARCH = ("population", "iterations", "fitness", "seed")
_PLANT = (  # settings of the sliders' plant beside its k and its command
    *("duration_s", "load_torque_Nm", "load_shape", "load_time_s", "load_frequency_Hz", "current_noise_A"),
    *("encoder_bits", "start_offset_rad", "start_speed_rad_s", "start_side", "effects"),
)


class Identifying:
    """Its job, and the last answer.  Signals are called on the compute thread, so listeners only hand over."""

    def __init__(
        self, worker: Worker, monitor: Actuator, folder: Path, told: Signal[[str, str]], inputs: Callable[[], Inputs]
    ) -> None:
        """monitor: whose k are looked for; folder: of recordings; told: a title and a line of what has failed.

        inputs(): what an identification would take now.
        """
        self.job = Job(worker)
        self.progressed: Signal[[Race]] = Signal()
        self.identified: Signal[[Race]] = Signal()
        self.brought: Signal[[Race]] = Signal()  # by a session
        self.landscapes = Landscapes(worker)
        self.provenance = Provenance("the answer", "Identify", inputs, self.job)
        self.provenance.whole = Whole(self._stored, self._show)
        self.answer: Identification | None = None
        self.race: Race | None = None  # of which it is
        self.answered_at: datetime | None = None
        self._monitor, self._folder, self._told = monitor, folder, told

    def begin(self, settings: Settings, plant: Actuator, open_file: OpenFile, known: bool) -> bool:
        """Begins as the settings say; False while another long run goes on.

        plant: what the sliders make; known: its own parameters are the monitor's.
        A stop ends it after its present iteration, keeping the best so far.
        """
        settings, race = copy.deepcopy(settings), None

        def work(asked: Run) -> Steps:
            nonlocal race
            measurement, truth = yield from target(settings, plant, open_file)
            asked("searching")
            objective = Objective([measurement], self._monitor, fitness=settings.fitness)
            race = begin(settings, objective, truth, known=truth is not None and known)
            yield from self._race(race, measurement, asked)

        def done() -> str | None:
            if race is None or race.best is None or race.best.answer is None:
                return None
            said = in_one_line(race.best.answer)
            return said if race.ran_whole else f"Stopped; the best so far is kept. {said}"

        return self.provenance.begin(lambda: self.job.begin("Identifying", work, done))

    def _race(self, race: Race, measurement: Measurement, asked: Run) -> Steps:
        story = self._story(race, measurement)
        race.growing = None if story is None else story.path

        def tell(progress: Progress | None) -> None:
            if story is not None and progress is not None:
                story.iteration(progress)
            self.progressed(race)
            asked.say(race.said, race.share)

        try:
            yield from run(race, asked, tell)
            self._keep(race, story)
        finally:
            if story is not None:
                story.close()

    def _keep(self, race: Race, story: IdentificationStory | None) -> None:
        best = race.best
        assert best is not None and best.answer is not None, "the race is over"
        self.answer, self.answered_at = best.answer, datetime.now()
        self.provenance.take()
        if story is not None:
            others = [answer for answer in race.answers if answer is not best.answer]
            story.finish(best.answer, *others)
            race.path = None if story.failed else story.path
            if story.failed:
                self._told("The recording could not be written", story.failed)
        self.race = race
        self.identified(race)

    def keep(self, suffix: str) -> Path:
        """The last answer's recording (.rrd), or its report (.html), which is written; on the compute thread.

        InputError before there is an answer, and where its recording could not be written.
        """
        race = self.race
        if race is None or race.best is None or race.best.answer is None:
            raise InputError("nothing is identified yet; press Identify first")
        if suffix == ".rrd":
            if race.path is None:
                raise InputError("the recording of this identification could not be written, or is not here any more")
            return race.path
        from emaviz.recording.entry import free_name
        from emaviz.views.report import export  # plotly takes a second to import

        path = free_name(self._folder, f"{datetime.now():%Y%m%d-%H%M%S}-identify", ".html")
        export(race.best.answer, path, readable(race.settings))
        return path

    # --- a session ------------------------------------------------------------------------------------------------

    def _stored(self) -> Any:
        """The last race; None without one."""
        race = self.race
        if race is None or self.answered_at is None:
            return None
        own = {one.name: getattr(race, one.name) for one in fields(StoredRace) if hasattr(race, one.name)}
        recording = "" if race.path is None else race.path.name
        whole = StoredRace(**own, recording=recording, at=self.answered_at.isoformat())
        return {"settings": race.settings.saved(), "race": stored(whole)}

    def _show(self, given: Any) -> None:
        """A session's; nothing is computed.  InputError, and nothing is shown, for what makes no sense."""
        settings = Settings(axes=self._monitor.axes)
        settings.restore(given.get("settings"))
        one = StoredRace.of(given.get("race"))
        path = self._folder / Path(one.recording).name
        own = {each.name: getattr(one, each.name) for each in fields(one) if each.name in Race.__dataclass_fields__}
        race = Race(settings, **own, path=path if one.recording and path.is_file() else None)
        assert race.best is not None, "each track has an answer"
        self.answer, self.answered_at, self.race = race.best.answer, datetime.fromisoformat(one.at), race
        self.brought(race)

    def _story(self, race: Race, measurement: Measurement) -> IdentificationStory | None:
        settings = race.settings
        stem = f"{datetime.now():%Y%m%d-%H%M%S}-{'-'.join(settings.algorithms)}"
        source = "reference" if race.truth is not None else "measurement"
        try:
            from emaviz.recording.entry import free_name
            from emaviz.recording.identification import IdentificationStory

            path = free_name(self._folder, stem, ".rrd")
            return IdentificationStory(
                path, race.objective, measurement, source, race.truth, readable(settings), settings.algorithms
            )
        except (OSError, ImportError) as error:  # a run without its recording is still a run
            self._told("The recording cannot be written", " ".join(str(error).split()))
            return None


def inputs_of(settings: Settings, plant: str, version: Callable[[str], str]) -> Inputs:
    """What an identification takes; plant: the name of the sliders' model; version(name): of a measurement."""
    options = {title(Settings, name): str(getattr(settings, name)) for name in (*_SEARCH, "algorithms")}
    if settings.source != SLIDERS:
        subject = settings.source.rpartition("/")[2]
        return Inputs(subject, settings.source, {settings.source: version(settings.source)}, options)
    made = {title(Settings, name): str(getattr(settings, name)) for name in _PLANT}
    made |= {name: str(value) for name, value in zip(NAMES, settings.k.tolist())}
    made["the command"] = f"{settings.command} {settings.command_settings[settings.command]}"
    return Inputs("the sliders' plant", SLIDERS, {}, {"the plant's model": plant, **made, **options})


def readable(settings: Settings) -> dict[str, Any]:
    """The settings of an identification by name, as a recording keeps them."""
    if settings.source:
        return {"source": settings.source, **_search(settings)}
    return {
        "source": "the sliders' plant",
        "k": " ".join(f"{value:g}" for value in settings.k),
        "command": settings.command,
        **{name: value for name, value in settings.run().command.settings().items()},
        "duration_s": settings.duration_s,
        "load_torque_Nm": settings.load_torque_Nm,
        "load_shape": settings.load_shape,
        "current_noise_A": settings.current_noise_A,
        "encoder_bits": settings.encoder_bits,
        "hidden_effects": "; ".join(
            f"{name} " + ", ".join(f"{parameter}={value:g}" for parameter, value in given.items())
            for name, given in settings.effects.items()
        )
        or "none",
        **_search(settings),
    }


def _search(settings: Settings) -> dict[str, Any]:
    return {
        "algorithms": ", ".join(settings.algorithms),
        "population": settings.population,
        "iterations": settings.iterations,
        "fitness": settings.fitness,
        "seed": settings.seed,
    }
