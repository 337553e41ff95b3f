"""How a row of a campaign is made: one task, computed in a worker's process, whatever goes wrong on the way."""

from __future__ import annotations

import os
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from ema_model import kernel_cache
from ema_model.files.written import FileLock

# One worker takes one core: threads of the kernels and of the linear algebra would wait for those of the others.
# Read when those libraries are imported, so a worker's process is begun with them.
ENVIRONMENT = {
    "NUMBA_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "EMAVIZ_COMPILE_AHEAD": "0",
}


class OtherVersion(RuntimeError):
    """A worker that computes with other sources or libraries than the campaign's."""


def row_of(task: Any, version: dict[str, str]) -> dict[str, Any]:
    """The task's row: its answer, or the error in one line, and how it came about.

    Raises OtherVersion where this process does not compute what the campaign asks for.
    """
    prepare()
    from ema_model.campaign.kinds import KINDS
    from ema_model.campaign.store import differences
    from ema_model.campaign.store import version as own_version

    if other := differences(own_version(), version):
        raise OtherVersion(f"{worker_name()} differs from the campaign: {other}")
    started = time.perf_counter()
    row = common(task)
    kind = KINDS[task.kind]
    try:
        row |= _answer(task, kind)
    except Exception as error:
        row["error"] = error_line(error)
    return row | {
        "elapsed_s": time.perf_counter() - started,
        "worker": worker_name(),
        "memory_MB": memory_MB(),
        "finished_s": time.time(),
    }


def common(task: Any) -> dict[str, Any]:
    """What a row says of its task."""
    from ema_model.faults import vector

    simulated, recorded = task.simulated, task.recorded
    return {
        "name": task.name,
        "group": task.group,
        "case": task.case,
        "seed": task.seed,
        "error": None,
        "k_true": vector(simulated.faults).tolist() if simulated else None,
        "hidden": list(simulated.effects) if simulated else [],
        "files": [one.path for one in recorded.files] if recorded else [],
        "task": task.as_json(),
    }


def error_line(error: BaseException) -> str:
    """What a row says of an error."""
    from ema_model.errors import quoted

    return f"{type(error).__name__}: {quoted(' '.join(str(error).split()), 500)}"


def prepare() -> None:
    """Makes this process, and this thread of it, compute as every worker does; cheap when it is done already."""
    if "numba" not in sys.modules:  # later it takes another number for a mistake
        os.environ.update(ENVIRONMENT)
    os.environ["EMAVIZ_COMPILE_AHEAD"] = "0"
    import numba

    from ema_model.simulation.pack import always_library

    numba.set_num_threads(1)  # of this thread; where numba was there before
    always_library()
    share_kernels()


def worker_name() -> str:
    """Host and process."""
    return f"{socket.gethostname()}:{os.getpid()}"


def memory_MB() -> float | None:
    """Of this process, resident; its greatest where the system does not tell the present one; None on Windows."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except OSError:
        pass
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


def _answer(task: Any, kind: Any) -> dict[str, Any]:
    import msgspec

    from ema_model.campaign.task import inputs_of

    return kind.run(inputs_of(task), msgspec.convert(task.settings, kind.settings), task.seed)


# --- kernels are compiled once a host: whoever comes first compiles, the others wait and load what it has kept --------

_LONGEST_S = 300.0  # to wait: a compilation takes seconds, and whoever holds the lock may have been stopped


class Turns:
    """Who may compile a kernel, by the file that it is kept in: one process of this host at a time."""

    def __init__(self) -> None:
        self._held: dict[Path, FileLock] = {}

    def begin(self, path: Path) -> None:
        """Returns when nobody else compiles this kernel."""
        if path in self._held:
            return
        with suppress(OSError):  # no lock to be had in that folder: each compiles for itself
            if (lock := FileLock.acquire(path.with_name(f"{path.name}.lock"), _LONGEST_S)) is not None:
                self._held[path] = lock

    def end(self, path: Path) -> None:
        """Lets the next one look for the kernel."""
        if (lock := self._held.pop(path, None)) is not None:
            lock.release()


def share_kernels() -> None:
    """Makes this process take turns with the others of its host."""
    if kernel_cache.turns is None:
        kernel_cache.turns = Turns()
