"""Sparrow Search Algorithm: producers look for food, scroungers follow them, scouts flee danger."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from ema_model.identification.optimisers.base import Optimiser, Stages, check_range, clip_to_box


class SparrowSearch(Optimiser):
    """SSA, eqs. (3) producers, (4) scroungers, (5) scouts; `population_x` holds the personal bests, best first
    as ranked at the start of the last iteration.

    Settings: `safety_threshold` ST; `producer_share` of the population, the best ones; `scout_share`, drawn at random.

    Readings, where paper and published code leave a choice:
    - Two asks an iteration: the producers (x_P needs their fitness), then scroungers and scouts. A scout was moved
      before as producer or scrounger, so N + scouts evaluations; as in the authors' code its scout position replaces
      the moved one before the greedy update, even where the moved one was better (`best_x` does not lose it).
    - x_P is the best *position* after the producers moved (the others stand where they last moved to), not a
      personal best.
    - A scrounger's A+ L is one number per sparrow: it shifts all its coordinates equally.
    - The default of 30 % scouts gives the thesis's 65 evaluations an iteration; the paper uses 10-20 %.
    """

    name: ClassVar[str] = "ssa"
    title: ClassVar[str] = "Sparrow Search"
    source: ClassVar[str] = (
        "J. Xue, B. Shen, A novel swarm intelligence optimization approach: sparrow search algorithm, "
        "Systems Science & Control Engineering 8 (2020) 22-34, doi:10.1080/21642583.2019.1708830"
    )

    def __init__(
        self,
        dimension: int,
        population: int = 50,
        iterations: int = 150,
        seed: int = 0,
        *,
        safety_threshold: float = 0.8,
        producer_share: float = 0.2,
        scout_share: float = 0.3,
    ):
        super().__init__(dimension, population, iterations, seed)
        self.safety_threshold = check_range("safety_threshold", safety_threshold, 0.0, 1.0)
        wanted = round(check_range("producer_share", producer_share, 0.0, 1.0) * self.population)
        self.producers = min(max(wanted, 1), self.population - 1)  # there is always one to lead and one to follow
        self.scouts = round(check_range("scout_share", scout_share, 0.0, 1.0) * self.population)
        self._x, self._f = self.population_x, self.population_f  # where the sparrows stand, beside personal bests

    def rescore(self, fitness: Callable[[np.ndarray], np.ndarray]) -> None:
        super().rescore(fitness)
        self._f = fitness(self._x)
        self.evaluations += len(self._x)

    def _iteration(self, t: int) -> Stages:
        if t == 1:
            self._f = self.population_f
        rank = np.argsort(self.population_f, kind="stable")
        p, p_f = self.population_x[rank], self.population_f[rank]
        x, f = self._x[rank], self._f[rank]
        n = self.producers

        x[:n] = clip_to_box(self._produce(p[:n]))
        f[:n] = yield x[:n]

        x[n:] = clip_to_box(self._scrounge(p, x[np.argmin(f)]))
        alarmed = self._rng.choice(self.population, self.scouts, replace=False)
        scouted = clip_to_box(self._scout(p, p_f, alarmed))
        told = yield np.concatenate((x[n:], scouted))
        f[n:] = told[: self.population - n]
        x[alarmed], f[alarmed] = scouted, told[self.population - n :]

        better = f < p_f
        self.population_x = np.where(better[:, None], x, p)
        self.population_f = np.where(better, f, p_f)
        self._x, self._f = x, f

    def _produce(self, p: np.ndarray) -> np.ndarray:
        """Eq. (3): producers' new positions from their ranked personal bests p (producers, D)."""
        if self._rng.random() < self.safety_threshold:
            a = 1.0 - self._rng.random(len(p))  # (0, 1]: a divides
            i = np.arange(1, len(p) + 1)
            return p * np.exp(-i / (a * self.iterations))[:, None]
        return p + self._rng.standard_normal((len(p), 1))

    def _scrounge(self, p: np.ndarray, x_producer: np.ndarray) -> np.ndarray:
        """Eq. (4): scroungers' new positions (N - producers, D) from all ranked personal bests p (N, D)."""
        i = np.arange(self.producers + 1, self.population + 1)[:, None]
        own = p[self.producers :]
        q = self._rng.standard_normal(i.shape)
        signs = 2.0 * self._rng.integers(0, 2, own.shape) - 1.0
        beside_producer = x_producer + np.mean(signs * np.abs(own - x_producer), axis=1, keepdims=True)
        elsewhere = q * np.exp((p[-1] - own) / i**2)
        return np.where(i > self.population / 2, elsewhere, beside_producer)

    def _scout(self, p: np.ndarray, p_f: np.ndarray, alarmed: np.ndarray) -> np.ndarray:
        """Eq. (5): positions (scouts, D) of the alarmed sparrows (row numbers of the ranked p, p_f)."""
        own, own_f = p[alarmed], p_f[alarmed, None]
        beta = self._rng.standard_normal(own.shape)
        k = self._rng.uniform(-1.0, 1.0, own_f.shape)
        gap = np.full(own_f.shape, 1e-50)  # keeps the quotient finite when best and worst are equal
        np.subtract(own_f, p_f[-1], out=gap, where=own_f < p_f[-1])  # also skips inf - inf
        to_best = p[0] + beta * np.abs(own - p[0])
        return np.where(own_f > p_f[0], to_best, own + k * np.abs(own - p[-1]) / gap)
