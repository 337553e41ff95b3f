"""How far from the machine's limit the three long computations are: python tests/benchmarks/limit.py

Simulations × steps × operations of a step, beside what both cores do of products and sums on numbers at hand.
A step's operations (+ − × ÷ and comparisons of one lane) are counted by running it as plain Python with numbers that
count, in a process whose compiler is off; branches that a lane does not take are not counted, though vectors run them.
Lanes that stand empty in a block are the computation's loss, and so is all that is no simulation of the monitor model.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))  # a script finds its neighbours

COUNTED = "add radd sub rsub mul rmul truediv rtruediv lt gt le ge".split()
REPEATS = 3
Key = tuple[str, str, tuple[str, ...]]  # a stack's


def operations(key: Key) -> int:
    """Of a step of the monitor model with this stack, counted here: the compiler must be off."""
    from ema_model.actuator import load_actuator
    from ema_model.effects import CATALOGUE
    from ema_model.simulation.pack import initial_state, monitor_rows
    from ema_model.stacks import find_stack

    count = 0

    class Number(float):
        """Counts what is done with it."""

    def counting(name: str) -> Callable[..., object]:
        plain = getattr(float, name)

        def done(self: Number, other: float) -> object:
            nonlocal count
            try:
                result = plain(self, other)
            except ZeroDivisionError:  # of an effect that does nothing; compiled, it is an infinity
                result = np.inf
            count += result is not NotImplemented
            return Number(result) if type(result) is float else result

        return done

    for name in COUNTED:
        setattr(Number, f"__{name}__", counting(f"__{name}__"))
    circuit, controller, effects = key
    known = [one for one in effects if one in CATALOGUE]  # a curve that a discovery made for itself is left out
    actuator, stack = load_actuator(), find_stack(circuit, known, controller)
    doing_nothing = {name: CATALOGUE[name].neutral for name in known}
    state = [Number(one) for one in initial_state(actuator, 1, stack=stack)[0]]
    rows = [Number(one) for one in monitor_rows(actuator, np.full((1, 8), 0.1), stack, doing_nothing)[0]]
    step = sys.modules[f"{stack.monitor.__package__}.monitor_step"]
    for _ in range(10):
        count = 0
        step.advance(state, rows, 0, Number(3e-3), Number(0.0), Number(1.0), False, Number(1e-5))
    return count


def peak() -> float:
    """Products and sums a second, of all cores, on numbers that stay in registers: the best of some tries."""
    import numba

    @numba.njit(parallel=True, fastmath={"contract"})
    def work(out, rounds):
        for job in numba.prange(len(out)):
            lanes = np.arange(128.0)
            for _ in range(rounds):
                for i in range(128):
                    lanes[i] = lanes[i] * 0.999 + 0.1
            out[job] = lanes.sum()

    out, rounds = np.empty(2 * numba.get_num_threads()), 200_000
    work(out, 1)
    best = 0.0
    for _ in range(10):
        started = time.perf_counter()
        work(out, rounds)
        best = max(best, len(out) * rounds * 128 * 2 / (time.perf_counter() - started))
    return best


def watched(lane_steps: Counter[Key]) -> None:
    """Has every simulation of the monitor model add its lanes × steps, by stack."""
    from ema_model.identification.search import Objective
    from ema_model.models.closed_loop import ClosedLoop

    simulated, fitness = ClosedLoop._simulated, Objective.__call__

    def key(model: ClosedLoop) -> Key:
        return model.stack.circuit, model.stack.controller, model.stack.effects

    def one(self, window, actuator=None, k=None, *others):
        lane_steps[key(self)] += len(window.command) * (1 if k is None else len(np.atleast_2d(k)))
        return simulated(self, window, actuator, k, *others)

    def many(self, k):
        lane_steps[key(self)] += sum(len(window.command) for window in self.windows) * len(np.atleast_2d(k))
        return fitness(self, k)

    ClosedLoop._simulated, Objective.__call__ = one, many  # pyright: ignore[reportAttributeAccessIssue]


def main() -> None:
    import discovery

    import ema_model as em
    from ema_model.actuator import load_actuator
    from ema_model.faults import vector
    from ema_model.identification.run import identify
    from ema_model.identification.search import Objective
    from ema_model.recordings.measurement import Sensors
    from ema_model.simulation.plant import simulated
    from ema_model.simulation.run import Run

    with tempfile.TemporaryDirectory() as folder:
        discovery.record(Path(folder))
        fitted, held = ([em.read(Path(folder) / f"{name}.npz") for name in names] for names in ("012", ["held"]))
    actuator = load_actuator()
    chirp = Sensors(0.1).record(simulated(Run(), actuator, vector({"k1": 0.25})), 0)
    objective = Objective([chirp], actuator)
    works: dict[str, Callable[[], object]] = {
        "one robust identification": lambda: identify(objective, parameters_known=True),
        "50 × 150, Honey Badger": lambda: identify(objective, "hba", parameters_known=True),
        "discovery of one recording": lambda: em.discover(fitted[:1], holdout=held),
        "discovery of three": lambda: em.discover(fitted, holdout=held),
    }
    lane_steps: Counter[Key] = Counter()
    watched(lane_steps)
    most, counts = peak(), {}
    print(f"peak: {most / 1e9:.1f} · 10⁹ operations a second\n")
    print("| | lanes × steps | operations of one | at the peak | took | of the peak |\n|---|---|---|---|---|---|")
    for title, work in works.items():
        work()
        took = np.inf
        for _ in range(REPEATS):
            lane_steps.clear()
            started = time.perf_counter()
            work()
            took = min(took, time.perf_counter() - started)
        for key in set(lane_steps) - set(counts):
            command = [sys.executable, __file__, json.dumps(key)]
            off = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
            counts[key] = int(subprocess.run(command, env=off, capture_output=True, text=True, check=True).stdout)
        steps, done = sum(lane_steps.values()), sum(counts[key] * n for key, n in lane_steps.items())
        print(
            f"| {title} | {steps / 1e6:.0f} · 10⁶ | {done / steps:.0f} | {done / most:.3f} s | {took:.2f} s "
            f"| {100 * done / most / took:.0f} % |",
            flush=True,
        )


if __name__ == "__main__":
    if len(sys.argv) > 1:
        circuit, controller, effects = json.loads(sys.argv[1])
        print(operations((circuit, controller, tuple(effects))))
    else:
        main()
