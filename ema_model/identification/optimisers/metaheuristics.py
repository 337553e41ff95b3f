"""Metaheuristics: what every optimiser shares (ask/tell in the unit box), and those of the thesis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator
from typing import ClassVar, TypeAlias

import numpy as np

# --- what every optimiser shares: ask/tell in the unit box, the best so far, the count of evaluations -----------------

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


# --- Sparrow Search Algorithm: producers look for food, scroungers follow them, scouts flee danger --------------------


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


# --- Honey Badger Algorithm: digging by smell along a cardioid, or following the honeyguide straight to the prey ------

# Keeps the smell finite for the badger that stands on the prey (the authors' code adds eps before squaring).
_NEAREST = np.finfo(float).eps ** 2


class HoneyBadger(Optimiser):
    """HBA, eqs. (2) smell intensity, (3) density factor, (4) digging, (6) honey; N evaluations an iteration.

    Settings: `beta`, the ability to get food; `density` C.

    Readings: alpha decays with t (some libraries freeze it); the prey moves only at the end of the iteration; the
    distance d = p - x in the moves is signed and per dimension, that in the smell is the Euclidean norm. The mode and
    the sign F are drawn per badger, the other random numbers per dimension. Digging multiplies the prey's position
    by the smell: candidates are thrown into the corners of the box, and prey that reached 0 or 1 tends to stay there.
    """

    name: ClassVar[str] = "hba"
    title: ClassVar[str] = "Honey Badger"
    source: ClassVar[str] = (
        "F. A. Hashim, E. H. Houssein, K. Hussain, M. S. Mabrouk, W. Al-Atabany, Honey Badger Algorithm: new "
        "metaheuristic algorithm for solving optimization problems, Mathematics and Computers in Simulation 192 "
        "(2022) 84-110, doi:10.1016/j.matcom.2021.08.013"
    )

    def __init__(
        self,
        dimension: int,
        population: int = 50,
        iterations: int = 150,
        seed: int = 0,
        *,
        beta: float = 6.0,
        density: float = 2.0,
    ):
        super().__init__(dimension, population, iterations, seed)
        self.beta = check_range("beta", beta, 0.0)
        self.density = check_range("density", density, 0.0)

    def density_factor(self, t: int) -> float:
        """alpha = C e^(-t/T), eq. (3)."""
        return self.density * float(np.exp(-t / self.iterations))

    def _iteration(self, t: int) -> Stages:
        rng, shape, column = self._rng, self.population_x.shape, (self.population, 1)
        x, prey = self.population_x, self.best_x

        d = prey - x
        source_strength = np.sum((x - np.roll(x, -1, axis=0)) ** 2, axis=1, keepdims=True)  # the last one's next: first
        smell = rng.random(column) * source_strength / (4 * np.pi * (np.sum(d**2, axis=1, keepdims=True) + _NEAREST))

        digs = rng.random(column) < 0.5
        sign = np.where(rng.random(column) < 0.5, 1.0, -1.0)
        r, r4, r5 = rng.random((3, *shape))  # r is r3 when digging, r7 when following
        cardioid = np.abs(np.cos(2 * np.pi * r4) * (1 - np.cos(2 * np.pi * r5)))
        approach = r * self.density_factor(t) * d
        step = np.where(digs, self.beta * smell * prey + approach * cardioid, approach)

        new = clip_to_box(prey + sign * step)
        f = yield new
        better = f < self.population_f
        self.population_x = np.where(better[:, None], new, x)
        self.population_f = np.where(better, f, self.population_f)


# --- Dandelion Optimizer: seeds rise with the wind, descend in Brownian motion and land by Lévy flight ----------------

_LEVY_EXPONENT = 1.5
_LEVY_SIGMA = 0.6966  # of Mantegna's method for the exponent 1.5
_CLEAR_DAY = 1.5  # the day is clear when a standard normal number is below this: 93 % of days
_TINY = np.finfo(float).tiny  # a normal number of exactly 0 must not divide


class Dandelion(Optimiser):
    """DO: rising, descending, landing, clipped to the box after each and evaluated once at the end: N an iteration.

    The population moves on without comparing; only the elite (`best_x`) is kept. alpha = r (1 - t/T)^2 scales all
    stages and is 0 in the last iteration, which thus evaluates the elite alone.

    Settings: `levy_scale` s. The paper says 0.01, the authors' code leaves it out, which is s = 1 and the default:
    with 0.01 identifications of the thesis's single faults ended 3-29 % off, with 1 below 1 %.

    Readings: the weather, alpha and k are drawn once an iteration (as in the authors' code), the wind angle per seed,
    the rest per dimension; ln Y of the paper is the *density* of the lognormal law at |N(0, 1)|. Every stage is
    proportional to coordinates or their differences, so that with a small s seeds crawl toward an optimum near 0.
    """

    name: ClassVar[str] = "do"
    title: ClassVar[str] = "Dandelion"
    source: ClassVar[str] = (
        "S. Zhao, T. Zhang, S. Ma, M. Chen, Dandelion Optimizer: A nature-inspired metaheuristic algorithm for "
        "engineering applications, Engineering Applications of Artificial Intelligence 114 (2022) 105075, "
        "doi:10.1016/j.engappai.2022.105075"
    )

    def __init__(
        self,
        dimension: int,
        population: int = 50,
        iterations: int = 150,
        seed: int = 0,
        *,
        levy_scale: float = 1.0,
    ):
        super().__init__(dimension, population, iterations, seed)
        self.levy_scale = check_range("levy_scale", levy_scale, 0.0)

    def largest_alpha(self, t: int) -> float:
        """Upper bound (1 - t/T)^2 of the random step scale alpha."""
        return (1.0 - t / self.iterations) ** 2

    def _iteration(self, t: int) -> Stages:
        alpha = self._rng.random() * self.largest_alpha(t)
        x = clip_to_box(self._rise(self.population_x, alpha, t))
        x = clip_to_box(self._descend(x, alpha))
        x = clip_to_box(self._land(x, alpha, t))
        self.population_f = yield x
        self.population_x = x

    def _rise(self, x: np.ndarray, alpha: float, t: int) -> np.ndarray:
        """Spiral toward random places on a clear day, shrink on a rainy one; x is (N, D), also below."""
        if self._rng.standard_normal() >= _CLEAR_DAY:
            q = 1.0 - ((t - 1) / max(self.iterations - 1, 1)) ** 2
            return x * (1.0 - self._rng.random() * q)
        angle = self._rng.uniform(-np.pi, np.pi, (len(x), 1))
        lift = np.exp(-2 * angle) * np.cos(angle) * np.sin(angle)  # v_x v_y
        y = np.maximum(np.abs(self._rng.standard_normal(x.shape)), _TINY)
        lognormal_density = np.exp(-0.5 * np.log(y) ** 2) / (y * np.sqrt(2 * np.pi))
        return x + alpha * lift * lognormal_density * (self._rng.random(x.shape) - x)

    def _descend(self, x: np.ndarray, alpha: float) -> np.ndarray:
        """Brownian motion about the mean position."""
        step = alpha * self._rng.standard_normal(x.shape)
        return x - step * (x.mean(axis=0) - step * x)

    def _land(self, x: np.ndarray, alpha: float, t: int) -> np.ndarray:
        """Lévy flight about the elite."""
        w, v = self._rng.standard_normal((2, *x.shape))
        levy = self.levy_scale * _LEVY_SIGMA * w / np.maximum(np.abs(v), _TINY) ** (1 / _LEVY_EXPONENT)
        return self.best_x + levy * alpha * (self.best_x - x * (2 * t / self.iterations))
