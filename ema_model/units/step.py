"""How far units go from where they were linearised, towards where all units together say that they are.

A model is only straight near there: a step is taken as far as the units' own recordings, simulated again, agree.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.units.block import WIDER, Linearised, Unit

Array = NDArray[np.float64]

_SHARES = (1.0, 0.5, 0.25, 0.1)  # of a step
_AS_GOOD = 2.0  # of χ², within which the longer step is taken
_FARTHEST, _GRID = 5.0, 41  # tolerances of one difference alone, and how many sizes of it are tried, twice


@dataclass(frozen=True, eq=False)
class At:
    """A unit and its linearisation, with the starts (starts,) that it was made with."""

    unit: Unit
    starts: Array
    part: Linearised
    freed: Sequence[int]  # of its candidates


def step(units: Sequence[At], x: Array, goals: Sequence[Array]) -> Array:
    """From x (parameters,) towards one of several goals, the same for all these units.

    χ² is that of the models with the difference to their twins as it was; the starts follow as they did there.
    """
    steps = [np.zeros_like(x), *(share * (goal - x) for goal in goals for share in _SHARES)]
    cost = np.sum([_cost(one, np.array([x + each for each in steps])) for one in units], axis=0)
    good = [one for one, at in zip(steps, cost) if at <= cost.min() + _AS_GOOD]
    return x + max(good, key=lambda one: float(np.linalg.norm(one)))


def simpler(one: At, x: Array, shared: Array, allowed: float) -> Array:
    """Where a unit differs from what all share (parameters,) in one parameter alone, or x, where no such point will do.

    One is as good as x if χ² is no more than `allowed` higher there.  What differs by much in one parameter may, from
    where the others are, seem to differ in several.
    """
    sizes = np.linspace(-_FARTHEST, _FARTHEST, _GRID)
    points = shared + (np.eye(len(x))[:, None, :] * sizes[None, :, None]).reshape(-1, len(x))
    best = points[int(np.argmin(_cost(one, points)))]
    place = int(np.argmax(np.abs(best - shared)))
    near = np.tile(best, (_GRID, 1))
    near[:, place] += np.linspace(-1.0, 1.0, _GRID) * (sizes[1] - sizes[0])
    cost = _cost(one, np.concatenate([x[None, :], near]))
    return near[int(np.argmin(cost[1:]))] if cost[1:].min() <= cost[0] + allowed else x


def _cost(one: At, points: Array) -> Array:
    """χ² at points (n, parameters), but for a constant: (n,)."""
    problem, part = one.unit.problem, one.part
    if part.twins is None:
        problem.reweighted(one.unit.floors)
    else:
        problem.reweighted(part.twins.floors(one.unit.floors), part.twins.added)
    whole = np.concatenate([points / WIDER, np.repeat(one.starts[None, :], len(points), axis=0)], axis=1)
    residuals = problem.residuals(problem.clip(whole))[:, : problem.values]
    slope = part.slope[:, part.nuisances(one.freed)]
    curvature = slope.T @ slope + np.eye(slope.shape[1])
    pull = residuals @ slope + np.concatenate([one.starts, np.zeros(len(one.freed))])
    return np.sum(residuals**2, axis=1) - np.sum(pull * np.linalg.solve(curvature, pull.T).T, axis=1)
