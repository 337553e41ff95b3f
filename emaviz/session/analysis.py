"""An analysis of the recordings that Compare has, without a screen: its options, its run, its answer, and a session's.

Any of `ema_model.analyses`: what it may be told and what it answers with is stated there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from ema_model.actuator import Actuator, load_actuator
from ema_model.analyses import Analysis
from ema_model.errors import InputError
from ema_model.quantities import in_sentence
from ema_model.recordings import write_measurement
from ema_model.recordings.measurement import Measurement
from ema_model.result import Result
from emaviz.session.compare import Comparing
from emaviz.session.files import Opened, all_measured
from emaviz.session.jobs import Job, Run, Signal, Worker, aside
from emaviz.session.session_file import Inputs, Provenance
from emaviz.session.settings import taken


class SavedAnalysis(msgspec.Struct, frozen=True):
    """What a session's file holds of it."""

    options: dict[str, str]
    result: dict[str, Any] | None = None  # its JSON form


@dataclass
class AnalysisEvents:
    """What the screen listens to, besides the job; called on the threads that work, so listeners only hand over."""

    found: Signal[[Result]] = field(default_factory=Signal)
    kept: Signal[[Path]] = field(default_factory=Signal)  # a file is written


class Analysing:
    """What is chosen, and the last answer."""

    def __init__(self, analysis: Analysis, comparing: Comparing, files: Worker) -> None:
        """files: writes what stays."""
        self.analysis, self.comparing, self._files = analysis, comparing, files
        self.events = AnalysisEvents()
        advice = "check the actuator's file and the recordings' units"
        self.job = Job(comparing.session.worker, on_divergence=advice)
        self.chosen = {name: next(iter(one.choices)) for name, one in analysis.options.items()}
        self.result: Result | None = None
        what = f"the {in_sentence(analysis.title)}"
        self.provenance = Provenance(what, analysis.title, self.inputs, self.job)

    def inputs(self) -> Inputs:
        """What a run would take now."""
        of = self.comparing.inputs()
        kept = {name: value for name, value in of.options.items() if name in ("the actuator", "the window of time")}
        own = {f"the {in_sentence(one.title)}": self.chosen[name] for name, one in self.analysis.options.items()}
        return Inputs(of.subject, files=of.files, options={**kept, **own})

    def choose(self, name: str, value: Any) -> None:
        """One option; InputError for what it may not be."""
        self.analysis.check(name, value)
        self.chosen[name] = str(value)

    def begin(self) -> bool:
        """Begins with what Compare has; False while another long run goes on.  InputError where it has nothing."""
        recordings = all_measured(list(self.comparing.opened.values()))
        if self.comparing.window_s is not None:
            recordings = [one.selected(self.comparing.window_s) for one in recordings]
        actuator, chosen, of = self.comparing.actuator, dict(self.chosen), self.inputs()
        found: Result | None = None

        def work(run: Run) -> None:
            nonlocal found
            found = self.analysis.analyse(recordings, actuator, **chosen, on_progress=run)

        def done() -> None:
            assert found is not None, "it came to its end"
            self.result = found
            self.provenance.take(of)
            self.events.found(found)

        return self.provenance.begin(lambda: self.job.begin(self.analysis.title, work, done), of)

    def begin_example(self, record: Callable[[Actuator], Measurement], name: str) -> bool:
        """Records something to try it on, opens that on Compare, and begins; False while another long run goes on.

        record(actuator): of the standard actuator; name: of the file in the data folder.
        """
        comparing, standard = self.comparing, load_actuator()
        folder, file = comparing.folder, ""
        if comparing.actuator.name != standard.name:
            comparing.choose_actuator(standard.name)

        def simulated() -> str:
            with TemporaryDirectory(prefix="emaviz-example-") as scratch:
                path = Path(scratch) / name
                write_measurement(record(standard), path)
                return folder.name_of(folder.take_in(path))

        def work(run: Run) -> None:
            nonlocal file
            file = aside(simulated, run, "simulating; the effect is compiled on its first use")

        def done() -> None:
            comparing.events.opened.connect(opened)
            comparing.add(file)

        def opened(one: Opened) -> None:
            if one.name == file:
                comparing.events.opened.disconnect(opened)
                if not self.begin():  # a comparison, say: it goes on once that has ended
                    self.job.begin_in_turn(self.analysis.title, self.begin)

        return self.job.begin("Recording an example", work, done)

    def save(self, suffix: str) -> None:
        """Writes the last answer, soon, in the form that the suffix names; InputError before there is one."""
        found = self.result
        if found is None:
            raise InputError(f"there is no {in_sentence(self.analysis.title)} yet; press {self.analysis.title} first")
        folder = self.comparing.folder
        path = folder.fresh(folder.recordings, self.analysis.name, suffix)

        def keep() -> None:
            from emaviz.views.report import export  # plotly takes half a second to import

            export(found, path)
            self.events.kept(path)

        self._files.post(f"{self.analysis.name} {suffix}", keep)

    def saved(self) -> dict[str, Any]:
        """For a session's file: the answer as it is."""
        return msgspec.to_builtins(SavedAnalysis(self.chosen, None if self.result is None else self.result.to_dict()))

    def restore(self, saved: Any) -> None:
        """Takes what `saved` gave, and computes nothing again; InputError, and nothing changes, for what is damaged."""
        told: SavedAnalysis = taken(SavedAnalysis, saved, f"part of {self.analysis.title}")
        result = None if told.result is None else self.analysis.result.from_dict(told.result)
        for name in self.analysis.options.keys() & told.options.keys():
            self.choose(name, told.options[name])
        self.result = result
        self.provenance.clear()
        if result is not None:
            self.provenance.restored()
