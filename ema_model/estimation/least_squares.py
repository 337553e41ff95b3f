"""One descent of a fit, in two ways one after the other, each ended where nothing changes any more that counts.

scipy's trust region goes far along a valley that bends; from a start at a bound, or in a valley that is narrow and
rough, it goes nowhere.  There Marquardt's steps go on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.descent import Descent
from ema_model.estimation.descent import Problem as Bounded
from ema_model.estimation.problem import Problem

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
    problem: Problem, start: Array, soft: float | None = None, tell: Callable[[], None] = lambda: None
) -> Descended:
    """Down from a start (unknowns,), inside the problem's bounds.

    soft: beyond so many σ, errors count as themselves instead of as their squares.
    tell is called before each evaluation and may raise to stop.
    """
    taken = problem if soft is None else _Soft(problem, soft)
    return _by_marquardt(taken, *_by_trust_region(taken, start, tell), tell)


def _by_trust_region(problem: Bounded, start: Array, tell: Callable[[], None]) -> tuple[Array, tuple[Array, Array]]:
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


def _by_marquardt(problem: Bounded, start: Array, known: tuple[Array, Array], tell: Callable[[], None]) -> Descended:
    descent = Descent.begin(problem, start, known)
    before, idle, steps = np.inf, 0, 0
    while not descent.done and idle < _MOST_IDLE and steps < _LONGEST:
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

    def __init__(self, problem: Bounded, tell: Callable[[], None]) -> None:
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
