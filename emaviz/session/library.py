"""The session's part of the Library: a run with an effect beside the same run without, on the compute thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError, quoted
from ema_model.quantities import in_sentence
from ema_model.simulation.with_effect import RUNS, EffectRuns, WithEffect
from emaviz.session.explore import Session
from emaviz.session.jobs import Job, Signal, Tell
from emaviz.text.time_left import going_on

_USUAL_S, _TICK_S = 30.0, 1.0  # on two idle cores; between two lines
_COMPILING = "Compiling the library of effects for this computer, once"
_ABOUT = f"about {_USUAL_S:.0f} s"


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
        self._compiled = threading.Event()  # what is asked for; else how long it takes is being told
        self._compiled.set()

    def feel(self, name: str, settings: Mapping[str, float], run: str) -> None:
        """Simulates soon; of several requests the last one counts.  InputError for a setting out of range."""
        if run not in RUNS:
            raise InputError(f"no run {quoted(run, 40)!r}; runs are {', '.join(RUNS)}")
        full = find(name, self.session.actuator.axes).settings(dict(settings))
        if self._compiled.is_set() and not self._runs.is_compiled(name):
            self._compiled.clear()
            threading.Thread(target=self._tell_compiling, name="emaviz-library", daemon=True).start()

        def job() -> None:
            try:
                found = self._runs.felt(name, full, run)
            finally:
                self._compiled.set()
            self.events.felt(found)

        self.session.worker.post("library", job)

    def _tell_compiling(self) -> None:
        """How long it goes on, as long as it does, in place of the charts that it is for."""
        began = time.perf_counter()
        while not self._compiled.is_set():
            elapsed = time.perf_counter() - began
            self.events.said(f"{_COMPILING} … {going_on(elapsed, elapsed / _USUAL_S) if elapsed >= 1.0 else _ABOUT}")
            self._compiled.wait(_TICK_S)
        self.events.said("")

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
