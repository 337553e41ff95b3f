"""Other libraries' optimisers beside ours, on the same problems, starts and evaluations.

    pip install --no-deps cma mealpy
    python tests/benchmarks/peers.py [--seeds 3] [--noise 0.1] [--workers 2] [--out peers.csv]

Problems are the thesis's eleven (T 5.1 – 5.43): data of the three-phase reference model, RMSE of the filtered current
of the monitor model as fitness, 8 faults in the unit box, 50 × 151 evaluations.  A run's answer after n evaluations,
or t seconds, is the best so far by fitness; its error is the thesis's (T 5.2).  A library that asks for a whole
population at once is given it in one call, mealpy by its mode "swarm"; its PSO asks one by one.
mealpy wants numpy < 2 and runs with 2: hence --no-deps.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model import faults
from ema_model.actuator import load_actuator
from ema_model.campaign.thesis import CASES
from ema_model.identification.run import ROBUST, steps, warm_up
from ema_model.identification.search import Objective
from ema_model.recordings.measurement import Sensors
from ema_model.simulation.plant import simulated
from ema_model.simulation.run import Run

Array = NDArray[np.float64]

BUDGET = 50 * 151
EVALUATIONS = (100, 300, 500, 1000, 2000, 4000, BUDGET)
SECONDS = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0)


class Enough(Exception):
    """The budget is used up."""


class Counted:
    """The fitness of a population k (n, 8), which keeps the best so far and when it came."""

    def __init__(self, objective: Objective) -> None:
        self.objective = objective
        self.points: list[tuple[int, float, Array]] = []  # evaluations, seconds, the best k
        self._evaluations, self._best = 0, np.inf
        self._started = time.perf_counter()

    def __call__(self, k: Array) -> Array:
        k = np.atleast_2d(k)
        left = BUDGET - self._evaluations
        if left <= 0:
            raise Enough
        rmse = self.objective(k)
        self._evaluations += len(k)
        first = int(np.argmin(rmse[:left]))
        if rmse[first] < self._best:
            self._best = float(rmse[first])
            self.points.append((self._evaluations, time.perf_counter() - self._started, k[first].copy()))
        return rmse


def differential_evolution(fitness: Counted, seed: int) -> None:
    """scipy's, its own strategy, all individuals of a generation at once."""
    from scipy.optimize import differential_evolution as search

    begin = np.random.default_rng(seed).random((50, 8))
    search(
        lambda x: fitness(x.T), [(0.0, 1.0)] * 8, init=begin, maxiter=1000, rng=seed, vectorized=True,
        updating="deferred", polish=False, tol=0.0,
    )  # fmt: skip


def cma_es(fitness: Counted, seed: int) -> None:
    """pycma's, with bounds, restarted with twice the population where it has converged (IPOP)."""
    import cma

    random = np.random.default_rng(seed)
    population = 16
    while True:
        options = {"bounds": [0.0, 1.0], "seed": int(random.integers(1, 2**31)), "verbose": -9, "popsize": population}
        search = cma.CMAEvolutionStrategy(random.random(8), 0.3, options)
        while not search.stop():
            asked = search.ask()
            search.tell(asked, list(np.where(np.isfinite(told := fitness(np.array(asked))), told, 1e9)))
        population *= 2


def _mealpy(family: str, name: str) -> Callable[[Counted, int], None]:
    def run(fitness: Counted, seed: int) -> None:
        import mealpy
        from mealpy.utils.target import Target

        kind = getattr(getattr(mealpy, family), name)

        class AtOnce(kind):
            """Asks for a population in one call."""

            def update_target_for_population(self, pop: Any = None) -> Any:
                for agent, value in zip(pop, fitness(np.array([agent.solution for agent in pop]))):
                    agent.target = Target(float(value), self.problem.obj_weights)
                return pop

        problem = {
            "obj_func": lambda k: float(fitness(k)[0]),
            "bounds": mealpy.FloatVar(lb=(0.0,) * 8, ub=(1.0,) * 8),
            "minmax": "min",
            "log_to": None,
        }
        AtOnce(epoch=150, pop_size=50).solve(problem, mode="single" if family == "PSO" else "swarm", seed=seed)

    return run


PEERS: dict[str, Callable[[Counted, int], None]] = {
    "scipy DE": differential_evolution,
    "pycma CMA-ES": cma_es,
    "mealpy PSO": _mealpy("PSO", "OriginalPSO"),
    "mealpy GWO": _mealpy("GWO", "OriginalGWO"),
    "mealpy HBA": _mealpy("HBA", "OriginalHBA"),
    "mealpy SSA": _mealpy("SSA", "OriginalSSA"),
}
OURS = {"ours: robust": ROBUST, "ours: SSA": "ssa", "ours: HBA": "hba", "ours: DOA": "do"}


def one(case: str, noise_A: float, seed: int, who: str) -> list[tuple[int, float, float]]:
    """(evaluations, seconds, error in %) of one run, each time that its best became better."""
    actuator = load_actuator()
    truth = next(one.k for one in CASES if one.name == case)
    recorded = Sensors(noise_A).record(simulated(Run(), actuator, truth), 1000 + seed)
    objective = Objective([recorded], actuator)
    if who in OURS:
        running = steps(objective, OURS[who], seed=seed, parameters_known=True)
        points = []
        while True:
            try:
                at = next(running)
            except StopIteration as end:
                if OURS[who] == ROBUST:
                    points.append((end.value.evaluations, end.value.elapsed_s, end.value.k))
                break
            points.append((at.evaluations, at.elapsed_s, at.k))
    else:
        warm_up(objective)
        counted = Counted(objective)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                PEERS[who](counted, seed)
            except Enough:
                pass
        points = counted.points
    return [(evaluations, seconds, faults.error_percent(k, truth)) for evaluations, seconds, k in points]


def _row(job: tuple[str, float, int, str]) -> tuple[tuple[str, float, int, str], list[tuple[int, float, float]]]:
    return job, one(*job)


def at(points: list[tuple[int, float, float]], column: int, limit: float) -> float:
    """The error of the last point within the limit; NaN before the first."""
    within = [point[2] for point in points if point[column] <= limit]
    return within[-1] if within else float("nan")


def main() -> None:
    given = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    given.add_argument("--seeds", type=int, default=3)
    given.add_argument("--noise", type=float, default=0.1, help="rms of the current, A")
    given.add_argument("--workers", type=int, default=1)
    given.add_argument("--out", type=Path, help="each run's curve as CSV")
    chosen = given.parse_args()
    names = [*OURS, *PEERS]
    jobs = [(case.name, chosen.noise, seed, who) for seed in range(chosen.seeds) for case in CASES for who in names]
    rows: dict[str, list[list[tuple[int, float, float]]]] = {who: [] for who in names}
    with ProcessPoolExecutor(chosen.workers, mp_context=get_context("spawn")) as pool:
        for done, (job, points) in enumerate(pool.map(_row, jobs), 1):
            rows[job[3]].append(points)
            print(f"\r{done} of {len(jobs)}", end="", file=sys.stderr, flush=True)
            if chosen.out:
                with chosen.out.open("w" if done == 1 else "a", newline="") as file:
                    csv.writer(file).writerows((*job, *point) for point in points)
    print(file=sys.stderr)
    for title, column, limits in (("evaluations", 0, EVALUATIONS), ("seconds", 1, SECONDS)):
        print(f"\nErr %, median (mean) of {len(jobs) // len(names)} runs after … {title}\n")
        print("| | " + " | ".join(f"{limit:g}" for limit in limits) + " |\n|" + "---|" * (len(limits) + 1))
        for who, runs in rows.items():
            cells = []
            for limit in limits:
                errors = np.array([at(points, column, limit) for points in runs])
                known = errors[np.isfinite(errors)]
                cells.append("–" if len(known) < len(errors) else f"{np.median(known):.2f} ({np.mean(known):.2f})")
            print(f"| {who} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
