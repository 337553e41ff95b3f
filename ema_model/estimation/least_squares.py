"""Least squares in lanes: steps, descent, the answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.problem import Problem

# --- one descent of a fit, in two ways one after the other ------------------------------------------------------------
# One descent of a fit, in two ways one after the other, each ended where nothing changes any more that counts.
#
# scipy's trust region goes far along a valley that bends; from a start at a bound, or in a valley that is narrow and
# rough, it goes nowhere. There Marquardt's steps go on.

Array = NDArray[np.float64]

_LONGEST = 40  # evaluations, or steps, of each way
# What one may change of half χ² and mean nothing: stick and slip make it rough, and a trust region takes half a dozen
# steps into that roughness before it gives up.
_IDLE, _IDLE_SHARE = 0.5, 1e-4
_MOST_IDLE = 2  # one after the other


@dataclass(frozen=True, eq=False)
class Descended:
    """Where a descent ended."""

    x: Array  # (unknowns,)
    cost: float  # half of χ², or of the loss that stands in for it
    ended: bool  # before its longest


def descended(
    problem: Problem,
    start: Array,
    soft: float | None = None,
    tell: Callable[[], None] = lambda: None,
    *,
    near: bool = False,
) -> Descended:
    """Down from a start (unknowns,), inside the problem's bounds.

    soft: beyond so many σ, errors count as themselves instead of as their squares.
    tell is called before each evaluation and may raise to stop.
    near: the start is near the end: Marquardt's steps alone, up to the first that changes nothing that counts.
    """
    taken = problem if soft is None else _Soft(problem, soft)
    if near:
        return _by_marquardt(taken, start, None, tell, most_idle=1)
    return _by_marquardt(taken, *_by_trust_region(taken, start, tell), tell)


def _by_trust_region(
    problem: BoundedProblem, start: Array, tell: Callable[[], None]
) -> tuple[Array, tuple[Array, Array]]:
    """The lowest point that was seen, and the problem's `jacobians` there."""
    from scipy.optimize import least_squares  # takes a third of a second to import

    way = _Way(problem, tell)
    try:
        least_squares(
            way.residual,
            np.clip(start, 0.98 * problem.low, 0.98 * problem.high),
            jac=way.jacobian,  # pyright: ignore[reportArgumentType]
            bounds=(problem.low, problem.high),
            max_nfev=_LONGEST,
            xtol=1e-4,
            ftol=5e-5,
            # The long Jacobian's singular values cost more than all else, but lsmr looks for its step in a plane.
            tr_solver="exact" if len(start) == 1 else "lsmr",
        )
    except _Ended:
        pass
    return way.x, way.lowest


def _by_marquardt(
    problem: BoundedProblem,
    start: Array,
    known: tuple[Array, Array] | None,
    tell: Callable[[], None],
    most_idle: int = _MOST_IDLE,
) -> Descended:
    descent = Descent.begin(problem, start, known)
    before, idle, steps = np.inf, 0, 0
    while not descent.done and idle < most_idle and steps < _LONGEST:
        tell()
        descent.step()
        now = 0.5 * float(descent.cost[0])
        idle = idle + 1 if before - now < _IDLE + _IDLE_SHARE * now else 0
        before, steps = now, steps + 1
    return Descended(descent.x[0], before, steps < _LONGEST)


class _Ended(Exception):
    pass


class _Way:
    """What is known on the way: the lowest point, and the Jacobian of the last one, which comes with its residual."""

    def __init__(self, problem: BoundedProblem, tell: Callable[[], None]) -> None:
        self.x, self._cost = np.zeros(0), np.inf
        self._problem, self._tell = problem, tell
        self._at, self._jacobian = np.zeros(0), np.zeros((0, 0))
        self.lowest = np.zeros((1, 0)), np.zeros((1, 0, 0))
        self._idle = 0

    def residual(self, x: Array) -> Array:
        """(values + unknowns,).  Raises _Ended where the last evaluations changed nothing that counts."""
        self._tell()
        residual = self._simulated(x)
        cost = 0.5 * float(residual @ residual)
        idle = abs(self._cost - cost) < _IDLE + _IDLE_SHARE * cost
        if cost < self._cost:
            self.x, self._cost, self.lowest = self._at, cost, (residual[None], self._jacobian[None])
        self._idle = self._idle + 1 if idle else 0
        if self._idle == _MOST_IDLE:
            raise _Ended
        return residual

    def jacobian(self, x: Array) -> Array:
        """(values + unknowns, unknowns)."""
        if not np.array_equal(x, self._at):
            self._simulated(x)
        return self._jacobian

    def _simulated(self, x: Array) -> Array:
        residuals, jacobians = self._problem.jacobians(x[None, :], in_whole_blocks=True)
        self._at, self._jacobian = x.copy(), jacobians[0]
        return residuals[0]


class _Soft:
    """A problem whose residuals r are √(2 s² (√(1 + (r/s)²) − 1)), with r's sign: r if small, √(2 s r) if large."""

    def __init__(self, problem: Problem, scale: float) -> None:
        self._problem, self._scale = problem, scale
        self.low, self.high, self.count = problem.low, problem.high, problem.count
        self.clip, self.points_in_whole_blocks = problem.clip, problem.points_in_whole_blocks
        self.has_room_for = problem.has_room_for

    def residuals(self, x: Array) -> Array:
        return self._softened(self._problem.residuals(x))[0]

    def jacobians(self, x: Array, *, in_whole_blocks: bool) -> tuple[Array, Array]:
        residuals, slopes = self._problem.jacobians(x, in_whole_blocks=in_whole_blocks)
        softened, share = self._softened(residuals)
        return softened, slopes * share[:, :, None]

    def jacobians_beside(self, x: Array, others: Array, *, in_whole_blocks: bool) -> tuple[Array, Array, Array]:
        residuals, slopes, beside = self._problem.jacobians_beside(x, others, in_whole_blocks=in_whole_blocks)
        softened, share = self._softened(residuals)
        return softened, slopes * share[:, :, None], self._softened(beside)[0]

    def _softened(self, residuals: Array) -> tuple[Array, Array]:
        """And their derivative by the residuals."""
        root = np.sqrt(1.0 + (residuals / self._scale) ** 2)
        return residuals * np.sqrt(2.0 / (1.0 + root)), np.sqrt(0.5 * (1.0 + root)) / root


# --- bounded least squares from many starts at once -------------------------------------------------------------------
# Bounded least squares from many starts at once: Levenberg and Marquardt's steps, an active set at the bounds.
#
# D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM 11 (1963) 431–441. All
# starts' derivatives are one population of the kernel, and so are all steps with several dampings each.

_DAMPINGS = (1e-4, 1e-2, 1.0, 30.0)  # of one step, times the start's own
_SMALL = 1e-3  # least fall of the cost, in units of χ², that is worth another step
_RELATIVE = 1e-5


class BoundedProblem(Protocol):
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

    problem: BoundedProblem
    x: Array  # (n, unknowns)
    cost: Array  # (n,), χ² with the prior
    damping: Array
    moving: NDArray[np.bool_]
    evaluations: int = 0
    known: tuple[Array, Array] | None = None  # residuals and their derivatives where the next step begins
    _best: int = 0  # of the dampings, in the last step

    @classmethod
    def begin(cls, problem: BoundedProblem, x: Array, known: tuple[Array, Array] | None = None) -> Descent:
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


def _newton(problem: BoundedProblem, x: Array, residuals: Array, slopes: Array, dampings: Array) -> Array:
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
