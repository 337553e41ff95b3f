"""What the Monitor Model lacks at one answer: the difference to its three-phase twin, the Reference Model.

The difference changes slowly with k, so that MM(k) + [RM(k̂) − MM(k̂)] predicts the Reference Model near k̂, and a
fit of it does not carry the low-fidelity model's bias into k.  The position's lag changes faster (with shorted
phases, the winding's inductance, the bus voltage), so that half of its difference counts as not known.
Hysteresis chopping makes the Reference Model's ripple depend on the smallest change of k: the mean of several
twins, each with a slightly different k, is what is known of the difference, and their spread is what is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from ema_model.estimation.floor import CORRELATED_S, Floor
from ema_model.estimation.problem import Problem
from ema_model.estimation.unknowns import K_SIGMA
from ema_model.faults import NAMES

Array = NDArray[np.float64]
Errors = list[dict[str, Array]]  # of twins, by window and signal: (twins, blocks)

TWINS = 4
# σ of the twins' x about the answer.  In saturation the ripple repeats for the same k, but not for one that a fit may
# still move to: twins that are too close together would call it known.
_HAIR = 3e-3 / K_SIGMA
_SLACK = 0.5  # share of a lasting difference that is not trusted to stay when the fit moves
WHITE = frozenset({"current_A"})  # the ripple's spread: alternating in the current, lasting in the positions


@dataclass(frozen=True, eq=False)
class Twins:
    """What to add to the Monitor Model, by window, and what is then left unknown of it."""

    added: list[dict[str, Array]]  # by signal, (blocks,)
    spread: list[dict[str, Array]]  # by signal, (blocks,): 1 σ
    deviations: list[dict[str, Array]]  # by signal, (twins, blocks): of each twin from the mean of its round
    at: Array  # (unknowns,), where they stand
    count: int = TWINS  # whose mean is what is added

    def with_those_near(self, others: Sequence[Twins]) -> Twins:
        """The same with the mean of these and of others that stand as close as these do to each other."""
        near = [self, *(one for one in others if np.max(np.abs(one.at - self.at)) < _HAIR)]
        total = sum(one.count for one in near)
        added = [
            {name: sum(one.count / total * one.added[i][name] for one in near) for name in window}
            for i, window in enumerate(self.added)
        ]
        return replace(self, added=added, count=total)

    def floors(self, before: Sequence[Floor]) -> list[Floor]:
        """The floors of a fit with this added."""
        return [replace(one, model=spread, white=WHITE) for one, spread in zip(before, self.spread)]


def twins(
    problem: Problem, x: Array, seed: int, before: Twins | None = None, about: Array | None = None
) -> Twins | None:
    """The difference at x (unknowns,), its spread from earlier ones too; None if there is no twin, or it diverges.

    about: a root of the covariance of x (unknowns, unknowns) that the twins are drawn from, in place of a hair of each
    fault: what is known of the difference is then what holds wherever x may be.
    """
    return of_errors(problem, x, errors_near(problem, x[None, :], seed, about)[0], before)


def of_errors(problem: Problem, x: Array, errors: Errors | None, before: Twins | None = None) -> Twins | None:
    """What `twins` makes of the errors of twins at x, or of none."""
    if errors is None:
        return None
    added, spread, deviations = [], [], []
    for i, (window, error) in enumerate(zip(problem.model.windows, errors)):
        means = {name: one.mean(axis=0) for name, one in error.items()}
        own = {name: one - means[name] for name, one in error.items()}
        if before:  # the more twins, the better known is their spread
            own = {name: np.concatenate([before.deviations[i][name], one]) for name, one in own.items()}
        added.append(means)
        deviations.append(own)
        spread.append({name: _spread(one, means[name], name, window.block_s) for name, one in own.items()})
    return Twins(added, spread, deviations, x)


def errors_near(problem: Problem, points: Array, seed: int, about: Array | None = None) -> list[Errors | None]:
    """Reference less Monitor Model of the twins of each of a few points (n, unknowns), all simulated at once.

    None where they diverge, or there is no Reference Model.
    """
    if not problem.model.actuator.has_reference_model:
        return [None] * len(points)
    random = np.random.default_rng([seed, 2])
    near = np.repeat(points, TWINS, axis=0)
    if about is None:
        hairs = _HAIR * random.standard_normal((TWINS, len(NAMES)))
        near[:, : len(NAMES)] += np.tile(hairs, (len(points), 1))
    else:
        near += np.tile(random.standard_normal((TWINS, points.shape[1])) @ about.T, (len(points), 1))
    near = problem.clip(near)
    try:
        errors = [_errors(problem, near, i) for i in range(len(problem.model.windows))]
    except FloatingPointError:
        if len(points) == 1:
            return [None]
        return [errors_near(problem, one[None, :], seed, about)[0] for one in points]
    rows = [slice(first, first + TWINS) for first in range(0, len(near), TWINS)]
    return [[{name: one[part] for name, one in window.items()} for window in errors] for part in rows]


def _spread(deviations: Array, mean: Array, name: str, block_s: float) -> Array:
    """1 σ of what the twins' mean leaves open, (blocks,): smooth over the time in which it stays alike."""
    rounds = len(deviations) // TWINS
    square = (1.0 + 1.0 / TWINS) * np.sum(deviations**2, axis=0) / (rounds * (TWINS - 1))
    if name not in WHITE:
        square = square + (_SLACK * mean) ** 2
    width = max(3, round(CORRELATED_S / block_s) | 1)
    return np.sqrt(np.maximum(uniform_filter1d(square, width, mode="nearest"), 0.0))  # its running sum rounds


def _errors(problem: Problem, x: Array, place: int) -> dict[str, Array]:
    """Reference less Monitor Model for x (n, unknowns), both under a constant load and an even supply: (n, blocks)."""
    monitor = problem.simulate(x, place, even=True)
    twin = problem.logged(problem.model.twins(place, *problem.rig(x, place)), x, place)
    return {name: twin[name] - monitor[name] for name in problem.weights[place]}
