"""What every optimiser shares: ask/tell in the unit box, the best so far, the count of evaluations."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from typing import ClassVar, TypeAlias

import numpy as np

# One iteration: yields candidates (n, D) stage by stage and is sent their fitness (n,).
Stages: TypeAlias = Generator[np.ndarray, np.ndarray, None]


def clip_to_box(x: np.ndarray) -> np.ndarray:
    """x with every coordinate clipped to [0, 1]."""
    return np.minimum(np.maximum(x, 0.0), 1.0)


class Optimiser(ABC):
    """Minimises f over [0, 1]^D by ask/tell.

        while not optimiser.done:
            optimiser.tell(f(optimiser.ask()))

    The first ask is the uniform initial population; after it, each iteration is one or more ask/tell pairs (stages).
    A subclass writes `_iteration`, a generator: an optimiser that runs cannot be pickled.

    Attributes: `population_x` (N, D) and `population_f` (N,), the current population (personal bests where the
    algorithm keeps those; +inf before the first tell); `best_x` (D,) and `best_f`, the best ever told;
    `iteration`, the completed iterations (0 once the initial population was told); `evaluations`.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    source: ClassVar[str]

    def __init__(self, dimension: int, population: int = 50, iterations: int = 150, seed: int = 0):
        for what, value, least in (
            ("dimension", dimension, 1),
            ("population", population, 2),
            ("iterations", iterations, 1),
        ):
            if value != int(value) or value < least:
                raise ValueError(f"{what} must be a whole number of at least {least}, got {value!r}")
        self.dimension = int(dimension)
        self.population = int(population)
        self.iterations = int(iterations)
        self._rng = np.random.default_rng(seed)
        self.population_x = self._rng.random((self.population, self.dimension))
        self.population_f = np.full(self.population, np.inf)
        self.best_x = self.population_x[0].copy()
        self.best_f = np.inf
        self.iteration = 0
        self.evaluations = 0
        self._candidates: np.ndarray | None = self.population_x
        self._asked = False
        self._stages: Stages | None = None  # None until the initial population was told

    @abstractmethod
    def _iteration(self, t: int) -> Stages:
        """Iteration t = 1…T: yield candidates inside the box, receive fitness (+inf for non-finite), then replace
        `population_x` and `population_f` by new arrays."""

    @property
    def done(self) -> bool:
        """Whether all iterations are completed."""
        return self.iteration >= self.iterations

    def ask(self) -> np.ndarray:
        """Candidates (n, D) to evaluate now, n varies; the same ones until they are told. ValueError when done."""
        if self.done:
            raise ValueError(f"ask after the last of {self.iterations} iterations")
        if self._candidates is None:
            self._stages = self._iteration(self.iteration + 1)
            self._candidates = next(self._stages)
        self._asked = True
        return self._candidates.copy()

    def tell(self, fitness: np.ndarray) -> None:
        """Fitness (n,) of the candidates last asked for, non-finite counts as +inf. ValueError when nothing was
        asked or the length is wrong."""
        if not self._asked or self._candidates is None:
            raise ValueError("tell without ask: no candidates are waiting for their fitness")
        x, f = self._candidates, np.asarray(fitness, dtype=float)
        if f.shape != (len(x),):
            raise ValueError(f"tell needs {len(x)} fitness values, one per candidate, got shape {f.shape}")
        f = np.where(np.isfinite(f), f, np.inf)
        self._asked = False
        self.evaluations += len(x)
        leader = int(np.argmin(f))
        if f[leader] < self.best_f:
            self.best_x, self.best_f = x[leader].copy(), float(f[leader])
        if self._stages is None:
            self.population_f, self._candidates = f, None
            return
        try:
            self._candidates = self._stages.send(f)
        except StopIteration:
            self._candidates = None
            self.iteration += 1

    def rescore(self, fitness: Callable[[np.ndarray], np.ndarray]) -> None:
        """Takes another fitness, (n, D) → (n,), from here on: of the population and the best, between iterations.

        ValueError within an iteration.
        """
        if self._candidates is not None:
            raise ValueError("an iteration is under way: candidates are waiting for their fitness")
        f = np.asarray(fitness(np.concatenate([self.population_x, self.best_x[None]])), dtype=float)
        f = np.where(np.isfinite(f), f, np.inf)
        self.evaluations += len(f)
        leader = int(np.argmin(f))
        self.population_f = f[:-1]
        self.best_x = (self.best_x if leader == len(f) - 1 else self.population_x[leader]).copy()
        self.best_f = float(f[leader])


def check_range(what: str, value: float, low: float, high: float = np.inf) -> float:
    """value as a float, ValueError unless low <= value <= high."""
    if not (np.isfinite(value) and low <= value <= high):
        bounds = f"at least {low:g}" if high == np.inf else f"in [{low:g}, {high:g}]"
        raise ValueError(f"{what} must be {bounds}, got {value!r}")
    return float(value)
