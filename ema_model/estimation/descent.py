"""Bounded least squares from many starts at once: Levenberg and Marquardt's steps, an active set at the bounds.

D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM 11 (1963) 431–441.
All starts' derivatives are one population of the kernel, and so are all steps with several dampings each.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DAMPINGS = (1e-4, 1e-2, 1.0, 30.0)  # of one step, times the start's own
_SMALL = 1e-3  # least fall of the cost, in units of χ², that is worth another step
_RELATIVE = 1e-5


class Problem(Protocol):
    """Least squares within bounds, of many candidates x (…, count) at once; their prior is among the residuals."""

    low: Array  # (count,)
    high: Array

    @property
    def count(self) -> int:
        """Unknowns."""
        ...

    def clip(self, x: Array) -> Array:
        """Candidates moved into the bounds."""
        ...

    def residuals(self, x: Array) -> Array:
        """(n, residuals) of candidates (n, count)."""
        ...

    def jacobians(self, x: Array, *, in_whole_blocks: bool) -> tuple[Array, Array]:
        """The same, and their derivatives (n, residuals, count), to one side where that spares a block of lanes."""
        ...

    def points_in_whole_blocks(self, n: int) -> int:
        """How many are simulated for those derivatives of n candidates."""
        ...


@dataclass(eq=False)
class Descent:
    """Where n starts stand; `step` moves each of them downhill."""

    problem: Problem
    x: Array  # (n, unknowns)
    cost: Array  # (n,), χ² with the prior
    damping: Array
    moving: NDArray[np.bool_]
    evaluations: int = 0

    @classmethod
    def begin(cls, problem: Problem, x: Array) -> Descent:
        """At these starts (n, unknowns)."""
        x = problem.clip(np.atleast_2d(np.asarray(x, dtype=float)))
        n = len(x)
        return cls(problem, x, np.full(n, np.inf), np.ones(n), np.ones(n, dtype=bool))

    @property
    def done(self) -> bool:
        """Whether no start falls any further."""
        return not self.moving.any()

    def step(self) -> None:
        """One step of those that still move."""
        problem = self.problem
        chosen = np.flatnonzero(self.moving)
        residuals, slopes = problem.jacobians(self.x[chosen], in_whole_blocks=True)
        self.evaluations += problem.points_in_whole_blocks(len(chosen))
        self.cost[chosen] = np.sum(residuals**2, axis=1)
        trials = np.concatenate(
            [
                problem.clip(np.array([_newton(problem, x, r, j, damping * d) for d in _DAMPINGS]))
                for x, r, j, damping in zip(self.x[chosen], residuals, slopes, self.damping[chosen])
            ]
        )
        costs = np.sum(problem.residuals(trials) ** 2, axis=1).reshape(len(chosen), -1)
        self.evaluations += len(trials)
        trials = trials.reshape(len(chosen), len(_DAMPINGS), -1)
        best = np.argmin(costs, axis=1)
        for place, i in enumerate(chosen):
            fall = self.cost[i] - costs[place, best[place]]
            if fall > 0.0:
                self.x[i], self.cost[i] = trials[place, best[place]], costs[place, best[place]]
                self.damping[i] = np.clip(self.damping[i] * 10.0 ** (2 * (best[place] - 1.5) / 3), 1e-6, 1e6)
                self.moving[i] = fall > _SMALL + _RELATIVE * self.cost[i]
            else:
                self.damping[i] *= 100.0
                self.moving[i] = self.damping[i] < 1e5

    def keep(self, rows: NDArray[np.intp]) -> None:
        """Goes on with these starts only."""
        self.x, self.cost = self.x[rows], self.cost[rows]
        self.damping, self.moving = self.damping[rows], self.moving[rows]


def _newton(problem: Problem, x: Array, residual: Array, slopes: Array, damping: float) -> Array:
    """The damped Gauss–Newton point, with what stands at a bound and would leave it held there."""
    hessian = slopes.T @ slopes
    gradient = slopes.T @ residual
    diagonal = np.diag(hessian)
    hessian = hessian + np.diag(1e-2 * damping * np.maximum(diagonal, 1e-6 * diagonal.max(initial=1e-12)))
    free = np.ones(len(x), dtype=bool)
    move = np.zeros(len(x))
    for _ in range(len(x)):
        move[:] = 0.0
        part = np.ix_(free, free)
        move[free] = -np.linalg.solve(hessian[part], gradient[free])
        leaves = free & (((x <= problem.low) & (move < 0.0)) | ((x >= problem.high) & (move > 0.0)))
        if not leaves.any():
            break
        free &= ~leaves
    return x + move
