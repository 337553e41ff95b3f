"""Times of the kernels and of an identification, as ratios from one run: python tests/benchmarks/speed.py

Run it on an idle machine; the best of several repeats is what the machine can do, the median what it did.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

import numba
import numpy as np

from ema_model import faults
from ema_model.actuator import load_actuator
from ema_model.identification.optimisers import OPTIMISERS
from ema_model.identification.run import identify
from ema_model.identification.search import Objective
from ema_model.physics.rows import CURRENT, LANES
from ema_model.simulation.pack import initial_state, monitor_rows
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run, simulate_reference
from ema_model.stacks import Stack

STACKS = (
    {},
    {"cogging_torque": {}},
    {"cogging_torque": {}, "stribeck_friction": {}},
)
START = """
import time; started = time.perf_counter()
import tempfile
from pathlib import Path
from emaviz.page.app import App
app = App("127.0.0.1", 0, Path(tempfile.mkdtemp()))
app.wait_for_first_picture(300.0)
print(f"FIRST {time.perf_counter() - started:.1f}")
app.close()
"""


def timed(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Median and best time, ms."""
    work()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - started))
    return float(np.median(times)), min(times)


def plain_loop(stack: Stack) -> Callable[..., float]:
    """One simulation at a time: the stack's own step in a loop over one lane."""
    advance = sys.modules[f"{stack.monitor.__package__}.monitor_step"].advance

    @numba.njit(nogil=True, error_model="numpy")
    def run(state, parameters, command, load, dt):
        s = state.copy()
        total = 0.0
        for step in range(len(command)):
            advance(s, parameters, 0, command[step], load[step], 1.0, False, dt)
            total += s[CURRENT * LANES] ** 2
        return total

    return run


def main() -> None:
    actuator, run = load_actuator(), Run()
    recording = simulated(run, actuator, faults.HEALTHY)
    k = np.random.default_rng(0).random((2 * LANES, 8))
    print(f"{len(k)} individuals, 0.5 s of the chirp, {numba.get_num_threads()} threads\n")
    print("| monitor model | ms per simulation, median (best) | one at a time, ms | ratio | compiled in, s |")
    print("|---|---|---|---|---|")
    for circuit in ("reduced", "thesis"):
        for effects in STACKS:
            objective = Objective([recording], actuator, effects=effects, circuit=circuit)
            started = time.perf_counter()
            objective(k)
            compiled = time.perf_counter() - started
            median, best = (t / len(k) for t in timed(lambda objective=objective: objective(k), 40))
            window, loop = objective.windows[0], plain_loop(objective.stack)
            rows = monitor_rows(actuator, k[:1], objective.stack, objective.effects)[0]
            state = initial_state(actuator, 1)[0]
            single = timed(
                lambda loop=loop, state=state, rows=rows, w=window: loop(state, rows, w.command, w.load, w.step_s), 9
            )[0]
            name = f"{circuit}, {len(effects)} effects"
            print(f"| {name} | {median:.3f} ({best:.3f}) | {single:.2f} | {single / median:.0f} × | {compiled:.1f} |")
    median, best = timed(lambda: simulate_reference(run, actuator), 15)
    print(f"\nreference model: {median:.1f} ms per 0.5 s, median ({best:.1f} best)\n")
    print("| identification 50 × 150 | s, median of 5 | best |")
    print("|---|---|---|")
    objective = Objective([recording], actuator)
    for algorithm in OPTIMISERS:
        times = [identify(objective, algorithm, seed=seed).elapsed_s for seed in range(5)]
        print(f"| {algorithm} | {np.median(times):.2f} | {min(times):.2f} |")
    print()
    with tempfile.TemporaryDirectory() as cache:
        for what in ("with an empty cache", "with the models compiled"):
            shown = subprocess.run(
                [sys.executable, "-c", START],
                env={**os.environ, "EMAVIZ_CACHE_DIR": cache},
                capture_output=True,
                text=True,
                check=True,
            )
            first = next(line for line in shown.stdout.splitlines() if line.startswith("FIRST")).split()[1]
            print(f"the app's first picture {what}: {first} s, imports included")


if __name__ == "__main__":
    main()
