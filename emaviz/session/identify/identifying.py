"""The session's part of Identify: a race of searches against one recording, kept as a recording of its own."""

from __future__ import annotations

import copy
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ema_model.actuator import Actuator
from ema_model.faults import NAMES
from ema_model.identification.objective import Objective
from ema_model.identification.run import Identification, Progress
from ema_model.identification.words import in_one_line
from ema_model.recordings import Measurement
from emaviz.session.described import title
from emaviz.session.identify.race import OpenFile, Race, begin, run, target
from emaviz.session.inputs import Inputs, Provenance
from emaviz.session.job import Job, Run
from emaviz.session.settings import SLIDERS, Settings
from emaviz.session.signal import Signal
from emaviz.session.worker import Steps, Worker

_SEARCH = ("population", "iterations", "fitness", "seed")
_PLANT = (  # settings of the sliders' plant beside its k and its command
    *("duration_s", "load_torque_Nm", "load_shape", "load_time_s", "load_frequency_Hz", "current_noise_A"),
    *("encoder_bits", "start_offset_rad", "start_speed_rad_s", "start_side", "effects"),
)

if TYPE_CHECKING:  # rerun may be missing or broken, and takes a second to import
    from emaviz.recording.story import IdentificationStory


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
        self.provenance = Provenance("the answer", "Identify", inputs, self.job)
        self.answer: Identification | None = None
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
        self.identified(race)

    def _story(self, race: Race, measurement: Measurement) -> IdentificationStory | None:
        settings = race.settings
        stem = f"{datetime.now():%Y%m%d-%H%M%S}-{'-'.join(settings.algorithms)}"
        source = "reference" if race.truth is not None else "measurement"
        try:
            from emaviz.recording.paths import free_name
            from emaviz.recording.story import IdentificationStory

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
