"""One identification: an optimiser against an objective, told as it goes, stopped when asked."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model import faults
from ema_model.errors import InputError
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


def steps(
    objective: Objective,
    algorithm: str = "hba",
    *,
    population: int = 50,
    iterations: int = 150,
    seed: int = 0,
    truth: ArrayLike | None = None,
    parameters_known: bool = False,
    **settings: float,
) -> Generator[Progress, bool | None, Identification]:
    """Fits k1…k8 to the objective's recordings, an iteration (about 5 ms) at a time.

    Yields where it stands after each iteration; a true value sent back stops it there.  Returns the answer.
    parameters_known: the actuator's own parameters are exact, as in a simulation of the same file, so that
    their tolerances do not widen the intervals.  settings: the algorithm's own.
    Raises InputError for an unknown algorithm or impossible settings.
    """
    try:
        optimiser = create(algorithm, dimension=8, population=population, iterations=iterations, seed=seed, **settings)
    except (ValueError, TypeError) as error:
        raise InputError(str(error)) from None
    compile_s = warm_up(objective)
    elapsed = 0.0
    rmse_history: list[float] = []
    k_history: list[Array] = []
    stopped = False
    while not (optimiser.done or stopped):
        started = time.perf_counter()
        iteration = optimiser.iteration if rmse_history else -1
        while optimiser.iteration == iteration or not optimiser.evaluations:
            optimiser.tell(objective(optimiser.ask()))
        elapsed += time.perf_counter() - started
        rmse_history.append(float(optimiser.best_f))
        k_history.append(optimiser.best_x.copy())
        stopped = bool(
            (
                yield Progress(
                    algorithm,
                    optimiser.iteration,
                    iterations,
                    float(optimiser.best_f),
                    optimiser.best_x.copy(),
                    optimiser.population_x.copy(),
                    optimiser.population_f.copy(),
                    optimiser.evaluations,
                    elapsed,
                )
            )
        )
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
        stopped=stopped and not optimiser.done,
        uncertainty=uncertainty(objective, k, parameters_known=parameters_known),
        truth=None if truth is None else np.asarray(truth, dtype=float),
    )


def identify(
    objective: Objective,
    algorithm: str = "hba",
    *,
    on_iteration: Callable[[Progress], bool | None] | None = None,
    **options: Any,
) -> Identification:
    """Runs `steps` to the end; on_iteration is told each iteration, and stops it by returning True."""
    running = steps(objective, algorithm, **options)
    answer: bool | None = None
    try:
        progress = next(running)
        while True:
            if on_iteration is not None:
                answer = on_iteration(progress)
            progress = running.send(answer)
    except StopIteration as finished:
        return finished.value


def warm_up(objective: Objective) -> float:
    """Compiles (or loads) the kernels that an identification needs; returns the time, s."""
    started = time.perf_counter()
    if not objective.stack.monitor.squared_errors.signatures:
        objective(faults.HEALTHY)
    if not objective.stack.monitor.traces.signatures:
        objective.currents(faults.HEALTHY)
    return time.perf_counter() - started
