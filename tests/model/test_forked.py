"""A process forked from one that has used kernels gets an error at once, where it would hang or be aborted."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path

import pytest

from ema_model import stacks
from ema_model.kernel_cache import cache_folder

pytestmark = pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system does not fork processes"
)

BEGIN = """
import multiprocessing, os, sys, threading
from ema_model.actuator import load_actuator
from ema_model.simulation.run import Run, simulate_monitor, simulate_reference
from ema_model import stacks
actuator = load_actuator()
run = Run(duration_s=0.02)

def child(work):
    try:
        work()
    except RuntimeError as error:
        print("REFUSED", type(error).__name__, error, flush=True)
        os._exit(0)
    print("DONE", flush=True)
    os._exit(0)
"""
WORKS = {
    "parallel": "simulate_monitor(run, actuator)",
    "single": "simulate_reference(run, actuator)",
    "held": "stacks.exclusive(stack.monitor.traces)",
}
# The parent has run a kernel, and another of its threads is in one when it forks.
USED = """
stack = stacks.find_stack()
simulate_monitor(run, actuator)
held, done = threading.Event(), threading.Event()
thread = threading.Thread(target=stacks.exclusive, args=(lambda: (held.set(), done.wait()),))
thread.start()
held.wait()
"""
FORK = """
process = multiprocessing.get_context("fork").Process(target=child, args=(lambda: {work},))
process.start()
process.join()
"""
END = """
done.set()
thread.join()
simulate_monitor(run, actuator)
print("PARENT WORKS")
"""


def outcome(program: str, layer: str) -> str:
    env = {
        **os.environ,
        "PYTHONPATH": str(Path(stacks.__file__).parents[1]),
        "EMAVIZ_CACHE_DIR": str(cache_folder().parents[1]),
        "NUMBA_THREADING_LAYER": layer,
        "NUMBA_NUM_THREADS": "2",
    }
    # A group of its own, so that a child that hangs ends with it.
    with subprocess.Popen(
        [sys.executable, "-c", program],
        env=env,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    ) as process:
        try:
            out, err = process.communicate(timeout=120)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, 9)
            raise
    assert process.returncode == 0, err[-2000:]
    return out


@pytest.mark.parametrize("layer", ["workqueue", "omp"])
def test_kernels_are_refused_in_a_child_of_a_process_that_used_them(layer):
    if layer == "omp":
        pytest.importorskip("numba.np.ufunc.omppool", reason="no OpenMP here")
    out = outcome(BEGIN + USED + "".join(FORK.format(work=work) for work in WORKS.values()) + END, layer)
    lines = out.splitlines()
    assert lines[-1] == "PARENT WORKS" and len(lines) == 1 + len(WORKS)
    for line in lines[:-1]:
        assert line.startswith("REFUSED ForkedError") and 'get_context("spawn")' in line


def test_a_child_of_a_process_that_used_none_may_use_them():
    assert outcome(BEGIN + FORK.format(work=WORKS["parallel"]), "workqueue") == "DONE\n"
