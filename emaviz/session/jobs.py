"""Jobs on the one compute thread, one after another: how far each is, its Pause and its Stop, and those that wait."""

from __future__ import annotations

import contextlib
import ctypes
import math
import re
import threading
import time
import traceback
from collections.abc import Callable, Generator, Hashable, Iterable
from dataclasses import dataclass, field
from typing import Generic, ParamSpec, Protocol, TypeVar

from ema_model.errors import InputError, quoted
from emaviz.text import going_on

# --- what happens, and those who asked to be told ---------------------------------------------------------------------

Values = ParamSpec("Values")


class Signal(Generic[Values]):
    """One thing that happens; called with its values, it tells everyone on the thread of whoever calls."""

    def __init__(self) -> None:
        self._listeners: list[Callable[..., object]] = []

    def connect(self, listener: Callable[Values, object]) -> None:
        """Has a listener called each time, after those that came before it."""
        self._listeners.append(listener)

    def disconnect(self, listener: Callable[Values, object]) -> None:
        """The listener is not called any more; ValueError if it never was."""
        self._listeners.remove(listener)

    def __call__(self, *values: Values.args, **named: Values.kwargs) -> None:
        for listener in tuple(self._listeners):
            listener(*values, **named)


# --- the one compute thread -------------------------------------------------------------------------------------------
# Every kernel runs here.  Callbacks of the page only post: a quick job (a slider's simulation) replaces
# one of its kind that has not begun — the latest value wins —, and goes before the next step of the long
# job (an identification), of which there is one at most and which can be stopped between two steps.

Call = Callable[[], object]
Steps = Generator[None, None, None]
Done = TypeVar("Done")

_ATTENDED_S = 0.3  # after a quick job, in which another one is likely: somebody drags a slider
_STEP_TO_REST = 2.0  # meanwhile, the rest after a long job's step over the time that the step took
_LONGEST_REST_S = 0.05


def elsewhere(work: Callable[[], Done], name: str, look_s: float) -> Generator[None, None, Done]:
    """Steps, one in so many s, that end with what a thread of its own comes to; what fails there is raised here."""
    done: list[Done] = []
    failed: list[BaseException] = []

    def working() -> None:
        try:
            done.append(work())
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=working, name=name, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(look_s)
        yield
    if failed:
        raise failed[0]
    return done[0]


def report(error: BaseException, told: Callable[[str, str], object], title: str) -> None:
    """What a thread could not do, as its `on_error`: a line where input was refused, else a traceback on the log too.

    told(title, line): to the user; title: of what was refused.
    """
    if isinstance(error, InputError):
        told(title, str(error))
        return
    traceback.print_exception(error)
    told("Something failed; the app goes on", f"{type(error).__name__}: {quoted(error)}")


def _give_back() -> None:
    """What is free goes back to the system: glibc keeps what its threads have freed, 250 MB after ten discoveries."""
    with contextlib.suppress(AttributeError, OSError, TypeError):  # another library, as on macOS, or Windows
        ctypes.CDLL(None).malloc_trim(0)


class Worker:
    """Runs quick jobs by kind, latest wins, and one long job in steps, all on one thread.

    While quick jobs keep coming, the long one takes a third of the thread's time.
    rest_s: the least time between two quick jobs of one kind; the screen's thread takes it so that the
    browser, which has no back-pressure, is not sent more than it can draw.
    """

    def __init__(self, name: str, on_error: Callable[[BaseException], None], rest_s: float = 0.0) -> None:
        self._on_error = on_error
        self._rest_s = rest_s
        self._last: dict[Hashable, float] = {}
        self._attended = -math.inf  # when the last quick job ended
        self._wake = threading.Condition()
        self._quick: dict[Hashable, Call] = {}
        self._long: Steps | None = None
        self._end: Call | None = None  # tells that the long job is over
        self._title = ""  # of the long job that was begun last
        self.progress = ""  # how far that says it is
        self.jobs = Jobs(self)  # the long ones: which runs, and which wait
        self._closing = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def post(self, kind: Hashable, job: Call) -> None:
        """Runs a job soon; a job of the same kind that still waits is dropped."""
        with self._wake:
            self._quick[kind] = job  # keeps its place in the line
            self._wake.notify()

    def hear(
        self,
        signal: Signal[Values],
        act: Callable[Values, object],
        *,
        kind: Hashable = None,
        each: Callable[Values, Hashable] | None = None,
    ) -> None:
        """Calls act here with the values of a signal; values that still wait give way to later ones.

        kind: for signals of which only the latest counts, whichever that is.  each(): what the values are about;
        they give way only to others about the same.
        """

        def tell(*values: Values.args, **named: Values.kwargs) -> None:
            own = kind or tell
            self.post(own if each is None else (own, each(*values, **named)), lambda: act(*values, **named))

        signal.connect(tell)

    def hear_any(self, signals: Iterable[Signal[...]], act: Call) -> None:
        """Calls act here, once, after one or several of the signals."""
        for signal in signals:
            signal.connect(lambda *_: self.post(act, act))

    def follow(self, job: Job, act: Callable[[bool], object]) -> None:
        """Calls act here with whether a job runs, each time that it begins or ends."""
        self.hear_any((job.began, job.ended), lambda: act(job.running))

    def start(self, steps: Steps, title: str = "", taken: Call = lambda: None) -> bool:
        """Begins a long job, a step at a time; False, and nothing is begun, while another one runs.

        taken(): called before its first step, however quick that is.
        """
        with self._wake:
            if self._long is not None:
                return False
            self._long, self._title, self.progress = steps, title, ""
            taken()
            self._wake.notify()
            return True

    def finish(self, end: Call) -> None:
        """From within the last step of the long job: calls end() once the thread is free for another one."""
        self._end = end

    def breathe(self) -> None:
        """Runs the quick jobs that wait, from within a step of the long job that takes longer than they should."""
        assert threading.current_thread() is self._thread
        while not self._closing:
            with self._wake:
                job = self._next_job()
            if job is None:
                return
            self.guarded(job)
            self._attended = time.monotonic()

    @property
    def closing(self) -> bool:
        """Whether the thread is to end."""
        return self._closing

    @property
    def busy(self) -> bool:
        """Whether a long job runs, or its end is to be told."""
        return self._long is not None or self._end is not None

    @property
    def doing(self) -> str:
        """The title of the long job that runs; "" for none."""
        return self._title if self.busy else ""

    @property
    def goes_on(self) -> str:
        """The same, and how far that says it is: 'Identifying (12 s, about 40 s left)'."""
        title, progress = self.doing or "another long run", self.progress
        return "" if not self.busy else f"{title} ({progress})" if progress else title

    def close(self) -> None:
        """Ends the thread after its current step."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while True:
            with self._wake:
                job = self._next_job()
                while not (self._closing or job or self._long is not None):
                    self._wake.wait(self._rest_s if self._quick else None)
                    job = self._next_job()
                if self._closing:
                    break
            if job is not None:
                self.guarded(job)
                self._attended = time.monotonic()
            elif self._long is not None:
                started = time.monotonic()
                self.guarded(self._step)
                self._tell_end()
                self._yield_to_quick_jobs(time.monotonic() - started)
        if self._long is not None:
            self.guarded(self._long.close)

    def _yield_to_quick_jobs(self, step_s: float) -> None:
        """Rests after a step while quick jobs keep coming, so that they, and who draws them, find the machine free."""
        if time.monotonic() - self._attended < _ATTENDED_S:
            with self._wake:
                if not (self._quick or self._closing or self._long is None):
                    self._wake.wait(min(_STEP_TO_REST * step_s, _LONGEST_REST_S))

    def _next_job(self) -> Call | None:
        """The oldest quick job whose kind has rested, taken off the list."""
        now = time.monotonic()
        for kind in self._quick:
            if now - self._last.get(kind, -math.inf) >= self._rest_s:
                self._last[kind] = now
                return self._quick.pop(kind)
        return None

    def _step(self) -> None:
        assert self._long is not None
        try:
            next(self._long)
        except StopIteration:
            self._long = None
        except BaseException:
            self._long = None  # before the error is told, so that another may be started at once
            raise

    def _tell_end(self) -> None:
        """Of the long job whose last step that was, also where another one has begun since."""
        if self._end is None:
            return
        self.guarded(self._end)
        self._end = None
        _give_back()

    def guarded(self, job: Call) -> None:
        """Runs a job; an error is told, and the thread goes on."""
        try:
            job()
        except Exception as error:
            try:
                self._on_error(error)
            except Exception:
                traceback.print_exc()


# --- which long run goes on, and which wait for it: one list for all tabs ---------------------------------------------

_LOOK_S = 0.25  # between two looks whether it is a run's turn
RESTED = 2  # looks at a compute thread that is free, after which nobody is about to ask for it


@dataclass(eq=False)
class Waiting:
    """A run that is asked for, and begins as soon as no other goes on, and what it waits for besides has ended.

    begin(): whether there is no more to wait for; it takes what is chosen then.  waits_for(): what else must end
    before, in words.  says(text): for what it waits, while it does; gone(): it does not any more.  rests: looks that
    must find the compute thread free, so that what a person asks for meanwhile goes first.
    """

    title: str
    begin: Callable[[], bool]
    waits_for: Callable[[], str] = lambda: ""
    says: Callable[[str], object] = lambda text: None
    gone: Callable[[], object] = lambda: None
    rests: int = 0
    free: int = field(default=0, init=False)  # looks that have found it so, one after another


@dataclass(frozen=True)
class AtWork:
    """How far the run is that goes on."""

    job: Job
    text: str  # what it does
    elapsed_s: float
    share: float | None  # that is done, if that is known


@dataclass(frozen=True)
class Ended:
    """A run that is over."""

    job: Job
    title: str
    stopped: bool  # by a person


class Jobs:
    """Of one compute thread.  `changed` is called on the threads that work, so that listeners only hand over."""

    def __init__(self, worker: Worker) -> None:
        self.changed: Signal[[]] = Signal()
        self.running: AtWork | None = None
        self.begun = 0  # runs so far
        self.ended: Ended | None = None  # the run before
        self._worker = worker
        self._waiting: list[Waiting] = []
        self._lock = threading.RLock()
        self._come = threading.Event()
        self._looks: threading.Thread | None = None

    @property
    def waiting(self) -> tuple[Waiting, ...]:
        """In their order."""
        with self._lock:
            return tuple(self._waiting)

    def add(self, one: Waiting, instead_of: Waiting | None = None) -> None:
        """One more, at the end, or where another one stands that it replaces."""
        with self._lock:
            if instead_of in self._waiting:
                self._waiting[self._waiting.index(instead_of)] = one
            else:
                self._waiting.append(one)
            if self._looks is None:
                self._looks = threading.Thread(target=self._look_on, name="emaviz-jobs-wait", daemon=True)
                self._looks.start()
        self._come.set()
        self.changed()

    def remove(self, one: Waiting | None) -> None:
        """It does not wait any more."""
        with self._lock:
            if one is None or one not in self._waiting:
                return
            self._waiting.remove(one)
        one.gone()
        self.changed()

    def began(self, job: Job) -> None:
        """It runs from now on."""
        self.begun += 1
        self.running = AtWork(job, job.title, 0.0, None)
        self.changed()

    def told(self, job: Job, text: str, elapsed_s: float, share: float | None) -> None:
        """How far it is."""
        self.running = AtWork(job, text, elapsed_s, share)
        self.changed()

    def over(self, ended: Ended) -> None:
        """It runs no more."""
        self.running, self.ended = None, ended
        self.changed()

    def _look_on(self) -> None:
        while not self._worker.closing:
            if not self.waiting:
                self._come.wait(1.0)
                self._come.clear()
                continue
            self._look()
            self._come.wait(_LOOK_S)
            self._come.clear()

    def _look(self) -> None:
        goes_on = ""  # what did as the first was looked at: none behind it goes first since it ended meanwhile
        for one in sorted(self.waiting, key=lambda one: one.rests):
            goes_on = goes_on or self._worker.goes_on
            what = one.waits_for() or goes_on
            one.free = 0 if what else one.free + 1
            if one not in self.waiting:  # it was taken off meanwhile
                continue
            if one.free > one.rests and self._begins(one):
                self.remove(one)
            elif one in self.waiting:
                one.says(f"{one.title}: waiting {f'for {what}' if what else 'its turn'} …")

    def _begins(self, one: Waiting) -> bool:
        begun = True  # one that fails does not wait any more

        def begin() -> None:
            nonlocal begun
            begun = one.begin()

        self._worker.guarded(begin)
        return begun


# --- how far a job is that tells in words what it does: as far as its last run was when it said the same --------------

_NUMBERS = re.compile(r"\d+([.,]\d+)?")


class Pace:
    """Of jobs by their titles.  The first run of each has nothing to go by; later ones have the run before."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[dict[str, float], float]] = {}  # when each text was said first, and the whole, s
        self._title, self._said = "", dict[str, float]()

    def begin(self, title: str) -> None:
        """A run begins."""
        self._title, self._said = title, {}

    def at(self, text: str, elapsed_s: float) -> float | None:
        """It says this after that time; returns its share that is done, 0 … 1, if that is known."""
        step = _NUMBERS.sub("#", text)
        self._said.setdefault(step, elapsed_s)
        times, whole = self._known.get(self._title, ({}, 0.0))
        if step not in times or not whole > 0.0:
            return None
        since = elapsed_s - self._said[step]
        later = min((one for one in times.values() if one > times[step]), default=whole)
        return min(min(times[step] + since, later) / whole, 0.99)

    def end(self, elapsed_s: float) -> None:
        """It came to its end, and is what the next one is measured by."""
        self._known[self._title] = self._said, elapsed_s


# --- a long run on the compute thread: a title, what goes on, a pause, a stop, and an end; one goes on at a time ------

_TICK_S = 0.5
_PAUSE_S = 0.01  # between two looks whether to go on; sliders are answered in between


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


_LOOK_AT_S = 0.1


def aside(work: Callable[[], Done], tell: Tell, text: str) -> Done:
    """What work comes to, done on a thread of its own while the compute thread says text, and ends once it is stopped.

    For work that has no moment to ask whether it shall end, as a compilation: it goes on unheard then.
    """
    steps = elsewhere(work, "emaviz-aside", _LOOK_AT_S)
    while True:
        tell(text)
        try:
            next(steps)
        except StopIteration as done:
            return done.value


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
        self._awaited: Waiting | None = None
        self._pace = Pace()

    @property
    def title(self) -> str:
        """Of the run that goes on, or waits for its turn; "" for none."""
        return (
            self._run.title if self.running and self._run is not None else self._awaited.title if self._awaited else ""
        )

    @property
    def paused(self) -> bool:
        """Whether it rests."""
        return self.running and self._run is not None and self._run.paused

    @property
    def waiting(self) -> bool:
        """Whether a run waits for its turn."""
        return self._awaited is not None

    def begin(self, title: str, work: Work, done: Callable[[], str | None] | None = None) -> bool:
        """Runs it soon; False, and nothing is begun, while another long run goes on, or the end of one is to be told.

        done(): called just before its `ended`, if it came to its end; returns what came of it, if that says more than
        how long it took.
        """
        run = Run(title, self._tells, self._worker)

        def taken() -> None:
            self._give_up()
            self._run, self.running, self.finished, self.error = run, True, False, ""
            self._worker.jobs.began(self)
            self.began(title)  # before its end, which may come at once

        return not self.running and self._worker.start(self._steps(run, work, done), title, taken)

    def begin_in_turn(
        self, title: str, begin: Callable[[], bool], waits_for: Callable[[], str] = lambda: "", rests: int = 0
    ) -> None:
        """Calls begin() until that is true, as soon as no other long run goes on; says meanwhile for what it waits.

        It gives up once another run of this job begins first, or it is stopped.
        waits_for(): what else must end before, in words; rests: how many looks must find the compute thread free, so
        that whatever a person asks for meanwhile goes first.
        """

        def says(text: str) -> None:
            if not self.running:  # else its line says how far that is
                self.waits(text)

        def gone() -> None:
            if self._awaited is one:
                self._awaited = None
                self.waits("")

        one = Waiting(title, begin, waits_for, says, gone, rests)
        before, self._awaited = self._awaited, one
        self._worker.jobs.add(one, before)

    def stop(self) -> None:
        """Ends what runs, as soon as its present simulation is done, or the wait for its turn."""
        self._give_up()
        if self._run is not None:
            self._run.stop()

    def pause(self, paused: bool) -> None:
        """Lets what runs rest after its present simulation, or go on."""
        if self.running and self._run is not None:
            self._run.pause(paused)
            self.rests(self.paused)

    def _give_up(self) -> None:
        """Who waits to begin shall not any more."""
        self._worker.jobs.remove(self._awaited)

    def _tells(self, text: str, elapsed_s: float, share: float | None) -> None:
        known = self._pace.at(text, elapsed_s)
        share = known if share is None else share
        said = "" if self._run is not None and text == self._run.title else f"{text}, "
        self._worker.progress = f"{said}{going_on(elapsed_s, share)}"
        if self.running:
            self._worker.jobs.told(self, text, elapsed_s, share)
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
        run = self._run

        def ended() -> None:
            self.running = False
            if run is not None:
                self._worker.jobs.over(Ended(self, run.title, run.stopping))
            self.ended((done() if done is not None else None) or text)

        self._worker.finish(ended)
