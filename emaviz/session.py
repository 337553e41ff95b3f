"""The app without a screen: settings in, simulations and identifications out, on the compute thread."""

from __future__ import annotations

import copy
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from ema_model.identification.objective import Objective, simulated
from ema_model.identification.run import Identification, Progress, steps, warm_up
from ema_model.measurement import Measurement
from ema_model.simulation import simulate_monitor, simulate_reference
from emaviz.recording.story import IdentificationStory
from emaviz.state import Settings
from emaviz.worker import Steps, Worker


@dataclass(frozen=True)
class Simulation:
    """A run of both models, and what it was asked for."""

    reference: Measurement
    monitor: Measurement
    k: NDArray[np.float64]
    elapsed_s: float


@dataclass
class Events:
    """What the screen listens to; called on the compute thread, so listeners only hand over."""

    simulated: list[Callable[[Simulation], None]] = field(default_factory=list)
    progressed: list[Callable[[Progress, NDArray[np.float64]], None]] = field(default_factory=list)
    identified: list[Callable[[Identification, Path | None], None]] = field(default_factory=list)
    told: list[Callable[[str, str], None]] = field(default_factory=list)  # title, one line
    status: list[Callable[[str], None]] = field(default_factory=list)


class Session:
    """Owns the settings, the compute thread and the results."""

    def __init__(self, actuator: Actuator, folder: Path) -> None:
        self.actuator = actuator
        self.folder = folder
        self.settings = Settings()
        self.events = Events()
        self.identified: Identification | None = None
        self.simulation: Simulation | None = None
        self.ready = threading.Event()
        self._stop = threading.Event()
        self.worker = Worker("emaviz-compute", self._on_error)

    def start(self) -> None:
        """Compiles what the page needs, visibly, and shows the first picture."""
        self.worker.post("warm up", self._warm_up)

    def close(self) -> None:
        """Ends the compute thread."""
        self._stop.set()
        self.worker.close()

    # --- simulation -------------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Simulates the current settings soon; of several requests the last one counts."""
        self.worker.post("simulate", self._simulate)

    def _simulate(self) -> None:
        if not self.ready.is_set():
            return  # the warm-up ends with a simulation
        started = time.perf_counter()
        settings = copy.deepcopy(self.settings)
        run = settings.run()
        fitted = self.identified.k if self.identified is not None else HEALTHY
        shown = {"healthy": HEALTHY, "same faults": settings.k, "identified": fitted}[settings.monitor]
        try:
            reference = simulate_reference(run, self.actuator, settings.k)
            monitor = simulate_monitor(run, self.actuator, shown)
        except FloatingPointError as error:
            raise InputError(str(error)) from None
        self.simulation = Simulation(reference, monitor, settings.k, time.perf_counter() - started)
        _tell(self.events.simulated, self.simulation)

    def _warm_up(self) -> None:
        started = time.perf_counter()
        _tell(self.events.status, "Compiling the models for this computer (the first time takes some seconds)…")
        run = Settings().run()
        reference = simulate_reference(run, self.actuator)
        simulate_monitor(run, self.actuator)
        self.ready.set()
        self._simulate()
        _tell(self.events.status, "Compiling the identification…")
        warm_up(Objective([reference], self.actuator))
        _tell(self.events.status, f"Ready ({time.perf_counter() - started:.1f} s).")

    # --- identification ---------------------------------------------------------------------------------------------

    def identify(self) -> bool:
        """Begins an identification of the settings' faults; False while one runs."""
        stop = threading.Event()
        started = self.worker.start(self._identification(copy.deepcopy(self.settings), stop))
        if started:
            self._stop = stop
        return started

    def stop(self) -> None:
        """Ends the identification after its current iteration, keeping what it has."""
        self._stop.set()

    def _identification(self, settings: Settings, stop: threading.Event) -> Steps:
        measurement = simulated(settings.run(), self.actuator, settings.k, settings.fitness)
        yield
        objective = Objective([measurement], self.actuator, fitness=settings.fitness)
        story = self._story(settings, objective, measurement)
        running = steps(
            objective,
            settings.algorithm,
            population=settings.population,
            iterations=settings.iterations,
            seed=settings.seed,
            truth=settings.k,
            parameters_known=True,
        )
        try:
            progress = next(running)
            while True:
                if story is not None:
                    story.iteration(progress)
                _tell(self.events.progressed, progress, settings.k)
                yield
                progress = running.send(stop.is_set())
        except StopIteration as finished:
            answer: Identification = finished.value
        except BaseException:
            if story is not None:
                story.close()
            raise
        self.identified = answer
        self.settings.monitor = "identified"
        path = None
        if story is not None:
            story.finish(answer)
            path = None if story.failed else story.path
            if story.failed:
                _tell(self.events.told, "The recording could not be written", story.failed)
        _tell(self.events.identified, answer, path)
        self.refresh()

    def _story(self, settings: Settings, objective: Objective, measurement: Measurement) -> IdentificationStory | None:
        stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
        path = self.folder / f"{stamp}-{settings.algorithm}.rrd"
        for again in range(2, 100):
            if not path.exists():
                break
            path = self.folder / f"{stamp}-{settings.algorithm}-{again}.rrd"
        try:
            return IdentificationStory(path, objective, measurement, "reference", settings.k, _readable(settings))
        except OSError as error:
            _tell(self.events.told, "The recording cannot be written", str(error))
            return None

    def _on_error(self, error: BaseException) -> None:
        if isinstance(error, InputError):
            _tell(self.events.told, "That does not work", str(error))
            return
        traceback.print_exception(error)
        _tell(self.events.told, "Something failed; the app goes on", f"{type(error).__name__}: {error}")


def _readable(settings: Settings) -> dict[str, Any]:
    return {
        "k": " ".join(f"{value:g}" for value in settings.k),
        "command": settings.command,
        **{name: value for name, value in settings.run().command.settings().items()},
        "duration_s": settings.duration_s,
        "load_torque_Nm": settings.load_torque_Nm,
        "algorithm": settings.algorithm,
        "population": settings.population,
        "iterations": settings.iterations,
        "fitness": settings.fitness,
        "seed": settings.seed,
    }


def _tell(listeners: list[Callable[..., None]], *values: Any) -> None:
    for listener in listeners:
        listener(*values)
