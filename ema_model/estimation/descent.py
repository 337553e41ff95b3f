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

    def jacobians_beside(self, x: Array, others: Array, *, in_whole_blocks: bool) -> tuple[Array, Array, Array]:
        """`jacobians`, and the residuals of others (l, count) that are simulated with them."""
        ...

    def has_room_for(self, others: int) -> bool:
        """Whether these fit in the block of lanes of one candidate's derivatives, and leave those as they are."""
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
    known: tuple[Array, Array] | None = None  # residuals and their derivatives where the next step begins
    _best: int = 0  # of the dampings, in the last step

    @classmethod
    def begin(cls, problem: Problem, x: Array, known: tuple[Array, Array] | None = None) -> Descent:
        """At these starts (n, unknowns); known: the problem's `jacobians` there, if they were asked for before."""
        given = np.atleast_2d(np.asarray(x, dtype=float))
        x = problem.clip(given)
        n = len(x)
        known = known if np.array_equal(x, given) else None
        return cls(problem, x, np.full(n, np.inf), np.ones(n), np.ones(n, dtype=bool), known=known)

    @property
    def done(self) -> bool:
        """Whether no start falls any further."""
        return not self.moving.any()

    def step(self) -> None:
        """One step of those that still move."""
        problem = self.problem
        chosen = np.flatnonzero(self.moving)
        if self.known is None:
            self.known = problem.jacobians(self.x[chosen], in_whole_blocks=True)
            self.evaluations += problem.points_in_whole_blocks(len(chosen))
        (residuals, slopes), self.known = self.known, None
        self.cost[chosen] = np.sum(residuals**2, axis=1)
        dampings = np.outer(self.damping[chosen], _DAMPINGS)
        trials = problem.clip(_newton(problem, self.x[chosen], residuals, slopes, dampings).reshape(dampings.size, -1))
        residuals_there, expected = self._tried(trials)
        costs = np.sum(residuals_there**2, axis=1).reshape(len(chosen), -1)
        self.evaluations += len(trials)
        trials = trials.reshape(len(chosen), len(_DAMPINGS), -1)
        best = np.argmin(costs, axis=1)
        stayed = np.zeros(len(chosen), dtype=bool)
        for place, i in enumerate(chosen):
            fall = self.cost[i] - costs[place, best[place]]
            if fall > 0.0:
                self.x[i], self.cost[i] = trials[place, best[place]], costs[place, best[place]]
                self.damping[i] = np.clip(self.damping[i] * 10.0 ** (2 * (best[place] - 1.5) / 3), 1e-6, 1e6)
                self.moving[i] = fall > _SMALL + _RELATIVE * self.cost[i]
            else:
                self.damping[i] *= 100.0
                self.moving[i] = self.damping[i] < 1e5
                stayed[place] = self.moving[i]
        self._best = int(best[-1])
        if expected is not None and not stayed.any() and self.moving.any() and best[0] == expected[0]:
            self.known = expected[1]
        if stayed.any() and stayed.sum() == self.moving.sum():  # all that go on stand where they stood
            self.known = residuals[stayed], slopes[stayed]

    def _tried(self, trials: Array) -> tuple[Array, tuple[int, tuple[Array, Array]] | None]:
        """Residuals of the trials; of one start, with the derivatives at the one that is expected to be best.

        The lanes that these fill are there anyway, and most often the next step needs them.
        """
        problem, at = self.problem, self._best
        if len(trials) != len(_DAMPINGS) or not problem.has_room_for(len(trials) - 1):
            return problem.residuals(trials), None
        others = np.delete(trials, at, axis=0)
        here, slopes, beside = problem.jacobians_beside(trials[at : at + 1], others, in_whole_blocks=True)
        return np.insert(beside, at, here[0], axis=0), (at, (here, slopes))

    def keep(self, rows: NDArray[np.intp]) -> None:
        """Goes on with these starts only."""
        self.known = None
        self.x, self.cost = self.x[rows], self.cost[rows]
        self.damping, self.moving = self.damping[rows], self.moving[rows]


def _newton(problem: Problem, x: Array, residuals: Array, slopes: Array, dampings: Array) -> Array:
    """The damped Gauss–Newton points of x (n, unknowns) for dampings (n, d), (n, d, unknowns).

    What stands at a bound and would leave it is held there.
    """
    turned = np.swapaxes(slopes, 1, 2)
    hessians = (turned @ slopes)[:, None]
    gradients = (turned @ residuals[:, :, None])[:, None, :, 0]
    diagonals = np.diagonal(hessians, axis1=2, axis2=3)
    most = diagonals.max(axis=2, initial=1e-12, keepdims=True)
    damped = 1e-2 * dampings[:, :, None] * np.maximum(diagonals, 1e-6 * most)
    each = np.eye(x.shape[1])
    systems = hessians + damped[..., None] * each
    low, high = (x <= problem.low)[:, None], (x >= problem.high)[:, None]
    free = np.ones(damped.shape, dtype=bool)
    moves = np.zeros(damped.shape)
    for _ in range(x.shape[1]):
        both = free[..., :, None] & free[..., None, :]
        wanted = np.where(free, -gradients, 0.0)
        moves = np.linalg.solve(np.where(both, systems, each), wanted[..., None])[..., 0]
        leaves = free & ((low & (moves < 0.0)) | (high & (moves > 0.0)))
        if not leaves.any():
            break
        free &= ~leaves
    return x[:, None] + moves
