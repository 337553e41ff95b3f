"""Honey Badger Algorithm: digging by smell along a cardioid, or following the honeyguide straight to the prey."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ema_model.identification.optimisers.base import Optimiser, Stages, check_range, clip_to_box

# Keeps the smell finite for the badger that stands on the prey (the authors' code adds eps before squaring).
_TINY = np.finfo(float).eps ** 2


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
        smell = rng.random(column) * source_strength / (4 * np.pi * (np.sum(d**2, axis=1, keepdims=True) + _TINY))

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
