"""One descent of a fit: scipy's trust region, ended where nothing changes any more that counts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.problem import Problem

Array = NDArray[np.float64]

_LONGEST = 40  # evaluations
# What an evaluation may change of half χ² and mean nothing: stick and slip make it rough, and a trust region takes half
# a dozen steps into that roughness before it gives up.
_IDLE, _IDLE_SHARE = 0.5, 1e-4
_MOST_IDLE = 2  # evaluations, one after the other


@dataclass(frozen=True, eq=False)
class Descended:
    """Where a descent ended."""

    x: Array  # (unknowns,)
    cost: float  # half of χ², or of the loss that stands in for it
    ended: bool  # before its longest


class _Ended(Exception):
    pass


def descended(
    problem: Problem, start: Array, scale: float = 1.0, loss: str = "linear", tell: Callable[[], None] = lambda: None
) -> Descended:
    """Down from a start (unknowns,), inside the problem's bounds.

    loss, scale: "linear", or "soft_l1" in which errors beyond scale count as themselves instead of as their squares.
    tell is called before each evaluation and may raise to stop.
    """
    from scipy.optimize import least_squares  # takes a third of a second to import

    way = _Way(problem, scale, loss, tell)
    try:
        found = least_squares(
            way.residual,
            start,
            jac=way.jacobian,  # pyright: ignore[reportArgumentType]
            bounds=(problem.low, problem.high),
            max_nfev=_LONGEST,
            xtol=1e-4,
            ftol=5e-5,
            loss=loss,
            f_scale=scale,
            # The long Jacobian's singular values cost more than all else, but lsmr looks for its step in a plane.
            tr_solver="exact" if len(start) == 1 else "lsmr",
        )
    except _Ended:
        return Descended(way.x, way.cost, True)
    return Descended(found.x, float(found.cost), bool(found.status > 0))


class _Way:
    """What is known on the way: the lowest point, and the Jacobian of the last one, which comes with its residual."""

    def __init__(self, problem: Problem, scale: float, loss: str, tell: Callable[[], None]) -> None:
        self.x, self.cost = np.zeros(0), np.inf
        self._problem, self._scale, self._loss, self._tell = problem, scale, loss, tell
        self._at, self._jacobian = np.zeros(0), np.zeros((0, 0))
        self._idle = 0

    def residual(self, x: Array) -> Array:
        """(values + unknowns,).  Raises _Ended where the last evaluations changed nothing that counts."""
        self._tell()
        residual = self._simulated(x)
        cost = self._counted(residual)
        idle = abs(self.cost - cost) < _IDLE + _IDLE_SHARE * cost
        if cost < self.cost:
            self.x, self.cost = self._at, cost
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

    def _counted(self, residual: Array) -> float:
        if self._loss == "linear":
            return 0.5 * float(residual @ residual)
        return self._scale**2 * float(np.sum(np.sqrt(1.0 + (residual / self._scale) ** 2) - 1.0))
