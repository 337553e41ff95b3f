"""A long run on the compute thread: a title, what goes on, a pause, a stop, and an end; one goes on at a time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from typing import Protocol

from ema_model.errors import InputError
from emaviz.session.pace import Pace
from emaviz.session.signal import Signal
from emaviz.session.worker import Steps, Worker
from emaviz.text.time_left import going_on

_TICK_S = 0.5
_PAUSE_S = 0.01  # between two looks whether to go on; sliders are answered in between
_LOOK_S = 0.25  # between two looks whether it is a run's turn
RESTED = 2  # looks at a compute thread that is free, after which nobody is about to ask for it


class Tell(Protocol):
    """Says what goes on, and what share of the work is done, where that is known; raises `Stopped`."""

    def __call__(self, text: str, share: float | None = None) -> None: ...


class Stopped(Exception):
    """A person has stopped the run."""


class Run:
    """One run of a job, as its work sees it: a `Tell`, and whether a person wants it to end."""

    def __init__(self, title: str, told: Callable[[str, float, float | None], object], worker: Worker) -> None:
        """told: what is said, for how long it goes on, s, and the share that is done; on the compute thread."""
        self.title = title
        self._told, self._worker = told, worker
        self._stop, self._go, self.over = threading.Event(), threading.Event(), threading.Event()
        self._go.set()
        self._began = time.perf_counter()
        self._paused_s = 0.0
        self._said: tuple[str, float | None] = (title, None)

    def __call__(self, text: str, share: float | None = None) -> None:
        """Says what goes on; raises `Stopped`."""
        self._end_if_stopping()
        self.say(text, share)
        self._end_if_stopping()  # while it rested

    def say(self, text: str, share: float | None = None) -> None:
        """The same for work that asks for `stopping` itself, since it ends with what it has; rests while paused."""
        self._said = text.replace("_", " "), share
        self._told(self._said[0], self.elapsed_s, share)
        self._worker.breathe()  # the sliders of the other tabs
        began = time.perf_counter()
        while self.paused and not self._go.wait(_PAUSE_S):
            self._worker.breathe()
        self._paused_s += time.perf_counter() - began

    @property
    def stopping(self) -> bool:
        """Whether it was asked to end."""
        return self._stop.is_set() or self._worker.closing

    @property
    def paused(self) -> bool:
        """Whether it rests, or will at the next thing that it says."""
        return not self._go.is_set() and not self.stopping

    @property
    def elapsed_s(self) -> float:
        """For how long it has gone on, without its pauses."""
        return time.perf_counter() - self._began - self._paused_s

    def stop(self) -> None:
        """Asks it to end; also one that rests."""
        self._stop.set()
        self._go.set()

    def pause(self, paused: bool) -> None:
        """Lets it rest, or go on."""
        (self._go.clear if paused else self._go.set)()

    def begin(self) -> None:
        """Its turn has come: says how long it goes on even while it says nothing, as a compilation does."""
        self._began = time.perf_counter()

        def tick() -> None:
            while not self.over.wait(_TICK_S):
                if not self.paused:
                    text, share = self._said
                    self._told(text, self.elapsed_s, share)

        threading.Thread(target=tick, name="emaviz-job-clock", daemon=True).start()

    def _end_if_stopping(self) -> None:
        if self.stopping:
            raise Stopped


Work = Callable[[Run], object]


class Job:
    """Runs work(run), where run(text) says what goes on, lets the sliders be answered, and ends it once stopped.

    Work that returns a generator is done in its steps, between which the compute thread makes room for a slider that
    is dragged.

    Its signals are called on the threads that work, so that listeners only hand over.  `ended` comes once the compute
    thread is free, so that a listener may start the next run; its text is empty where an error is told elsewhere.
    """

    def __init__(
        self, worker: Worker, *, on_stop: Callable[[], str] = lambda: "Stopped.", on_divergence: str = ""
    ) -> None:
        """on_stop(): how things stand then; on_divergence: what to do about numbers that are no more finite."""
        self.running = False
        self.finished = False  # the last one, and was not stopped
        self.error = ""  # why the last one failed
        self.began: Signal[[str]] = Signal()  # with its title
        self.progressed: Signal[[str, float, float | None]] = Signal()  # text, seconds since it began, share
        self.rests: Signal[[bool]] = Signal()  # it was paused, or goes on
        self.waits: Signal[[str]] = Signal()  # for its turn
        self.ended: Signal[[str]] = Signal()  # what came of it
        self._worker, self._on_stop, self._on_divergence = worker, on_stop, on_divergence
        self._run: Run | None = None
        self._awaited = ""  # title of the run that waits
        self._pace = Pace()
        self._over = threading.Event()  # set: whoever waits to begin shall not any more
        self._over.set()

    @property
    def title(self) -> str:
        """Of the run that goes on, or waits for its turn; "" for none."""
        return self._run.title if self.running and self._run is not None else self._awaited if self.waiting else ""

    @property
    def paused(self) -> bool:
        """Whether it rests."""
        return self.running and self._run is not None and self._run.paused

    @property
    def waiting(self) -> bool:
        """Whether a run waits for its turn."""
        return not self._over.is_set()

    def begin(self, title: str, work: Work, done: Callable[[], str | None] | None = None) -> bool:
        """Runs it soon; False, and nothing is begun, while another long run goes on, or the end of one is to be told.

        done(): called just before its `ended`, if it came to its end; returns what came of it, if that says more than
        how long it took.
        """
        run = Run(title, self._tells, self._worker)

        def taken() -> None:
            self._over.set()
            self._run, self.running, self.finished, self.error = run, True, False, ""
            self.began(title)  # before its end, which may come at once

        return not self.running and self._worker.start(self._steps(run, work, done), title, taken)

    def begin_in_turn(
        self, title: str, begin: Callable[[], bool], waits_for: Callable[[], str] = lambda: "", rests: int = 0
    ) -> None:
        """Calls begin() until that is true, as soon as no other long run goes on; says meanwhile for what it waits.

        It gives up once another run begins first, or it is stopped.
        waits_for(): what else must end before, in words; rests: how many looks must find the compute thread free, so
        that whatever a person asks for meanwhile goes first.
        """
        self._over.set()
        self._awaited = title
        self._over = over = threading.Event()

        def wait() -> None:
            free = 0
            while not over.is_set():
                what = waits_for() or self._worker.goes_on
                free = 0 if what else free + 1
                if free > rests and begin():
                    over.set()
                    self.waits("")
                    return
                if not self.running and not over.is_set():  # else its line says how far that is
                    self.waits(f"{title}: waiting {f'for {what}' if what else 'its turn'} …")
                over.wait(_LOOK_S)

        threading.Thread(target=wait, name="emaviz-job-waits", daemon=True).start()

    def stop(self) -> None:
        """Ends what runs, as soon as its present simulation is done, or the wait for its turn."""
        self._over.set()
        if self._run is not None:
            self._run.stop()

    def pause(self, paused: bool) -> None:
        """Lets what runs rest after its present simulation, or go on."""
        if self.running and self._run is not None:
            self._run.pause(paused)
            self.rests(self.paused)

    def _tells(self, text: str, elapsed_s: float, share: float | None) -> None:
        known = self._pace.at(text, elapsed_s)
        share = known if share is None else share
        said = "" if self._run is not None and text == self._run.title else f"{text}, "
        self._worker.progress = f"{said}{going_on(elapsed_s, share)}"
        self.progressed(text, elapsed_s, share)

    def _steps(self, run: Run, work: Work, done: Callable[[], str | None] | None) -> Steps:
        yield
        run.begin()
        self._pace.begin(run.title)
        try:
            steps = work(run)
            if isinstance(steps, Generator):
                yield from steps
        except Stopped:
            self._end(self._on_stop())
            return
        except FloatingPointError as error:
            told = InputError("; ".join(filter(None, (str(error), self._on_divergence))))
            self._fail(told)
            raise told from None
        except BaseException as error:
            self._fail(error)
            raise
        finally:
            run.over.set()
        if not run.stopping:
            self._pace.end(run.elapsed_s)
        self.finished = True
        self._end(f"{run.title}: done in {run.elapsed_s:.1f} s.", done)

    def _fail(self, error: BaseException) -> None:
        """What stands where the job is asked for; it is told as well."""
        self.error = str(error) if isinstance(error, InputError) else "Something failed; the app goes on."
        self._end("")

    def _end(self, text: str, done: Callable[[], str | None] | None = None) -> None:
        def ended() -> None:
            self.running = False
            self.ended((done() if done is not None else None) or text)

        self._worker.post(f"end of {id(self)}", ended)
