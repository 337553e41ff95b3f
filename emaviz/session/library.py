"""The session's part of the Library: a run with an effect beside the same run without, on the compute thread."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

from ema_model.commands import command
from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError, quoted
from ema_model.quantities.titles import in_sentence
from ema_model.recordings import Measurement
from ema_model.simulation.run import Run, simulate_monitor
from ema_model.simulation.with_effect import WithEffect
from emaviz.session.session import Session
from emaviz.session.worker import Steps

RUNS: dict[str, Run] = {
    "sine of 3 Hz": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5),
    "sine of 3 Hz, loaded": Run(command("sine", {"amplitude_rad": 0.03, "frequency_Hz": 3.0}), 0.5, 10_000.0, 200.0),
    "step": Run(command("step", {"final_rad": 0.005}), 0.2),
    "chirp": Run(command("chirp"), 0.5),
}


@dataclass
class LibraryEvents:
    """What the screen listens to; called on the compute thread, so listeners only hand over."""

    felt: list[Callable[[WithEffect], None]] = field(default_factory=list)  # the effect that was asked for
    drawn: list[Callable[[WithEffect], None]] = field(default_factory=list)  # one of all, at its clear severity
    said: list[Callable[[str], None]] = field(default_factory=list)


class Library:
    """Runs effects, in the library's one stack, which is compiled once."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.events = LibraryEvents()
        self._without: dict[str, Measurement] = {}

    def feel(self, name: str, settings: Mapping[str, float], run: str) -> None:
        """Simulates soon; of several requests the last one counts.  InputError for a setting out of range."""
        if run not in RUNS:
            raise InputError(f"no run {quoted(run, 40)!r}; runs are {', '.join(RUNS)}")
        full = find(name, self.session.actuator.axes).settings(dict(settings))

        def job() -> None:
            self._say("Simulating; the first time, the library is compiled, which takes some seconds …")
            found = self._felt(name, full, run)
            self._say("")
            for listener in self.events.felt:
                listener(found)

        self.session.worker.post("library", job)

    def draw_all(self) -> bool:
        """Runs every effect at its clear severity, where it shows most; False while another long run goes on."""
        return self.session.worker.start(self._steps())

    def _steps(self) -> Steps:
        for i, name in enumerate(CATALOGUE):
            effect = find(name, self.session.actuator.axes)
            self._say(f"Running {in_sentence(effect.title)} … {i + 1} of {len(CATALOGUE)}")
            settings = effect.settings({effect.parameters[0].name: effect.severities[1]})
            found: list[WithEffect] = []
            for run in RUNS:
                with suppress(InputError):  # an effect that this actuator does not stand there
                    found.append(self._felt(effect.name, settings, run))
            if found:
                best = max(found, key=lambda felt: felt.visibility)
                for listener in self.events.drawn:
                    listener(best)
            yield
        self._say("")

    def _felt(self, name: str, settings: Mapping[str, float], run: str) -> WithEffect:
        try:
            if run not in self._without:
                self._without[run] = simulate_monitor(RUNS[run], self.session.actuator)
            with_it = simulate_monitor(RUNS[run], self.session.actuator, effects={name: dict(settings)})
        except FloatingPointError as error:
            raise InputError(f"{find(name).title}: {error}; make it weaker") from None
        return WithEffect(name, run, dict(settings), with_it, self._without[run])

    def _say(self, text: str) -> None:
        for listener in self.events.said:
            listener(text)
