"""One identification: an optimiser against an objective, told as it goes, stopped when asked."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model import faults
from ema_model.identification.intervals import Uncertainty, uncertainty
from ema_model.identification.objective import Objective
from ema_model.identification.optimisers import create

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Progress:
    """Where an identification stands after an iteration; iteration 0 is the first random population."""

    algorithm: str
    iteration: int
    iterations: int
    rmse: float  # A, the best so far
    k: Array  # (8,), of the best
    population: Array  # (n, 8)
    population_rmse: Array  # (n,), A
    evaluations: int
    elapsed_s: float


@dataclass(frozen=True)
class Identification:
    """The answer, and how it was found."""

    algorithm: str
    seed: int
    k: Array
    rmse: float  # A
    evaluations: int
    elapsed_s: float  # without compilation
    compile_s: float
    rmse_history: Array  # (iterations + 1,), A
    k_history: Array  # (iterations + 1, 8)
    stopped: bool  # by the user, before its last iteration
    uncertainty: Uncertainty
    truth: Array | None = None

    @property
    def error_percent(self) -> float | None:
        """Err % (T 5.2, literal), where the truth is known."""
        return None if self.truth is None else faults.error_percent(self.k, self.truth)


def identify(
    objective: Objective,
    algorithm: str = "hba",
    *,
    population: int = 50,
    iterations: int = 150,
    seed: int = 0,
    truth: ArrayLike | None = None,
    parameters_known: bool = False,
    on_iteration: Callable[[Progress], None] | None = None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Identification:
    """Fits k1…k8 to the objective's recordings.

    on_iteration is told every iteration, on the caller's thread; cancelled is asked before each batch of
    evaluations (about 5 ms).  parameters_known: the actuator's own parameters are exact, as in a simulation
    of the same file, so that their tolerances do not widen the intervals.
    Raises InputError for an unknown algorithm or impossible settings.
    """
    optimiser = create(algorithm, dimension=8, population=population, iterations=iterations, seed=seed)
    compile_s = warm_up(objective)
    started = time.perf_counter()
    rmse_history: list[float] = []
    k_history: list[Array] = []
    stopped = False
    while not optimiser.done:
        if cancelled() and rmse_history:
            stopped = True
            break
        optimiser.tell(objective(optimiser.ask()))
        if optimiser.iteration + 1 > len(rmse_history):
            rmse_history.append(float(optimiser.best_f))
            k_history.append(optimiser.best_x.copy())
            if on_iteration is not None:
                on_iteration(
                    Progress(
                        algorithm,
                        optimiser.iteration,
                        iterations,
                        float(optimiser.best_f),
                        optimiser.best_x.copy(),
                        optimiser.population_x.copy(),
                        optimiser.population_f.copy(),
                        optimiser.evaluations,
                        time.perf_counter() - started,
                    )
                )
    elapsed = time.perf_counter() - started
    k = optimiser.best_x.copy()
    return Identification(
        algorithm=algorithm,
        seed=seed,
        k=k,
        rmse=float(optimiser.best_f),
        evaluations=optimiser.evaluations,
        elapsed_s=elapsed,
        compile_s=compile_s,
        rmse_history=np.array(rmse_history),
        k_history=np.array(k_history),
        stopped=stopped,
        uncertainty=uncertainty(objective, k, parameters_known=parameters_known),
        truth=None if truth is None else np.asarray(truth, dtype=float),
    )


def warm_up(objective: Objective) -> float:
    """Compiles (or loads) the kernels that an identification needs; returns the time, s."""
    started = time.perf_counter()
    if not objective.stack.monitor.squared_errors.signatures:
        objective(faults.HEALTHY)
    if not objective.stack.monitor.traces.signatures:
        objective.currents(faults.HEALTHY)
    return time.perf_counter() - started
