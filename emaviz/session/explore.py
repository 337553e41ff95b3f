"""Exploring without a screen: settings in, simulations, fans and identifications out, on the compute thread."""

from __future__ import annotations

import copy
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import sentences
from ema_model.effects import CATALOGUE, find
from ema_model.errors import InputError, quoted
from ema_model.faults import FAULTS, HEALTHY, NAMES
from ema_model.identification.run import warm_up
from ema_model.identification.search import Objective
from ema_model.quantities import in_sentence
from ema_model.recordings import Measurement
from ema_model.simulation import plant
from ema_model.simulation.run import RUNS, EffectRuns, Run, WithEffect, simulate_monitor, simulate_monitors
from emaviz.session.identify import Identifying, inputs_of
from emaviz.session.jobs import Job, Signal, Tell, Worker, report
from emaviz.session.session_file import Inputs
from emaviz.session.settings import Settings
from emaviz.text import going_on

# --- a fan ------------------------------------------------------------------------------------------------------------
# The monitor model's response to one command under five severities of one fault, the other sliders as set.

SEVERITIES = (0.0, 0.25, 0.5, 0.75, 1.0)
_ECCENTRICITY, _DIRECTION = NAMES.index("k6"), NAMES.index("k7")
_SEEN = 0.5  # of an eccentricity whose direction is looked at, where the slider has none


@dataclass(frozen=True, eq=False)
class Fan:
    """Five runs, from the mildest to the worst."""

    fault: int  # 0 … 7
    k: NDArray[np.float64]  # (5, 8)
    labels: tuple[str, ...]  # (5,), in physical units
    runs: tuple[Measurement, ...]  # (5,)
    note: str = ""  # what was set besides


def fan_of(settings: Settings, actuator: Actuator, fault: int) -> Fan:
    """Simulated in one run of the population.  Raises InputError and FloatingPointError as `simulate_monitors`."""
    k = np.tile(np.asarray(settings.k, dtype=float), (len(SEVERITIES), 1))
    k[:, fault] = SEVERITIES
    note = ""
    if fault == _DIRECTION and not settings.k[_ECCENTRICITY] > 0.0:
        k[:, _ECCENTRICITY] = _SEEN
        note = f"with {FAULTS[_ECCENTRICITY].label} at {_SEEN:g}, without which a direction means nothing"
    runs = simulate_monitors(settings.run(), actuator, k, start_rad=settings.start_rad())
    return Fan(fault, k, tuple(sentences(one, actuator)[fault] for one in k), runs, note)


# --- what Explore shows, and the compute thread that all tabs share ---------------------------------------------------

OWN_PLANT = "the actuator's file"


@dataclass(frozen=True)
class Simulation:
    """A run of both models, and what it was asked for."""

    reference: Measurement
    monitor: Measurement
    k: NDArray[np.float64]
    elapsed_s: float
    command: str = ""  # its family
    model: str = "healthy"  # whose faults the monitor model has, in words
    plant: str = ""  # which model plays the plant, in words, where it is not the actuator's file


@dataclass
class Events:
    """What the screen listens to; called on the compute thread, so listeners only hand over."""

    simulated: Signal[[Simulation]] = field(default_factory=Signal)
    told: Signal[[str, str]] = field(default_factory=Signal)  # title, one line
    status: Signal[[str]] = field(default_factory=Signal)
    fanned: Signal[[Fan]] = field(default_factory=Signal)
    plants: Signal[[]] = field(default_factory=Signal)  # the plant is another model's


class Session:
    """Owns the settings, the compute thread and the results."""

    def __init__(self, actuator: Actuator, folder: Path) -> None:
        self.actuator = actuator
        self.folder = folder
        self.settings = Settings(axes=actuator.axes, k=actuator.k)  # the plant, as its file knows this unit
        self.events = Events()
        self.plants: dict[str, Actuator] = {OWN_PLANT: actuator}  # that may play the plant, by what they are
        self.plant = OWN_PLANT
        self.simulation: Simulation | None = None
        self._monitored: tuple[object, Measurement] | None = None  # the monitor model's last run, and what it was of
        self.ready = threading.Event()
        self.open_file: Callable[[str], Measurement] = _no_files  # by the name of a file in the data folder
        self.worker = Worker("emaviz-compute", self._on_error)
        self.version_of: Callable[[str], str] = lambda _: ""  # of such a file
        self.identifying = Identifying(self.worker, actuator, folder, self.events.told, self.inputs)
        for signal in (self.identifying.identified, self.identifying.brought):
            signal.connect(lambda _: self._show_identified())

    def start(self) -> None:
        """Compiles what the page needs, visibly, and shows the first picture."""
        self.worker.post("warm up", self._warm_up)

    def close(self) -> None:
        """Ends the compute thread."""
        self.worker.close()

    # --- the plant's model ------------------------------------------------------------------------------------------

    def take_plant(self, name: str, actuator: Actuator) -> None:
        """An improved actuator plays the plant from now on; InputError where Explore cannot simulate it."""
        own = self.actuator
        if actuator.axes != own.axes or actuator.has_reference_model != own.has_reference_model:
            raise InputError(f"Explore was started with {own.name}, of which this is no improved model")
        if not plant.can_be_explored(actuator):
            raise InputError(plant.note(actuator))
        self.plants[name] = actuator
        self.choose_plant(name)

    def choose_plant(self, name: Any) -> None:
        """One of `plants` plays the plant from now on; the sliders go to its own faults."""
        if name not in self.plants:
            raise InputError(f"no such model: {quoted(name, 60)}; choose one of the list")
        self.plant = str(name)
        for index, value in enumerate(self.plants[self.plant].k):
            self.settings.set_fault(index, value)
        self.events.plants()

    def model_in_words(self, monitor: str) -> str:
        """'healthy', 'same faults', 'identified 16:09'."""
        if monitor != "identified":
            return monitor
        at = self.identifying.answered_at
        return "identified: nothing yet" if at is None else f"identified {at:%H:%M}"

    # --- simulation -------------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Simulates the current settings soon; of several requests the last one counts."""
        self.worker.post("simulate", self._simulate)

    def show_fan(self, fault: int) -> None:
        """Simulates five severities of one fault (0 … 7) soon, which `fanned` tells."""
        self.worker.post("fan", lambda: self._fan(fault))

    def _fan(self, fault: int) -> None:
        if not self.ready.is_set() or not plant.can_be_explored(self.actuator):
            return
        try:
            self.events.fanned(fan_of(copy.deepcopy(self.settings), self.actuator, fault))
        except FloatingPointError as error:
            raise InputError(str(error)) from None

    def _simulate(self) -> None:
        if not self.ready.is_set() or not plant.can_be_explored(self.actuator):
            return  # the warm-up ends with a simulation
        settings = copy.deepcopy(self.settings)
        name, actuator = self.plant, self.plants[self.plant]
        compiling = not plant.is_compiled(actuator, settings.effects)
        if compiling:
            self.events.status("Compiling the plant with the library of effects…")
        started = time.perf_counter()
        run, start = settings.run(), settings.start_rad()
        fitted = self.identifying.answer.k if self.identifying.answer is not None else HEALTHY
        shown = {"healthy": HEALTHY, "same faults": settings.k, "identified": fitted}[settings.monitor]
        try:
            reference = plant.simulate(
                run,
                actuator,
                settings.k,
                settings.effects,
                start_rad=start,
                start_speed_rad_s=settings.start_speed_rad_s,
                start_play_rad=settings.start_play_rad(actuator),
            )
            monitor = self._monitor(run, shown, start)
        except FloatingPointError as error:
            raise InputError(str(error)) from None
        elapsed = time.perf_counter() - started
        if compiling:
            self.events.status(f"Ready: models compiled in {elapsed:.1f} s.")
        reference = settings.sensors.record(reference, settings.seed)
        model = self.model_in_words(settings.monitor)
        self.simulation = Simulation(
            reference, monitor, settings.k, elapsed, settings.command, model, "" if name == OWN_PLANT else name
        )
        self.events.simulated(self.simulation)

    def _monitor(self, run: Run, k: NDArray[np.float64], start_rad: float) -> Measurement:
        """The monitor model's run, which is simulated once as long as a slider moves nothing but the plant."""
        asked = run, start_rad, tuple(k)
        if self._monitored is None or self._monitored[0] != asked:
            self._monitored = asked, simulate_monitor(run, self.actuator, k, start_rad=start_rad)
        return self._monitored[1]

    def _warm_up(self) -> None:
        started = time.perf_counter()
        self.events.status("Compiling the models for this computer (the first time takes some seconds)…")
        if not plant.can_be_explored(self.actuator):
            self.ready.set()
            self.events.status("Ready.")
            return
        plant.compile_own(self.actuator)
        run = Settings().run()
        reference = plant.simulate(run, self.actuator, HEALTHY, {})
        simulate_monitor(run, self.actuator)
        self.ready.set()
        self._simulate()
        self.events.status("Compiling the identification…")
        warm_up(Objective([reference], self.actuator))
        plant.compile_behind(self.actuator)
        self.events.status(f"Ready: models compiled in {time.perf_counter() - started:.1f} s.")

    # --- identification ---------------------------------------------------------------------------------------------

    def identify(self) -> bool:
        """Begins an identification as the settings say; False while another long run goes on."""
        known = self.plant == OWN_PLANT
        return self.identifying.begin(self.settings, self.plants[self.plant], self.open_file, known)

    def inputs(self) -> Inputs:
        """What an identification would take now."""
        return inputs_of(self.settings, self.plant, lambda name: self.version_of(name))

    def _show_identified(self) -> None:
        if self.settings.monitor == "identified":
            self.refresh()

    def _on_error(self, error: BaseException) -> None:
        report(error, self.events.told, "The run has failed")


def _no_files(name: str) -> Measurement:
    raise InputError(f"{quoted(name, 100)}: there is no data folder to read it from")


# --- the session's part of the Library: a run with an effect beside the same run without, on the compute thread -------

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
