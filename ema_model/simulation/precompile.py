"""Kernels that will be needed soon, compiled by another process: numba compiles on one core only.

    python -m ema_model.simulation.precompile reduced+cascade+torsional_compliance …

compiles stacks into the cache, where `find_stack`'s kernels are found on their first call.
"""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ema_model.actuator import load_actuator
from ema_model.faults import HEALTHY
from ema_model.kernel_cache.folder import cache_folder
from ema_model.physics.rows import LANES
from ema_model.simulation.pack import initial_state, monitor_rows
from ema_model.stacks import Stack, exclusive, find_stack

_running: list[subprocess.Popen[bytes]] = []


def compile_ahead(stacks: Iterable[Stack]) -> None:
    """Begins to compile the `traces` kernels that the cache lacks; returns at once.  Effects are the catalogue's."""
    _running[:] = [process for process in _running if process.poll() is None]
    missing = ["+".join((one.circuit, one.controller, *one.effects)) for one in stacks if not _is_cached(one)]
    if not missing or (os.cpu_count() or 1) < 2:
        return
    package = str(Path(__file__).parents[2])
    paths = os.pathsep.join(filter(None, [package, os.environ.get("PYTHONPATH")]))
    _running.append(
        subprocess.Popen(
            [sys.executable, "-m", __name__, *missing],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": paths, "EMAVIZ_CACHE_DIR": str(cache_folder().parents[2])},
        )
    )


def _is_cached(stack: Stack) -> bool:
    return any(cache_folder().glob(f"{stack.monitor.__name__}.traces-*.nbc"))


def _compile(stack: Stack) -> None:
    actuator, samples = load_actuator(), np.zeros(1)
    effects = {name: {} for name in stack.effects}
    rows = monitor_rows(actuator, HEALTHY, stack, effects)
    state = initial_state(actuator, len(rows), stack=stack)
    result = np.empty((len(rows), 1, 4, LANES))
    exclusive(stack.monitor.traces, state, rows, samples, samples, samples, 1, 1, actuator.step_s, result)


@atexit.register
def _stop() -> None:
    for process in _running:
        process.kill()
        process.wait()


if __name__ == "__main__":
    for text in sys.argv[1:]:
        circuit, controller, *names = text.split("+")
        _compile(find_stack(circuit, names, controller))
