"""Processes of this machine.

Each has a pipe of its own, so that it is known what a process that dies had; it alone is lost, and given to another.
They end with this process, however it ends.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from typing import Any

from ema_model.campaign.execute import ENVIRONMENT, OtherVersion
from ema_model.campaign.schedulers.scheduler import MOST_DEATHS, Died, Outcome
from ema_model.campaign.task import Task
from ema_model.child_processes import end_with_parent, on_lasting_thread
from ema_model.errors import InputError

_AHEAD = 2  # tasks that a process has: the one that it computes, and the next; the last ones go to whoever is free
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
                    while waiting and one.has_room(_AHEAD if len(waiting) > len(running) else 1):
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
                if found:
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
    from ema_model.campaign.execute import execute

    with suppress(EOFError, OSError):
        connection.send(None)
        while True:
            task = connection.recv()
            try:
                answer: Any = execute(task, version)
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
