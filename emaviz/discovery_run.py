"""Runs the steps of a discovery on the compute thread, one at a time, and tells what goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ema_model.errors import InputError
from emaviz.comparing import Stopped
from emaviz.discovery_look import Look
from emaviz.session import Session
from emaviz.worker import Steps

_TICK_S = 0.5
Tell = Callable[[str], None]
Job = Callable[[Tell], None]


@dataclass
class DiscoverEvents:
    """What the screen listens to; called on the threads that work, so listeners only hand over."""

    began: list[Callable[[str], None]] = field(default_factory=list)  # a job, with its title
    progressed: list[Callable[[str, float], None]] = field(default_factory=list)  # text, and seconds since it began
    looked: list[Callable[[Look | None], None]] = field(default_factory=list)  # the story has changed
    ended: list[Callable[[str], None]] = field(default_factory=list)  # a job: what came of it
    unsuggested: list[Callable[[], None]] = field(default_factory=list)  # no test tells the candidates apart
    revealed: list[Callable[[], None]] = field(default_factory=list)
    kept: list[Callable[[Path], None]] = field(default_factory=list)  # a report, a recording, a model


class DiscoveryRun:
    """stopped() is called when a step was stopped, and says in words how things stand then."""

    def __init__(self, session: Session, events: DiscoverEvents, stopped: Callable[[], str]) -> None:
        self.running = False
        self._session, self._events, self._stopped = session, events, stopped
        self._stop = threading.Event()

    def begin(self, title: str, job: Job) -> bool:
        """Runs job(tell) soon; False, and nothing is begun, while another long run goes on."""
        stop = threading.Event()
        started = self._session.worker.start(self._steps(title, job, stop))
        if started:
            self._stop, self.running = stop, True
            _tell(self._events.began, title)
        return started

    def stop(self) -> None:
        """Ends the step that runs, as soon as its present simulation is done."""
        self._stop.set()

    def _steps(self, title: str, job: Job, stop: threading.Event) -> Steps:
        began = time.perf_counter()
        said = [title]
        over = threading.Event()

        def tick() -> None:
            while not over.wait(_TICK_S):  # a compilation says nothing for seconds
                _tell(self._events.progressed, said[0], time.perf_counter() - began)

        def tell(text: str) -> None:
            if stop.is_set():
                raise Stopped
            said[0] = text.replace("_", " ")
            _tell(self._events.progressed, said[0], time.perf_counter() - began)
            self._session.worker.breathe()  # the sliders of the other tabs

        yield
        threading.Thread(target=tick, name="emaviz-discovery-clock", daemon=True).start()
        try:
            job(tell)
        except Stopped:
            self._end(self._stopped())
            return
        except FloatingPointError as error:
            self._end("")
            raise InputError(f"{error}; the model stays as it was") from None
        except BaseException:
            self._end("")
            raise
        finally:
            over.set()
        self._end(f"{title}: done in {time.perf_counter() - began:.1f} s.")

    def _end(self, text: str) -> None:
        """Tells the end once the compute thread is free, so that a listener may start the next step."""

        def ended() -> None:
            self.running = False
            _tell(self._events.ended, text)

        self._session.worker.post("discovery's end", ended)


def _tell(listeners: list[Callable[..., None]], *values: Any) -> None:
    for listener in listeners:
        listener(*values)
