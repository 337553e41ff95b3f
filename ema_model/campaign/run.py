"""Runs a plan into a folder: what has no row yet is computed, by processes here or on a Dask cluster."""

from __future__ import annotations

import logging
import multiprocessing
import os
import queue
import signal
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any, Protocol

from ema_model.campaign.kinds import KINDS
from ema_model.campaign.plan import Plan
from ema_model.campaign.rows import ENVIRONMENT, OtherVersion, common, row_of
from ema_model.campaign.store import Store, differences, header_of, version
from ema_model.campaign.store import version as own_version
from ema_model.campaign.task import Task
from ema_model.child_processes import end_with_parent, on_lasting_thread
from ema_model.errors import InputError, quoted

# --- what computes tasks ----------------------------------------------------------------------------------------------

MOST_DEATHS = 3  # of the workers that had a task, after which it counts as an error


class Died(Exception):
    """The workers that had the task ended without an answer: killed, or out of memory."""


Outcome = tuple[Task, "dict[str, Any] | Died"]


class Scheduler(Protocol):
    """Workers somewhere."""

    @property
    def workers(self) -> int:
        """How many tasks it computes at a time."""
        ...

    def outcomes(self, tasks: Sequence[Task], version: dict[str, str]) -> Iterator[list[Outcome]]:
        """The rows of the tasks as they come, some at a time, or none, so that waiting can be told; closing the
        iterator ends the work.

        Raises InputError for workers that cannot compute them.
        """
        ...


# --- processes of this machine ----------------------------------------------------------------------------------------
# Each has a pipe of its own, so that it is known what a process that dies had; it alone is lost, and given to
# another. They end with this process, however it ends.

# Tasks that a process has: the one that it computes, and the next; the last ones go to whoever is free.
_PROCESSES_AHEAD = 2
_MOST_MB = 1500.0  # of a process, after which another takes its place: each stack of effects that it met stays in it
_POLL_S = 0.5


class Processes:
    """So many processes, all cores by default."""

    def __init__(self, workers: int | None = None) -> None:
        self._count = workers or _cores()

    @property
    def workers(self) -> int:
        """How many there are."""
        return self._count

    def outcomes(self, tasks: Sequence[Task], version: dict[str, str]) -> Iterator[list[Outcome]]:
        """See `Scheduler`."""
        waiting, deaths, stillborn = deque(tasks), Counter[str](), 0
        running = [_Process(version) for _ in range(min(self._count, len(tasks)))]
        try:
            while running:
                for one in running:
                    while waiting and one.has_room(_PROCESSES_AHEAD if len(waiting) > len(running) else 1):
                        one.give(waiting.popleft())
                wait([one.connection for one in running], _POLL_S)
                found: list[Outcome] = []
                for one in list(running):
                    found += one.answers()
                    if not (one.ended or one.finished(more=bool(waiting))):
                        continue
                    running.remove(one)
                    if not one.ended:
                        one.close()
                    stillborn = 0 if one.began else stillborn + 1
                    if stillborn >= MOST_DEATHS:
                        raise InputError(
                            "workers end as soon as they are begun; see what `python -c 'import numba'` says"
                        )
                    for i, task in enumerate(reversed(one.tasks)):  # the first one was being computed
                        deaths[task.name] += one.began and i == len(one.tasks) - 1
                        if deaths[task.name] < MOST_DEATHS:
                            waiting.appendleft(task)
                        else:
                            found.append((task, Died(f"Died: {MOST_DEATHS} workers ended while they computed it")))
                    if waiting:
                        running.append(_Process(version))
                yield found
        finally:
            for one in running:
                one.kill()


def _cores() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


class _Process:
    """A worker, and what it has been given."""

    def __init__(self, version: dict[str, str]) -> None:
        context = multiprocessing.get_context("spawn")  # kernels do not run in a forked process
        self.connection, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, version), daemon=True)
        with _environment():
            on_lasting_thread(self._process.start)
        theirs.close()  # so that ours tells when the process has ended
        self.tasks: deque[Task] = deque()
        self.began = self.retiring = self.ended = False

    def has_room(self, ahead: int) -> bool:
        """Whether it takes one more, of so many that it may have."""
        return len(self.tasks) < ahead and not self.retiring

    def give(self, task: Task) -> None:
        """One more to compute, after those that it has."""
        self.tasks.append(task)
        with suppress(OSError):  # it has ended, which `answers` sees
            self.connection.send(task)

    def answers(self) -> list[Outcome]:
        """What has come; `ended` tells whether nothing more will."""
        found: list[Outcome] = []
        try:
            while self.connection.poll():
                answer = self.connection.recv()
                if isinstance(answer, Exception):
                    raise InputError(str(answer))
                if answer is not None:
                    found.append((self.tasks.popleft(), answer))
                    self.retiring = self.retiring or (answer["memory_MB"] or 0.0) > _MOST_MB
                self.began = True
        except (EOFError, OSError):
            self.ended = True
            self._process.join()
        return found

    def finished(self, more: bool) -> bool:
        """Whether it has nothing to do any more."""
        return not self.tasks and (self.retiring or not more)

    def close(self) -> None:
        """Lets it end."""
        self.connection.close()
        self._process.join()

    def kill(self) -> None:
        """Ends it, whatever it does."""
        self.connection.close()
        self._process.kill()
        self._process.join()


def _serve(connection: Connection, version: dict[str, str]) -> None:
    """What a worker does: rows for tasks, until its pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one that began it hears the interrupt, too, and ends it
    parent = multiprocessing.parent_process()
    assert parent is not None
    end_with_parent(parent.join)
    from ema_model.campaign.rows import row_of

    with suppress(EOFError, OSError):
        connection.send(None)
        while True:
            task = connection.recv()
            try:
                answer: Any = row_of(task, version)
            except OtherVersion as error:
                answer = error
            connection.send(answer)


@contextmanager
def _environment() -> Iterator[None]:
    """The environment that a worker is begun with."""
    before = {name: os.environ.get(name) for name in ENVIRONMENT}
    os.environ.update(ENVIRONMENT)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


# --- any cluster that Dask runs on: `dask scheduler` somewhere, `dask worker` on each host ----------------------------
# Dask gives a task whose worker is killed to another; when its scheduler goes, what is there is kept, and the same
# command goes on once there is one again.

_CONNECT_S = 10.0
_WORKERS_S = 60.0  # to wait for the first one
_CLUSTER_AHEAD = 3  # tasks for each that is computed at a time, so that no worker waits for the next
_LOOK_S = 5.0  # between looks at how many workers there are


class Cluster:
    """The workers of Dask's scheduler at an address."""

    def __init__(self, address: str) -> None:
        """InputError where there is none, or Dask is not installed."""
        try:
            from distributed import Client
        except ImportError:
            raise InputError("--scheduler needs Dask: pip install 'emaviz[cluster]'") from None
        self._address = quoted(address, 100)
        for name in list(logging.root.manager.loggerDict):
            if name.startswith(("distributed", "tornado")):
                logging.getLogger(name).setLevel(logging.CRITICAL)  # they write of lost connections; so do we
        try:
            self._client: Any = Client(address, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError):
            raise InputError(
                f"--scheduler {self._address}: nobody answers there; begin one: `dask scheduler`, and name it"
            ) from None
        self._threads, self._looked = 0, 0.0

    @property
    def workers(self) -> int:
        """Tasks that it computes at a time, as of a few seconds ago."""
        if time.monotonic() - self._looked > _LOOK_S:
            self._looked = time.monotonic()
            with suppress(Exception):  # the scheduler is going: `outcomes` tells
                self._threads = sum(self._client.nthreads().values())
        return self._threads

    def outcomes(self, tasks: Sequence[Task], version: dict[str, str]) -> Iterator[list[Outcome]]:
        """See `Scheduler`."""
        try:
            self._check(version)
            yield from self._outcomes(tasks, version)
        finally:
            with suppress(Exception):
                self._client.close(timeout=2.0)

    def _check(self, version: dict[str, str]) -> None:
        """Raises InputError for workers that are not there, or compute otherwise."""
        try:
            self._client.wait_for_workers(1, timeout=_WORKERS_S)
        except TimeoutError:
            raise InputError(
                f"--scheduler {self._address}: has no workers; begin some: `dask worker {self._address} --nthreads 1`"
            ) from None

        from ema_model.campaign.dask_worker import Steady

        try:
            theirs = self._client.run(own_version)
            self._client.register_plugin(Steady())
        except Exception as error:
            raise InputError(
                f"--scheduler {self._address}: its workers cannot run emaviz ({quoted(error, 200)}); install it there"
            ) from None
        for worker, one in theirs.items():
            if other := differences(one, version):
                raise InputError(f"--scheduler {self._address}: {worker} differs from here: {other}; install the same")

    def _outcomes(self, tasks: Sequence[Task], version: dict[str, str]) -> Iterator[list[Outcome]]:
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        given: dict[str, tuple[Task, Any]] = {}
        rest = iter(tasks)
        left = len(tasks)
        while left:
            room = max(2, _CLUSTER_AHEAD * self.workers) - len(given)
            for _, task in zip(range(room), rest):  # in this order: it takes no task too many
                future = self._client.submit(row_of, task, version, key=f"emaviz-{task.name}")
                given[future.key] = task, future
                future.add_done_callback(done.put)
            found = []
            for future in self._finished(done):
                if future.key in given:
                    task, _ = given.pop(future.key)
                    found.append((task, self._answer(future)))
            left -= len(found)
            yield found

    def _finished(self, done: queue.SimpleQueue[Any]) -> Iterator[Any]:
        """Futures that have come to an end; InputError when the scheduler is gone."""
        with suppress(queue.Empty):
            yield done.get(timeout=_POLL_S)
            while True:
                yield done.get_nowait()
        if self._client.status != "running":
            raise self._gone()

    def _answer(self, future: Any) -> dict[str, Any] | Died:
        from distributed import KilledWorker

        if future.status not in ("finished", "error"):  # cancelled, lost: Dask gives up its tasks with its scheduler
            raise self._gone()
        try:
            return future.result(timeout=30.0)
        except KilledWorker:
            return Died("Died: Dask's workers ended while they computed it")
        except OtherVersion as error:
            raise InputError(f"--scheduler {self._address}: {error}; install the same there") from None
        except Exception as error:
            if isinstance(error, OSError) or self._client.status != "running" or future.status == "cancelled":
                raise self._gone() from None
            told = f"its workers cannot compute ({type(error).__name__}: {quoted(error, 200)}); see their logs"
            raise InputError(f"--scheduler {self._address}: {told}") from None

    def _gone(self) -> InputError:
        return InputError(
            f"--scheduler {self._address}: has gone; all rows so far are kept: begin it anew, and give the same command"
        )


def scheduler(address: str | None, workers: int | None) -> Scheduler:
    """Dask's at this address, or, without one, so many processes (all cores by default).

    InputError for a scheduler that is not there.
    """
    if address is None:
        return Processes(workers)

    return Cluster(address)


# --- a plan's run: what is there, what is missing, how far it is ------------------------------------------------------

Progress = Callable[["Status"], None]


@dataclass
class Status:
    """How far a campaign is."""

    total: int
    there: int  # rows that an earlier run had made
    computed: int = 0
    errors: int = 0
    workers: int = 0
    started_s: float = field(default_factory=time.monotonic)
    left_s: float | None = None  # None: nothing to tell it by yet

    @property
    def text(self) -> str:
        """One line of it."""
        left = "" if self.left_s is None else f", {duration(self.left_s)} left"
        failed = f", {self.errors} errors" if self.errors else ""
        workers = f"{self.workers} workers{left}" if self.workers else "no workers: waiting for some"
        return f"{self.there + self.computed} of {self.total} tasks{failed}, {workers}"


def run_plan(
    plan: Plan,
    folder: str | os.PathLike[str],
    scheduler: Scheduler,
    *,
    retry: bool = False,
    on_progress: Progress | None = None,
) -> Status:
    """Computes what the folder lacks, and writes its tables; each row is kept as it comes.

    However it is ended, the next run goes on from the rows that are there.  retry: what ended in an error is
    computed again.  on_progress: called with new rows, and twice a second meanwhile; what it raises ends the run.

    Raises InputError for a folder that is not this plan's, for workers that cannot be reached, and for a disk that
    takes no more; what is there is kept.
    """
    store = Store.writing(folder, header_of(plan.title, plan.about, plan.tasks), plan.text, plan.tasks)
    try:
        there = store.names(errors=not retry)
        missing = [task for task in plan.tasks if task.name not in there]
        status = Status(len(plan.tasks), len(plan.tasks) - len(missing))
        if missing:
            _compute(missing, store, scheduler, status, on_progress or (lambda status: None))
        store.write_tables()
        return status
    finally:
        store.close()


def estimate_s(plan: Plan, there: set[str], workers: int, known: dict[str, float]) -> float:
    """About how long the rest of a plan takes; known: seconds that a task of some groups took."""
    return sum(known.get(task.group, rough_s(task)) for task in plan.tasks if task.name not in there) / max(1, workers)


def rough_s(task: Task) -> float:
    """About how long a task takes on one core of a common machine."""
    import msgspec

    kind = KINDS[task.kind]
    return kind.seconds(msgspec.convert(task.settings, kind.settings))


def duration(seconds: float) -> str:
    """'4 h 10 min', '12 min', '40 s'."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def _compute(
    missing: Sequence[Task], store: Store, scheduler: Scheduler, status: Status, on_progress: Progress
) -> None:
    waiting = Counter(task.group for task in missing)
    rough = {task.group: rough_s(task) for task in missing}
    spent: Counter[str] = Counter()
    count: Counter[str] = Counter()
    for outcomes in scheduler.outcomes(missing, version()):
        status.workers = scheduler.workers
        for kind, rows in _by_kind(outcomes):
            store.append(kind, rows)
            for row in rows:
                status.computed += 1
                status.errors += row["error"] is not None
                waiting[row["group"]] -= 1
                if row.get("elapsed_s"):
                    spent[row["group"]] += row["elapsed_s"]
                    count[row["group"]] += 1
        if count:
            each = {group: spent[group] / count[group] if count[group] else rough[group] for group in waiting}
            status.left_s = sum(each[group] * n for group, n in waiting.items()) / max(1, scheduler.workers)
        on_progress(status)


def _by_kind(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, list[dict]]]:
    rows: dict[str, list[dict]] = {}
    for task, answer in outcomes:
        row = common(task) | {"error": str(answer)} if isinstance(answer, Died) else answer
        rows.setdefault(task.kind, []).append(row)
    yield from rows.items()
