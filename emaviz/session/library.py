"""The session's part of the Library: a run with an effect beside the same run without, on the compute thread."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError, quoted
from ema_model.quantities.titles import in_sentence
from ema_model.simulation.with_effect import RUNS, EffectRuns, WithEffect
from emaviz.session.job import Job, Tell
from emaviz.session.session import Session
from emaviz.session.signal import Signal


@dataclass
class LibraryEvents:
    """What the screen listens to; called on the compute thread, so listeners only hand over."""

    felt: Signal[[WithEffect]] = field(default_factory=Signal)  # the effect that was asked for
    drawn: Signal[[WithEffect]] = field(default_factory=Signal)  # one of all, at its clear severity
    said: Signal[[str]] = field(default_factory=Signal)


class Library:
    """Runs effects, in the library's one stack, which is compiled once."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.events = LibraryEvents()
        self.job = Job(session.worker)
        self._runs = EffectRuns(session.actuator)

    def feel(self, name: str, settings: Mapping[str, float], run: str) -> None:
        """Simulates soon; of several requests the last one counts.  InputError for a setting out of range."""
        if run not in RUNS:
            raise InputError(f"no run {quoted(run, 40)!r}; runs are {', '.join(RUNS)}")
        full = find(name, self.session.actuator.axes).settings(dict(settings))

        def job() -> None:
            self._say("Simulating; the first time, the library is compiled, which takes some seconds …")
            found = self._runs.felt(name, full, run)
            self._say("")
            self.events.felt(found)

        self.session.worker.post("library", job)

    def draw_all(self) -> bool:
        """Runs every effect at its clear severity, where it shows most; False while another long run goes on."""
        return self.job.begin("Running all effects", self._draw_all)

    def _draw_all(self, tell: Tell) -> None:
        for i, name in enumerate(CATALOGUE):
            effect = find(name, self.session.actuator.axes)
            tell(f"{in_sentence(effect.title)}, {i + 1} of {len(CATALOGUE)}", i / len(CATALOGUE))
            best = self._runs.clearest(effect)
            if best is not None:
                self.events.drawn(best)

    def _say(self, text: str) -> None:
        self.events.said(text)
