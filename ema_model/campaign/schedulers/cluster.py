"""Any cluster that Dask runs on: `dask scheduler` somewhere, `dask worker` on each host.

Dask gives a task whose worker is killed to another; when its scheduler goes, what is there is kept, and the same
command goes on once there is one again.
"""

from __future__ import annotations

import logging
import queue
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

from ema_model.campaign.execute import OtherVersion, execute_all
from ema_model.campaign.schedulers.scheduler import Died, Outcome
from ema_model.campaign.task import Task
from ema_model.campaign.version import differences
from ema_model.campaign.version import version as own_version
from ema_model.errors import InputError, quoted

_CONNECT_S = 10.0
_WORKERS_S = 60.0  # to wait for the first one
_AHEAD = 2  # parcels for each that is computed at a time, so that no worker waits for the next
# What a parcel of tasks shall take: one of Dask's own takes some hundredths of a second of scheduler and client, which
# on one machine are the workers' too.  What a worker that dies has done of a parcel is computed again.
_PARCEL_S, _LARGEST_PARCEL = 1.0, 8
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
        from ema_model.campaign.schedulers.dask_worker import Unprofiled

        try:
            theirs = self._client.run(own_version)
            self._client.register_plugin(Unprofiled())
        except Exception as error:
            raise InputError(
                f"--scheduler {self._address}: its workers cannot run emaviz ({quoted(error, 200)}); install it there"
            ) from None
        for worker, one in theirs.items():
            if other := differences(one, version):
                raise InputError(f"--scheduler {self._address}: {worker} differs from here: {other}; install the same")

    def _outcomes(self, tasks: Sequence[Task], version: dict[str, str]) -> Iterator[list[Outcome]]:
        done: queue.SimpleQueue[Any] = queue.SimpleQueue()
        given: dict[str, tuple[list[Task], Any]] = {}
        parcels: deque[list[Task]] = deque()  # to be given first: those of a parcel whose workers died, each alone
        rest, size, left = deque(tasks), 1, len(tasks)
        while left:
            for _ in range(max(2, _AHEAD * self.workers) - len(given)):
                fair = max(1, len(rest) // (2 * max(1, self.workers)))  # at the end no worker waits for another
                parcel = parcels.popleft() if parcels else [rest.popleft() for _ in range(min(size, fair, len(rest)))]
                if not parcel:
                    break
                future = self._client.submit(execute_all, parcel, version, key=f"emaviz-{parcel[0].name}-{len(parcel)}")
                given[future.key] = parcel, future
                future.add_done_callback(done.put)
            found: list[Outcome] = []
            for future in self._finished(done):
                if future.key not in given:
                    continue
                parcel, _ = given.pop(future.key)
                answer = self._answer(future)
                if not isinstance(answer, Died):
                    found += zip(parcel, answer)
                    took_s = max(1e-3, sum(row["elapsed_s"] for row in answer) / len(answer))
                    size = int(min(max(_PARCEL_S / took_s, 1), _LARGEST_PARCEL))
                elif len(parcel) == 1:
                    found.append((parcel[0], answer))
                else:
                    parcels += [[task] for task in parcel]
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

    def _answer(self, future: Any) -> list[dict[str, Any]] | Died:
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
