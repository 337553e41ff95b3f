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
