"""One descent of a fit, ended where nothing changes any more that counts; large errors may count less."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.descent import Descent
from ema_model.estimation.problem import Problem

Array = NDArray[np.float64]

_LONGEST = 40  # steps
# What a step may change of χ² and mean nothing: stick and slip make it rough.
_IDLE, _IDLE_SHARE = 0.5, 5e-5
_MOST_IDLE = 2  # steps, one after the other


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
    tell is called before each step and may raise to stop.
    """
    descent = Descent.begin(problem if soft is None else _Soft(problem, soft), start)
    before, idle, steps = np.inf, 0, 0
    while not descent.done and idle < _MOST_IDLE and steps < _LONGEST:
        tell()
        descent.step()
        now = float(descent.cost[0])
        idle = idle + 1 if before - now < _IDLE + _IDLE_SHARE * now else 0
        before, steps = now, steps + 1
    return Descended(descent.x[0], 0.5 * before, steps < _LONGEST)


class _Soft:
    """A problem whose residuals r are √(2 s² (√(1 + (r/s)²) − 1)), with r's sign: r if small, √(2 s r) if large."""

    def __init__(self, problem: Problem, scale: float) -> None:
        self._problem, self._scale = problem, scale
        self.low, self.high, self.count = problem.low, problem.high, problem.count
        self.clip, self.points_in_whole_blocks = problem.clip, problem.points_in_whole_blocks

    def residuals(self, x: Array) -> Array:
        return self._softened(self._problem.residuals(x))[0]

    def jacobians(self, x: Array, *, in_whole_blocks: bool) -> tuple[Array, Array]:
        residuals, slopes = self._problem.jacobians(x, in_whole_blocks=in_whole_blocks)
        softened, share = self._softened(residuals)
        return softened, slopes * share[:, :, None]

    def _softened(self, residuals: Array) -> tuple[Array, Array]:
        """And their derivative by the residuals."""
        root = np.sqrt(1.0 + (residuals / self._scale) ** 2)
        softened = residuals * np.sqrt(2.0 / (1.0 + root))
        return softened, np.sqrt(0.5 * (1.0 + root)) / root
