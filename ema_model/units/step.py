"""How far a unit goes from where it was linearised, towards where all units together say that it is.

A model is only straight near there: a step is taken as far as its own recordings, simulated again, agree.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ema_model.units.block import WIDER, Linearised, Unit

Array = NDArray[np.float64]

_SHARES = (1.0, 0.5, 0.25, 0.1)  # of a step
_AS_GOOD = 2.0  # of χ², within which the longer step is taken


def step(unit: Unit, x: Array, starts: Array, part: Linearised, goals: Sequence[Array]) -> Array:
    """From x (parameters,) with the starts (starts,) of its linearisation towards one of several goals.

    χ² is that of the model with the difference to its twin as it is at x; the starts follow as they did there.
    """
    steps = [np.zeros_like(x), *(share * (goal - x) for goal in goals for share in _SHARES)]
    points = np.array([np.concatenate([(x + one) / WIDER, starts]) for one in steps])
    problem = unit.problem
    if part.twins is None:
        problem.reweighted(unit.floors)
    else:
        problem.reweighted(part.twins.floors(unit.floors), part.twins.added)
    residuals = problem.residuals(problem.clip(points))[:, : problem.values]
    slope = part.starts_slope
    curvature = slope.T @ slope + np.eye(slope.shape[1])
    pull = residuals @ slope + starts
    cost = np.sum(residuals**2, axis=1) - np.sum(pull * np.linalg.solve(curvature, pull.T).T, axis=1)
    good = [one for one, at in zip(steps, cost) if at <= cost.min() + _AS_GOOD]
    return x + max(good, key=lambda one: float(np.linalg.norm(one)))
