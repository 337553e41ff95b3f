"""Runs the steps of a discovery on the compute thread, one at a time, and tells what goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ema_model.discovery.snapshot import Look
from ema_model.errors import InputError
from emaviz.session.compare.comparing import Stopped
from emaviz.session.session import Session
from emaviz.session.signal import Signal
from emaviz.session.worker import Steps

_TICK_S = 0.5
_RESTED = 2  # looks, a quarter of a second apart, at a compute thread that is free
_MOST_WAIT_S = 20.0  # for what may never be ready
Tell = Callable[[str], None]
Job = Callable[[Tell], None]


@dataclass
class DiscoverEvents:
    """What the screen listens to; called on the threads that work, so listeners only hand over."""

    began: Signal[[str]] = field(default_factory=Signal)  # a job, with its title
    progressed: Signal[[str, float]] = field(default_factory=Signal)  # text, and seconds since it began
    looked: Signal[[Look | None]] = field(default_factory=Signal)  # the story has changed
    ended: Signal[[str]] = field(default_factory=Signal)  # a job: what came of it
    waits: Signal[[str]] = field(default_factory=Signal)  # a job, for its turn
    unsuggested: Signal[[]] = field(default_factory=Signal)  # no test tells the candidates apart
    revealed: Signal[[]] = field(default_factory=Signal)
    previewed: Signal[[Any]] = field(default_factory=Signal)  # `discovery_own.Preview`
    unpreviewed: Signal[[str]] = field(default_factory=Signal)  # why a torque has no preview
    kept: Signal[[Path]] = field(default_factory=Signal)  # a report, a recording, a model
    verified: Signal[[Path, str]] = field(default_factory=Signal)  # a kept model, and how good it is


class DiscoveryRun:
    """stopped() is called when a step was stopped, and says in words how things stand then."""

    def __init__(self, session: Session, events: DiscoverEvents, stopped: Callable[[], str]) -> None:
        self.running = False
        self.finished = False  # the last one, and was not stopped
        self._session, self._events, self._stopped = session, events, stopped
        self._stop = threading.Event()
        self._waits = threading.Event()  # set: whoever waits to begin shall not any more

    def begin(self, title: str, job: Job) -> bool:
        """Runs job(tell) soon; False, and nothing is begun, while another long run goes on."""
        stop = threading.Event()
        started = self._session.worker.start(self._steps(title, job, stop))
        if started:
            self._waits.set()
            self._stop, self.running, self.finished = stop, True, False
            self._events.began(title)
        return started

    def begin_when_free(self, title: str, job: Job, ready: Callable[[], bool]) -> None:
        """Begins once ready() and no other long run goes on, unless another step begins first or it is stopped."""
        self._waits.set()
        self._waits = over = threading.Event()
        self._events.waits(f"{title}: waiting until nothing else runs …")

        def wait() -> None:
            rested, until = 0, time.perf_counter() + _MOST_WAIT_S
            while not over.wait(_TICK_S / 2.0):
                ready_now = ready() or time.perf_counter() > until
                rested = rested + 1 if ready_now and not self._session.worker.busy else 0
                if rested > _RESTED and self.begin(title, job):
                    return

        threading.Thread(target=wait, name="emaviz-discovery-waits", daemon=True).start()

    def stop(self) -> None:
        """Ends the step that runs, as soon as its present simulation is done, or the wait for one."""
        self._waits.set()
        self._stop.set()

    def _steps(self, title: str, job: Job, stop: threading.Event) -> Steps:
        began = time.perf_counter()
        said = [title]
        over = threading.Event()

        def tick() -> None:
            while not over.wait(_TICK_S):  # a compilation says nothing for seconds
                self._events.progressed(said[0], time.perf_counter() - began)

        def tell(text: str) -> None:
            if stop.is_set():
                raise Stopped
            said[0] = text.replace("_", " ")
            self._events.progressed(said[0], time.perf_counter() - began)
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
        self.finished = True
        self._end(f"{title}: done in {time.perf_counter() - began:.1f} s.")

    def _end(self, text: str) -> None:
        """Tells the end once the compute thread is free, so that a listener may start the next step."""

        def ended() -> None:
            self.running = False
            self._events.ended(text)

        self._session.worker.post("discovery's end", ended)
