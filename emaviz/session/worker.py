"""The one compute thread.

Every kernel runs here.  Callbacks of the page only post: a quick job (a slider's simulation) replaces
one of its kind that has not begun — the latest value wins —, and goes before the next step of the long
job (an identification), of which there is one at most and which can be stopped between two steps.
"""

from __future__ import annotations

import math
import threading
import time
import traceback
from collections.abc import Callable, Generator

from ema_model.errors import InputError, quoted

Job = Callable[[], None]
Steps = Generator[None, None, None]

_ATTENDED_S = 0.3  # after a quick job, in which another one is likely: somebody drags a slider
_STEP_TO_REST = 2.0  # meanwhile, the rest after a long job's step over the time that the step took
_LONGEST_REST_S = 0.05


def report(error: BaseException, told: Callable[[str, str], object], title: str) -> None:
    """What a thread could not do, as its `on_error`: a line where input was refused, else a traceback on the log too.

    told(title, line): to the user; title: of what was refused.
    """
    if isinstance(error, InputError):
        told(title, str(error))
        return
    traceback.print_exception(error)
    told("Something failed; the app goes on", f"{type(error).__name__}: {quoted(error)}")


class Worker:
    """Runs quick jobs by kind, latest wins, and one long job in steps, all on one thread.

    While quick jobs keep coming, the long one takes a third of the thread's time.
    rest_s: the least time between two quick jobs of one kind; the screen's thread takes it so that the
    browser, which has no back-pressure, is not sent more than it can draw.
    """

    def __init__(self, name: str, on_error: Callable[[BaseException], None], rest_s: float = 0.0) -> None:
        self._on_error = on_error
        self._rest_s = rest_s
        self._last: dict[str, float] = {}
        self._attended = -math.inf  # when the last quick job ended
        self._wake = threading.Condition()
        self._quick: dict[str, Job] = {}
        self._long: Steps | None = None
        self._title = ""  # of the long job that was begun last
        self.progress = ""  # how far that says it is
        self._closing = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def post(self, kind: str, job: Job) -> None:
        """Runs a job soon; a job of the same kind that still waits is dropped."""
        with self._wake:
            self._quick[kind] = job  # keeps its place in the line
            self._wake.notify()

    def start(self, steps: Steps, title: str = "", taken: Job = lambda: None) -> bool:
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

    def breathe(self) -> None:
        """Runs the quick jobs that wait, from within a step of the long job that takes longer than they should."""
        assert threading.current_thread() is self._thread
        while not self._closing:
            with self._wake:
                job = self._next_job()
            if job is None:
                return
            self._guarded(job)
            self._attended = time.monotonic()

    @property
    def closing(self) -> bool:
        """Whether the thread is to end."""
        return self._closing

    @property
    def busy(self) -> bool:
        """Whether a long job runs."""
        return self._long is not None

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
                self._guarded(job)
                self._attended = time.monotonic()
            elif self._long is not None:
                started = time.monotonic()
                self._guarded(self._step)
                self._yield_to_quick_jobs(time.monotonic() - started)
        if self._long is not None:
            self._guarded(self._long.close)

    def _yield_to_quick_jobs(self, step_s: float) -> None:
        """Rests after a step while quick jobs keep coming, so that they, and who draws them, find the machine free."""
        if time.monotonic() - self._attended < _ATTENDED_S:
            with self._wake:
                if not (self._quick or self._closing or self._long is None):
                    self._wake.wait(min(_STEP_TO_REST * step_s, _LONGEST_REST_S))

    def _next_job(self) -> Job | None:
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

    def _guarded(self, job: Job) -> None:
        """Runs a job; an error is told, and the thread goes on."""
        try:
            job()
        except Exception as error:
            try:
                self._on_error(error)
            except Exception:
                traceback.print_exc()
