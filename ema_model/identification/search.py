"""The global part of a robust identification: many niches descend together, and the fewer the better known.

A first draw covers the box evenly; the best of it, kept apart from each other, become niches that all go downhill
by least squares.  As they settle, niches in one basin are merged and the hopeless are left.  What is left is
the distinct basins, the deepest first.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.descent import Descent
from ema_model.estimation.problem import Problem
from ema_model.estimation.unknowns import K_SIGMA
from ema_model.faults import HEALTHY, NAMES

Array = NDArray[np.float64]

_DRAWN = 16  # of each niche
_APART = 0.25 / K_SIGMA  # least distance in x between two niches at the start
_SAME = 0.02 / K_SIGMA  # and at which two that went downhill are in one basin
_HALVE_EVERY = 3  # steps
_FEWEST = 4
_MOST_NUMBERS = 5e6  # of simulated values at once: long recordings have fewer niches


@dataclass(frozen=True, eq=False)
class Basins:
    """Where the niches are: x (n, unknowns) and their costs, χ², the best first."""

    x: Array
    cost: Array
    evaluations: int
    done: bool


def search(problem: Problem, niches: int, most_steps: int, seed: int) -> Generator[Basins, None, Basins]:
    """Yields after the first draw and after each step; returns the distinct basins of a problem of faults alone."""
    room = int(_MOST_NUMBERS / (problem.values * (2 * problem.count + 1)))
    niches = max(_FEWEST, min(niches, room))
    drawn = _drawn(problem, niches * _DRAWN, seed)
    costs = _costs(problem, drawn)
    chosen = _apart(problem, drawn, costs, niches)
    descent = Descent.begin(problem, drawn[chosen])
    descent.cost = costs[chosen]
    descent.evaluations = len(drawn)
    yield _basins(descent, False)
    for step in range(1, most_steps + 1):
        descent.step()
        descent.keep(_distinct(descent, step))
        finished = descent.done or step == most_steps
        yield _basins(descent, finished)
        if finished:
            break
    return _basins(descent, True)


def _drawn(problem: Problem, count: int, seed: int) -> Array:
    """Evenly spread faults, the eccentricity even over its angle; a healthy one first."""
    random = np.random.default_rng(seed)
    strata = random.permuted(np.tile(np.arange(count), (len(NAMES), 1)), axis=1).T  # a Latin hypercube
    k = (strata + random.random((count, len(NAMES)))) / count
    # Most actuators have few faults: of the second half of the draw each fault is there or not.
    half = k[count // 2 :]
    absent = random.random((len(half), 6)) < 0.6
    half[:, :6][absent] = 0.0
    k[0] = HEALTHY
    return problem.clip(problem.at(k))


def _costs(problem: Problem, x: Array) -> Array:
    rows = max(64, int(_MOST_NUMBERS / problem.values))
    return np.concatenate(
        [np.sum(problem.residuals(x[first : first + rows]) ** 2, axis=1) for first in range(0, len(x), rows)]
    )


def _apart(problem: Problem, x: Array, costs: Array, count: int) -> NDArray[np.intp]:
    """Rows of the best that are not close to each other; then the best of the others."""
    order = np.argsort(costs, kind="stable")
    kept: list[int] = []
    for i in order:
        if all(np.linalg.norm(x[i] - x[j]) > _APART for j in kept):
            kept.append(int(i))
            if len(kept) == count:
                return np.array(kept)
    others = [int(i) for i in order if i not in set(kept)]
    return np.array(kept + others[: count - len(kept)])


def _distinct(descent: Descent, step: int) -> NDArray[np.intp]:
    """Rows to go on with: one of each basin, and at times the better half of those."""
    order = np.argsort(descent.cost, kind="stable")
    kept: list[int] = []
    for i in order:
        if all(np.linalg.norm(descent.x[i] - descent.x[j]) > _SAME for j in kept):
            kept.append(int(i))
    if step % _HALVE_EVERY == 0:
        kept = kept[: max(_FEWEST, (len(kept) + 1) // 2)]
    return np.array(kept)


def _basins(descent: Descent, done: bool) -> Basins:
    order = np.argsort(descent.cost, kind="stable")
    return Basins(descent.x[order].copy(), descent.cost[order].copy(), descent.evaluations, done)
