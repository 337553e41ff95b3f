"""Dandelion Optimizer: seeds rise with the wind, descend in Brownian motion and land by Lévy flight."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ema_model.identification.optimisers.base import Optimiser, Stages, check_range, clip_to_box

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
