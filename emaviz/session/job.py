"""A long run on the compute thread: a title, what goes on, a stop, and an end; one goes on at a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Protocol

from ema_model.errors import InputError
from emaviz.session.signal import Signal
from emaviz.session.worker import Steps, Worker

_TICK_S = 0.5
_RESTED = 2  # looks, a quarter of a second apart, at a compute thread that is free
_MOST_WAIT_S = 20.0  # for what may never be ready


class Tell(Protocol):
    """Says what goes on, and what share of the work is done, where that is known; raises `Stopped`."""

    def __call__(self, text: str, share: float | None = None) -> None: ...


Work = Callable[[Tell], object]


class Stopped(Exception):
    """A person has stopped the run."""


class Job:
    """Runs work(tell), where tell(text) says what goes on, lets the sliders be answered, and ends it once stopped.

    Its signals are called on the threads that work, so that listeners only hand over.  `ended` comes once the compute
    thread is free, so that a listener may start the next run; its text is empty where an error is told elsewhere.
    """

    def __init__(
        self, worker: Worker, *, on_stop: Callable[[], str] = lambda: "Stopped.", on_divergence: str = ""
    ) -> None:
        """on_stop(): how things stand then; on_divergence: what to do about numbers that are no more finite."""
        self.running = False
        self.finished = False  # the last one, and was not stopped
        self.began: Signal[[str]] = Signal()  # with its title
        self.progressed: Signal[[str, float, float | None]] = Signal()  # text, seconds since it began, share
        self.waits: Signal[[str]] = Signal()  # for its turn
        self.ended: Signal[[str]] = Signal()  # what came of it
        self._worker, self._on_stop, self._on_divergence = worker, on_stop, on_divergence
        self._stop = threading.Event()
        self._waits = threading.Event()  # set: whoever waits to begin shall not any more

    def begin(self, title: str, work: Work, done: Callable[[], None] | None = None) -> bool:
        """Runs it soon; False, and nothing is begun, while another long run goes on.

        done(): called just before its `ended`, if it came to its end.
        """
        stop = threading.Event()
        started = self._worker.start(self._steps(title, work, done, stop))
        if started:
            self._waits.set()
            self._stop, self.running, self.finished = stop, True, False
            self.began(title)
        return started

    def begin_when_free(self, title: str, work: Work, ready: Callable[[], bool]) -> None:
        """Begins once ready() and no other long run goes on, unless another one begins first or it is stopped."""
        self._waits.set()
        self._waits = over = threading.Event()
        self.waits(f"{title}: waiting until nothing else runs …")

        def wait() -> None:
            rested, until = 0, time.perf_counter() + _MOST_WAIT_S
            while not over.wait(_TICK_S / 2.0):
                ready_now = ready() or time.perf_counter() > until
                rested = rested + 1 if ready_now and not self._worker.busy else 0
                if rested > _RESTED and self.begin(title, work):
                    return

        threading.Thread(target=wait, name="emaviz-job-waits", daemon=True).start()

    def stop(self) -> None:
        """Ends what runs, as soon as its present simulation is done, or the wait for its turn."""
        self._waits.set()
        self._stop.set()

    def _steps(self, title: str, work: Work, done: Callable[[], None] | None, stop: threading.Event) -> Steps:
        began = time.perf_counter()
        said: tuple[str, float | None] = (title, None)
        over = threading.Event()

        def tick() -> None:
            while not over.wait(_TICK_S):  # a compilation says nothing for seconds
                self.progressed(said[0], time.perf_counter() - began, said[1])

        def tell(text: str, share: float | None = None) -> None:
            nonlocal said
            if stop.is_set():
                raise Stopped
            said = text.replace("_", " "), share
            self.progressed(said[0], time.perf_counter() - began, share)
            self._worker.breathe()  # the sliders of the other tabs

        yield
        threading.Thread(target=tick, name="emaviz-job-clock", daemon=True).start()
        try:
            work(tell)
        except Stopped:
            self._end(self._on_stop())
            return
        except FloatingPointError as error:
            self._end("")
            raise InputError("; ".join(filter(None, (str(error), self._on_divergence)))) from None
        except BaseException:
            self._end("")
            raise
        finally:
            over.set()
        self.finished = True
        self._end(f"{title}: done in {time.perf_counter() - began:.1f} s.", done)

    def _end(self, text: str, done: Callable[[], None] | None = None) -> None:
        def ended() -> None:
            self.running = False
            if done is not None:
                done()
            self.ended(text)

        self._worker.post(f"end of {id(self)}", ended)
