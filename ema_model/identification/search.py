"""The searches: what is minimised, landscape, runs of optimisers."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.estimation.least_squares import Descent
from ema_model.estimation.problem import Problem
from ema_model.estimation.unknowns import K_SIGMA
from ema_model.faults import HEALTHY, NAMES
from ema_model.identification.fit import Fitted
from ema_model.quantities.numbers import amount

# --- where a logger took the current and the positions at other moments, said in words --------------------------------

_SAMPLES = 0.3  # from which on it is worth saying
_SIGMAS = 4.0  # of its own uncertainty


def logged_apart(found: Fitted, covariance: NDArray[np.float64]) -> tuple[str, ...]:
    """A sentence for each recording whose current surely comes before its positions, or after them.

    covariance: of the fit's x (unknowns, unknowns).
    """
    told = []
    for one, x, variance in zip(found.problem.unknowns, found.x, np.diag(covariance)):
        if one.kind == "lag" and abs(x) > max(_SAMPLES, _SIGMAS * np.sqrt(variance)):  # 1 σ of the prior is a sample
            name = found.problem.model.measurements[one.place].name
            when = f"{amount(abs(one.sigma * x), 's')} {'after' if x > 0.0 else 'before'}"
            told.append(f"The current of {name} is logged {when} its positions, which is allowed for.")
    return tuple(told)


# --- the cost over two k around an answer, the six others held there, and the ways from where searches ended ----------

Floats = NDArray[np.floating]
Cost = Callable[[Floats], Floats]  # k (n, 8) → (n,), A: of an answer its corrected error

POINTS = 41  # along each axis
_ROWS = 2  # simulated at once: about two iterations of a usual search
_WAY_POINTS = 33
_CLOSE = 0.04  # least half width of a close-up
_WIDER = 3.0  # a close-up is so many intervals wide
_RISE = 1.01  # of the error along a way, above which it leads over a ridge
_WORSE = 1.05  # than the answer, above which a search has ended elsewhere


@dataclass(frozen=True, eq=False)
class Landscape:
    """A slice; rows that are not simulated yet, and models that diverge, are NaN."""

    x: int  # number of the k across, 0 … 7
    y: int  # and upwards
    through: Floats  # (8,), what the others are held at
    across: Floats  # (POINTS,), values of k x
    upwards: Floats  # (POINTS,)
    error_A: Floats  # (upwards, across)
    rows: int  # done

    @property
    def share(self) -> float:
        """Of the rows that are done."""
        return self.rows / len(self.upwards)


@dataclass(frozen=True)
class Way:
    """From where a search ended straight to the answer."""

    error_A: float  # where it ended
    highest_A: float  # on the way
    answer_A: float  # at the answer

    @property
    def is_trap(self) -> bool:
        """A worse place, and a ridge before the answer."""
        return self.is_worse and self.highest_A > _RISE * self.error_A

    @property
    def is_worse(self) -> bool:
        """Than the answer."""
        return self.error_A > _WORSE * self.answer_A


def extent(through: Floats, k: int, interval90: Floats | None = None, close: bool = False) -> tuple[float, float]:
    """From and to along one k: all of 0 … 1, or close to the answer, a few of its 90 % intervals wide."""
    if not close:
        return 0.0, 1.0
    width = 0.0 if interval90 is None else float(np.ptp(interval90[k]))
    half = min(max(_CLOSE, _WIDER * width), 0.5)
    low = min(max(float(through[k]) - half, 0.0), 1.0 - 2.0 * half)
    return low, low + 2.0 * half


def slices(
    cost: Cost,
    through: Floats,
    x: int,
    y: int,
    across: tuple[float, float] = (0.0, 1.0),
    upwards: tuple[float, float] = (0.0, 1.0),
    points: int = POINTS,
) -> Generator[Landscape, None, None]:
    """The slice as it grows, a few rows of one population each time; on the compute thread.

    Raises InputError unless x and y are two different k of 0 … 7.
    """
    if x == y or not {x, y} <= set(range(8)):
        raise InputError("a landscape needs two different k; choose another for one axis")
    xs, ys = np.linspace(*across, points), np.linspace(*upwards, points)
    error = np.full((points, points), np.nan)
    for first in range(0, points, _ROWS):
        some = ys[first : first + _ROWS]
        k = np.tile(np.asarray(through, dtype=float), (len(some) * points, 1))
        k[:, x], k[:, y] = np.tile(xs, len(some)), np.repeat(some, points)
        found = cost(k).reshape(len(some), points)
        error[first : first + len(some)] = np.where(np.isfinite(found), found, np.nan)
        yield Landscape(x, y, np.array(through), xs, ys, error.copy(), first + len(some))


def ways(cost: Cost, ends: Mapping[str, Floats], answer: Floats) -> dict[str, Way]:
    """The straight ways from the searches' ends (8,) to the answer (8,), by the searches' names; k7 is an angle."""
    share = np.linspace(0.0, 1.0, _WAY_POINTS)[:, None]
    found = {}
    for name, end in ends.items():
        step = np.asarray(answer, dtype=float) - end
        step[6] -= np.round(step[6])
        k = end + share * step
        k[:, 6] %= 1.0
        k[0], k[-1] = end, answer
        error = cost(k)
        found[name] = Way(float(error[0]), float(np.max(error)), float(error[-1]))
    return found


# --- the global part of a robust identification: many niches descend together, and the fewer the better known ---------
# A first draw covers the box evenly; the best of it, kept apart from each other, become niches that all go downhill
# by least squares. As they settle, niches in one basin are merged and the hopeless are left. What is left is the
# distinct basins, the deepest first.

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
