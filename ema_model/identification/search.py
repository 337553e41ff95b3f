"""The searches: what is minimised, landscape, runs of optimisers."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError, quoted
from ema_model.estimation.least_squares import Descent
from ema_model.estimation.problem import K_SIGMA, Problem
from ema_model.faults import HEALTHY, NAMES
from ema_model.identification.fit import Fitted
from ema_model.models.closed_loop import ClosedLoop
from ema_model.models.loop_window import BLOCK_S, LoopWindow
from ema_model.physics.rows import LANES
from ema_model.quantities import amount
from ema_model.recordings import Measurement
from ema_model.simulation.pack import initial_state, monitor_rows
from ema_model.simulation.plant import FITNESSES
from ema_model.simulation.run import traced
from ema_model.stacks import exclusive

# --- how far the Monitor Model is from recordings: the fitness that the optimisers minimise (T 5.1) -------------------

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ObjectiveParts:
    """Of which an objective is made: where a result is stored, they stand for it."""

    measurements: Sequence[Measurement]
    actuator: Actuator
    effects: Mapping[str, Mapping[str, float]]
    circuit: str
    fitness: str

    def made(self) -> Objective:
        """The objective, of which nothing is computed before it is asked for."""
        of: dict[str, Any] = {"effects": self.effects, "circuit": self.circuit, "fitness": self.fitness}
        return Objective(self.measurements, self.actuator, **of, at_once=False)


class Objective(ClosedLoop):
    """Root-mean-square error of I_3eq, A, for a population of k, over one recording or several.

    `filtered` compares means over 0.5 ms, which removes the chopping ripple that no low-fidelity model
    can follow; `raw` compares every sample, as the thesis does.  k counts from the healthy actuator, whatever faults
    its file knows of.
    """

    def __init__(
        self,
        measurements: Sequence[Measurement],
        actuator: Actuator,
        *,
        effects: Mapping[str, Mapping[str, float]] | None = None,
        circuit: str = "reduced",
        fitness: str = "filtered",
        at_once: bool = True,
    ) -> None:
        """at_once: as of `ClosedLoop`."""
        if fitness not in FITNESSES:
            raise InputError(f"no fitness {quoted(fitness)!r}; fitnesses are {', '.join(FITNESSES)}")
        super().__init__(
            measurements,
            replace(actuator, faults={}),
            effects=effects,
            circuit=circuit,
            own_kernels=True,
            block_s=BLOCK_S if fitness == "filtered" else 0.0,
            at_once=at_once,
        )
        for measurement in self.recorded:
            measurement.require("current_A")
        self.fitness = fitness

    def made_of(self) -> ObjectiveParts:
        """As in `Model`."""
        return ObjectiveParts(self.recorded, self.actuator, self.effects, self._circuit, self.fitness)

    @cached_property
    def target(self) -> Array:
        """What is fitted, A, (blocks,), the recordings one after another."""
        return np.concatenate([self._target(window) for window in self.windows])

    @property
    def blocks(self) -> int:
        """Number of fitted values."""
        return len(self.target)

    @cached_property
    def _groups(self) -> list[_Group]:
        return self._grouped()

    def at_longer_steps(self, most_s: float) -> Self:
        """As in `Model`."""
        longer = super().at_longer_steps(most_s)
        longer._groups = longer._grouped()
        return longer

    def __call__(self, k: ArrayLike) -> Array:
        """RMSE, A, of each individual: k (n, 8) → (n,); infinite where the model diverges."""
        k = np.atleast_2d(np.asarray(k, dtype=float))
        total = np.zeros(-(-len(k) // LANES) * LANES)
        for group in self._groups:
            actuator = self.actuator.varied(group.windows[0].values)
            rows = monitor_rows(actuator, k, self.stack, self.effects)
            states = np.stack([self._state(window, k, actuator) for window in group.windows])
            result = np.empty((len(group.windows), len(rows), LANES))
            exclusive(
                self.stack.monitor.squared_errors,
                states,
                rows,
                group.command,
                group.load,
                group.supply,
                group.first_step,
                group.target,
                np.ones_like(group.target),
                group.first_block,
                group.steps_per_block,
                group.step_s,
                result,
                jobs=len(states) * len(rows),
            )
            total += result.sum(axis=0).ravel()
        rmse = np.sqrt(total[: len(k)] / self.blocks)
        # comparisons take a NaN for "not larger": a lane can come back to finite numbers, but is no answer
        sound = np.isfinite(rmse) & np.isfinite(k).all(axis=1)
        return np.where(sound, rmse, np.inf)

    def currents(self, k: ArrayLike, actuator: Actuator | None = None) -> Array:
        """What `__call__` compares with `target`, A: k (n, 8) → (n, blocks), the recordings one after another.

        The parameters of `actuator` may be arrays (n,), one value for each individual.
        """
        k = np.atleast_2d(np.asarray(k, dtype=float))
        parts = []
        for window in self.windows:
            one = (actuator or self.actuator).varied(window.values)
            rows = monitor_rows(one, k, self.stack, self.effects)
            run = window.command, window.load, window.supply
            state = self._state(window, k, one)
            result = traced(self.stack, state, rows, run, window.steps_per_block, 1, window.step_s)
            parts.append(result[:, :, 0, :].transpose(0, 2, 1).reshape(len(rows) * LANES, -1)[: len(k)])
        return np.concatenate(parts, axis=1)

    def _grouped(self) -> list[_Group]:
        return [_Group(windows, [self._target(w) for w in windows]) for windows in _alike(self.windows)]

    def _target(self, window: LoopWindow) -> Array:
        """The window's equivalent current, A, (blocks,), the sensor's gain and bias taken off."""
        sensors = self.actuator.varied(window.values).sensors
        return (window.measured["current_A"] - sensors.current_bias_A) / sensors.current_gain

    def _state(self, window: LoopWindow, k: Array, actuator: Actuator) -> Array:
        return initial_state(
            actuator,
            -(-len(k) // LANES),
            window.user_rad,
            window.speed_rad_s,
            window.play_rad,
            self.stack,
            window.integral_Nm(actuator, k),
        )


def _alike(windows: Sequence[LoopWindow]) -> list[list[LoopWindow]]:
    """Windows grouped by their sampling and own values, so that one kernel call serves each group."""
    groups: dict[Any, list[LoopWindow]] = {}
    for window in windows:
        groups.setdefault(
            (window.steps_per_block, round(window.step_s, 12), *sorted(window.values.items())), []
        ).append(window)
    return list(groups.values())


class _Group:
    """Windows of one sampling and one actuator, laid one after another."""

    def __init__(self, windows: list[LoopWindow], targets: list[Array]) -> None:
        self.windows = windows
        self.steps_per_block = windows[0].steps_per_block
        self.step_s = windows[0].step_s
        self.command = np.concatenate([window.command for window in windows])
        self.load = np.concatenate([window.load for window in windows])
        self.supply = np.concatenate([window.supply for window in windows])
        self.target = np.concatenate(targets)
        self.first_step = np.cumsum([0] + [len(window.command) for window in windows[:-1]])
        self.first_block = np.cumsum([0] + [window.blocks for window in windows])


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
