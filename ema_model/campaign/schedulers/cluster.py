"""Any cluster that Dask runs on: `dask scheduler` somewhere, `dask worker` on each host.

Dask gives a task whose worker is killed to another; when its scheduler goes, what is there is kept, and the same
command goes on once there is one again.
"""

from __future__ import annotations

import logging
import queue
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

from ema_model.campaign.execute import OtherVersion, execute
from ema_model.campaign.schedulers.scheduler import Died, Outcome
from ema_model.campaign.task import Task
from ema_model.campaign.version import differences
from ema_model.campaign.version import version as own_version
from ema_model.errors import InputError, quoted

_CONNECT_S = 10.0
_WORKERS_S = 60.0  # to wait for the first one
_AHEAD = 3  # tasks for each that is computed at a time, so that no worker waits for the next
_LOOK_S = 5.0  # between looks at how many workers there are
_POLL_S = 0.5


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
        from ema_model.campaign.schedulers.dask_worker import Steady

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
            room = max(2, _AHEAD * self.workers) - len(given)
            for _, task in zip(range(room), rest):  # in this order: it takes no task too many
                future = self._client.submit(execute, task, version, key=f"emaviz-{task.name}")
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
