"""Campaigns and clusters as processes of their own, to be killed."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pyarrow.parquet as pq

PROJECT = Path(__file__).parents[2]
COUNTING = Path(__file__).with_name("counting.py")


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(PROJECT), **more}


def begun(*arguments: object, **more: str) -> subprocess.Popen[str]:
    """`emaviz campaign …` in a process."""
    return subprocess.Popen(
        [sys.executable, "-m", "emaviz", "campaign", *map(str, arguments), "--quiet"],
        env=environment(**more),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell that runs the tests behind itself has interrupts ignored, and whoever ignores them passes that on.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def ended(process: subprocess.Popen[str], code: int = 0, timeout_s: float = 240.0) -> str:
    """What it has printed, once it has ended with this code."""
    out, err = process.communicate(timeout=timeout_s)
    assert process.returncode == code, out + err
    return out + err


def rows_of(folder: Path) -> int:
    """How many rows its parts hold; some twice while parts are joined."""
    rows = 0
    for part in (folder / "parts").glob("*.parquet"):
        with contextlib.suppress(FileNotFoundError):
            rows += pq.ParquetFile(part).metadata.num_rows
    return rows


def wait_for(condition: Callable[[], object], timeout_s: float = 240.0) -> None:
    until = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < until, "nothing has happened"
        time.sleep(0.05)


def children_of(pid: int) -> list[int]:
    """All processes that descend from one, but for multiprocessing's own trackers."""
    import psutil

    with contextlib.suppress(psutil.NoSuchProcess):
        every = psutil.Process(pid).children(recursive=True)
        return [one.pid for one in every if "resource_tracker" not in " ".join(one.cmdline())]
    return []


def kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class Cluster:
    """A Dask scheduler with some worker processes of one thread each."""

    def __init__(self, folder: Path, workers: int = 2) -> None:
        self.counted = folder / "begun.txt"
        self.counted.touch()
        self._folder, self._workers, self._port = folder, workers, free_port()
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._running: list[subprocess.Popen[bytes]] = []
        self.begin()

    def begin(self) -> None:
        self.scheduler = self._dask("scheduler", "--host", "127.0.0.1", "--port", self._port)
        workers = ("--nworkers", self._workers, "--nthreads", 1, "--preload", COUNTING)
        scratch = ("--local-directory", self._folder / "scratch")
        self.worker = self._dask("worker", self.address, *workers, *scratch, "--death-timeout", 30)

    def worker_processes(self) -> list[int]:
        """The processes that compute; Dask's nannies begin them anew."""
        import psutil

        found = []
        for pid in children_of(self.worker.pid):
            with contextlib.suppress(psutil.NoSuchProcess):
                if "spawn_main" in " ".join(psutil.Process(pid).cmdline()):
                    found.append(pid)
        return found

    def times_begun(self) -> list[str]:
        """The names of the tasks that any worker has begun, as often as it has."""
        return [line.split()[1] for line in self.counted.read_text().splitlines()]

    def end(self) -> None:
        for process in reversed(self._running):
            for pid in [*children_of(process.pid), process.pid]:
                with contextlib.suppress(ProcessLookupError):
                    kill(pid)
            process.wait()
        self._running.clear()

    def _dask(self, *arguments: object) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{arguments[0]}.log").open("ab")
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", *map(str, arguments), "--no-dashboard"],
            env=environment(EMAVIZ_COUNTING=str(self.counted)),
            stdout=log,
            stderr=log,
        )
        log.close()
        self._running.append(process)
        return process


@contextlib.contextmanager
def cluster(folder: Path, workers: int = 2) -> Iterator[Cluster]:
    one = Cluster(folder, workers)
    try:
        yield one
    finally:
        one.end()
