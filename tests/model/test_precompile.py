"""What another process compiles ahead is found compiled here."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

HERE = """
import sys, time
from ema_model.actuator import load_actuator
from ema_model.simulation import pack
from ema_model.simulation.run import Run, simulate_monitor
from ema_model.stacks import find_stack

stack = find_stack("reduced", ["dead_time"])
pack.compile_ahead([(stack, "traces")])
[job] = pack._running
assert job.process.wait(120) == 0
simulate_monitor(Run(duration_s=0.01), load_actuator(), effects={"dead_time": {}}, circuit="reduced")
statistics = stack.monitor.traces.stats
assert statistics.cache_hits and not statistics.cache_misses, statistics
pack.compile_ahead([(stack, "traces")])
running = [job for job in pack._running if job.process.poll() is None]
assert not running, "what the cache holds is not compiled again"
"""


@pytest.mark.long
def test_a_kernel_compiled_ahead_is_not_compiled_here(tmp_path):
    found = subprocess.run(
        [sys.executable, "-c", HERE],
        env={**os.environ, "EMAVIZ_CACHE_DIR": str(tmp_path), "EMAVIZ_COMPILE_AHEAD": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert found.returncode == 0, found.stderr
