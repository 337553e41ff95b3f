"""From a k that a search found to the best fit: all that is not exactly known moves, the twin's bias is out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import uniform_filter1d

from ema_model.estimation.least_squares import Descent
from ema_model.estimation.noise import CORRELATED_S, Floor, floor
from ema_model.estimation.problem import (
    DIVERGED,
    K_SIGMA,
    TOGETHER,
    Problem,
    Unknown,
    lags_of,
    loads_of,
    starts_of,
    unknowns_of,
)
from ema_model.faults import HEALTHY, NAMES
from ema_model.models import ClosedLoop, Model
from ema_model.models.closed_loop import LOAD

# --- how far each base parameter of an actuator is from its file's value, as recordings say ---------------------------

Array = NDArray[np.float64]

_FAULTS = len(NAMES)  # the first of the unknowns
_SWEEPS = 30  # over the base parameters, at most
_SWEPT = 0.01  # of a spread, that a sweep changes when it is the last
_WORTH = 4.0  # logarithm of the likelihood that a spread must gain: there are many to choose from
_SEEN = 1e-6  # (σ of the noise)², by which a parameter's tolerance must change the signals


def spreads_of(problem: Problem, x: Array) -> Array:
    """How far each base parameter is from its file's value, in its tolerances, as the data say: (base parameters,).

    x: the best fit with the file's values.  The likelihood of the data with k and the base parameters integrated
    out, each of these with a prior of its own `spread` σ, at its maximum (automatic relevance determination: MacKay,
    Neural Computation 4, 1992; Tipping, JMLR 1, 2001).  A rig that is as its file says gets its k with hardly any
    cost of tolerances that it does not use, and one parameter that is off does not set the others free.
    """
    residuals, all_slopes = problem.jacobians(x[None, :])
    residual, slopes, base = residuals[0], all_slopes[0], problem.base
    free = ~base
    free[:_FAULTS] &= (x > problem.low + 1e-9)[:_FAULTS] & (x < problem.high - 1e-9)[:_FAULTS]
    q, _ = np.linalg.qr(slopes[:, free])
    columns = slopes[:, base].copy()
    columns[problem.values :] = 0.0  # their prior is what is asked for
    columns -= q @ (q.T @ columns)
    return most_likely_spreads(columns.T @ columns, columns.T @ residual)


def most_likely_spreads(inner: Array, shown: Array) -> Array:
    """The prior σ of each of n numbers, 0 to 1, at which data are likeliest: (n,), found one after another.

    0 where that hardly makes them likelier: of many numbers one gains a little by chance.

    inner (n, n): of their derivatives, over the noise; shown (n,): of these with what is left without them.
    Of one number alone the best is known: √(q² − s) / s (Tipping and Faul, AISTATS 2003, eq. 20).
    """
    spreads = np.zeros(len(shown))
    for _ in range(_SWEEPS):
        before = spreads.copy()
        for one in range(len(spreads)):
            spreads[one] = 0.0
            on = np.flatnonzero(spreads)
            scaled = np.eye(len(on)) + spreads[on, None] * inner[np.ix_(on, on)] * spreads[on]
            both = np.linalg.solve(scaled, spreads[on, None] * np.column_stack([inner[on, one], shown[on]]))
            across = inner[on, one] * spreads[on]
            s, q = np.array([inner[one, one], shown[one]]) - across @ both
            if q * q > s > _SEEN:
                spread = min(1.0, np.sqrt(q * q - s) / s)
                more = spread * spread * s
                if 0.5 * (q * q / s * more / (1.0 + more) - np.log1p(more)) > _WORTH:
                    spreads[one] = spread
        if np.max(np.abs(spreads - before)) < _SWEPT:
            break
    return spreads


# --- what the Monitor Model lacks at one answer: the difference to its three-phase twin, the Reference Model ----------
# The difference changes slowly with k, so that MM(k) + [RM(k̂) − MM(k̂)] predicts the Reference Model near k̂, and a
# fit of it does not carry the low-fidelity model's bias into k.  The position's lag changes faster (with shorted
# phases, the winding's inductance, the bus voltage), so that half of its difference counts as not known.
# Hysteresis chopping makes the Reference Model's ripple depend on the smallest change of k: the mean of several
# twins, each with a slightly different k, is what is known of the difference, and their spread is what is not.

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


# --- from a k that a search found to the best fit ---------------------------------------------------------------------
# Everything that is not exactly known moves, the twin's bias is out.

Tell = Callable[[str, float], None]
CURRENT = "current_A"


def _silent(text: str, share: float) -> None:
    pass


_ROUNDS = 6  # of twin and refit, at most
_STEPS = 25  # of a refit
_CLOSE = 40.0  # χ²: the search's weights are coarse, and basins this close may change their order
_CANDIDATES = 3
_RIVAL = 4.0  # χ², within which another basin may be the right one
FAULTS = len(NAMES)  # the first of an identification's unknowns
_SETTLED = 1e-3 / K_SIGMA  # of x's faults, between two rounds
LONGER_STEPS_S = 5e-5, 2e-5  # for a search, which need not be exact: what it finds is refined at the actuator's own
_LOOKS = 31  # beside the healthy one: together two blocks of lanes
_ALIKE = 0.5  # floors, by which these may change the signals


class Rough(NamedTuple):
    """What a search simulates in the plant's place."""

    plant: ClosedLoop
    evaluations: int  # that it took to choose it


@dataclass(frozen=True, eq=False)
class Setting:
    """What is to be fitted: recordings, weights, what is not exactly known."""

    plant: ClosedLoop
    floors: list[Floor]
    faults: list[Unknown]
    others: list[Unknown]  # whatever else about the rig is not exactly known

    def coarse(self, plant: ClosedLoop | None = None) -> Problem:
        """The faults alone, with the Monitor Model's own error in the weights: for the search."""
        return Problem(plant or self.plant, self.floors, self.faults)

    @cached_property
    def rough(self) -> Rough:
        """The plant at the longest steps that hardly change the signals at most of some random k."""
        exact = self.coarse()
        looks = np.concatenate([[HEALTHY], np.random.default_rng(0).random((_LOOKS, FAULTS))])
        x = exact.clip(exact.at(looks))
        shown = exact.residuals(x)
        for tried, longest_s in enumerate(LONGER_STEPS_S, 1):
            plant = self.plant.at_longer_steps(longest_s)
            other = self.coarse(plant).residuals(x)
            if np.sqrt(np.median(np.mean((other - shown) ** 2, axis=1))) < _ALIKE:
                return Rough(plant, (1 + tried) * len(x))
        return Rough(self.plant, (1 + len(LONGER_STEPS_S)) * len(x))

    def problem(self, *, with_base: bool, plant: ClosedLoop | None = None) -> Problem:
        """The faults and what is not exactly known, with the actuator's base parameters or without."""
        others = [one for one in self.others if with_base or not one.is_base]
        return Problem(plant or self.plant, self.floors, [*self.faults, *others])


@dataclass(frozen=True, eq=False)
class Fitted:
    """A best fit, and its surroundings."""

    problem: Problem
    x: Array  # (unknowns,)
    cost: float
    residual: Array  # (values + unknowns,), over σ
    slopes: Array  # (values + unknowns, unknowns)
    twins: Twins | None
    k: Array  # (8,)
    spreads: Array  # (base parameters,): how far the data want each from its file's value, 1 being its tolerance
    evaluations: int
    rivals: tuple[Fitted, ...] = ()  # other basins that fit within the floor as well


def setting(objective: ClosedLoop, *, parameters_known: bool) -> Setting:
    """For an objective's recordings; a load that is not recorded is unknown too, unless all parameters are known."""
    effects: dict[str, Mapping[str, float]] = dict(objective.effects)
    unrecorded = any("load_torque_Nm" not in m for m in objective.measurements)
    if unrecorded and not parameters_known and LOAD not in (*effects, *objective.actuator.effects):
        effects[LOAD] = {"torque_Nm": 0.0}
    plant, bare = (
        ClosedLoop(
            objective.recorded, objective.actuator, effects=given, circuit=objective.stack.circuit, own_kernels=True
        )
        for given in (effects, objective.effects)
    )
    # In a saturated step the ripple of block means is far above the samples' noise, of which it is no part: taken off
    # it would leave half of the sensors' noise, and intervals that miss the truth in six of nine draws.
    floors = [floor(bare, place, whole_noise=True) for place in range(len(bare.windows))]
    actuator = plant.actuator
    paths = [path for path in actuator.tolerances if path.startswith("effects.") or not parameters_known]
    starts = starts_of(plant, floors, worn=True, exact=parameters_known)
    lags = [] if parameters_known else lags_of(plant)
    others = [*unknowns_of(actuator, paths), *loads_of(plant), *lags, *starts]
    return Setting(plant, floors, unknowns_of(actuator, NAMES), others)


def refine_best(given: Setting, k: ArrayLike, seed: int = 0, tell: Tell = _silent) -> Fitted:
    """The best fit near any of k (n, 8), or near health: of those that the search cannot tell from its best.

    tell(text, share): what goes on, and how much of the work is done, 0 … 1.
    """
    candidates = np.concatenate([np.atleast_2d(np.asarray(k, dtype=float)), [HEALTHY]])
    coarse = given.coarse()
    costs = np.sum(coarse.residuals(coarse.at(candidates)) ** 2, axis=1)
    order = np.argsort(costs, kind="stable")
    close = order[costs[order] < costs[order[0]] + _CLOSE][:_CANDIDATES]

    def told(number: int) -> Tell:
        return lambda text, share: tell(f"{text}, start {number + 1} of {len(close)}", (number + share) / len(close))

    fits = sorted(
        (refine(given, candidates[i], seed, told(number)) for number, i in enumerate(close)), key=lambda one: one.cost
    )
    best = fits[0]
    within = max(best.cost, best.problem.values) + _RIVAL
    return replace(best, rivals=tuple(one for one in fits[1:] if one.cost < within))


def refine(given: Setting, k: ArrayLike, seed: int = 0, tell: Tell = _silent) -> Fitted:
    """The best fit near k (8,): refits with the twin's difference added, until the answer stays; tell: `refine_best`'s.

    The base parameters keep their file's values at first, and then move as far as the data want them to.
    """
    problem = given.problem(with_base=False)
    phases = 2 if any(one.is_base for one in given.others) else 1
    rough = given.problem(with_base=False, plant=given.rough.plant)  # the rounds to come go on from it exactly
    x, _, evaluations = _descend(rough, rough.at(k))
    x, found, more = _with_twins(given, problem, x, None, seed, lambda text, share: tell(text, share / phases))
    spreads = np.zeros(0)
    if any(one.is_base for one in given.others):
        full = given.problem(with_base=True)
        start = _at_file_values(full, x)
        known = [] if found is None else [replace(found, at=_at_file_values(full, found.at))]
        found = twins(full, start, seed + _ROUNDS, found)
        found = found and found.with_those_near(known)  # their ripple alone shall set no parameter free
        _reweight(full, given, found)
        problem, x = full, start
        spreads = spreads_of(problem, x)
        if spreads.any():
            problem.believe(spreads)
            x, _, again = _descend(problem, x)
            said = "with the parameters' tolerances"
            x, found, again2 = _with_twins(
                given,
                problem,
                x,
                found,
                seed + _ROUNDS + 1,
                lambda text, done: tell(f"{text}, {said}", 0.5 + 0.5 * done),
            )
            more += again + again2
            errors = errors_near(problem, np.array([x, start]), seed + 2 * _ROUNDS + 1)
            if not _better(problem, given, x, start, [of_errors(problem, at, e) for at, e in zip((x, start), errors)]):
                x, spreads = start, np.zeros_like(spreads)  # the twin does not follow where the Monitor Model led
            found = of_errors(problem, x, errors[0 if spreads.any() else 1], found)
            _reweight(problem, given, found)
            problem.believe(1.0)
    residuals, slopes = problem.jacobians(x[None, :])
    residual = residuals[0]
    return Fitted(
        problem, x, float(residual @ residual), residual, slopes[0], found, problem.k(x), spreads, evaluations + more
    )


def _at_file_values(full: Problem, x: Array) -> Array:
    """x of a problem without base parameters, in one with them."""
    whole = np.zeros(full.count)
    whole[~full.base] = x
    return whole


def _with_twins(
    given: Setting, problem: Problem, x: Array, found: Twins | None, seed: int, tell: Tell
) -> tuple[Array, Twins | None, int]:
    """Twin and refit in turn, back halfway where the Reference Model does not follow.

    When the answer stays it is refitted once more, with the twins of all rounds that stood there: the ripple of one
    round's twins moves it as much as that of the recording itself.  Where it never stays, the best round's is taken.
    """
    evaluations, least, best, kept = 0, np.inf, x, found
    rounds: list[Twins] = []
    for number in range(_ROUNDS):
        tell(f"model bias and refit, round {number + 1} of at most {_ROUNDS}", number / _ROUNDS)
        found = twins(problem, x, seed + number, found)
        if found is None:
            _reweight(problem, given, found)
            x, _, more = _descend(problem, x)
            return x, None, evaluations + more
        here = found.with_those_near(rounds)
        rounds.append(found)
        _reweight(problem, given, here)
        known = problem.jacobians(x[None, :], in_whole_blocks=True)
        evaluations += problem.points_in_whole_blocks(1)
        cost = float(known[0][0] @ known[0][0])
        moved = float(np.max(np.abs(x - best)[:FAULTS]))
        settled = number > 0 and moved < _SETTLED
        if cost < least or settled:
            least, best, kept = cost, x, here
            if number == _ROUNDS - 1:
                break
            x, _, more = _descend(problem, x, known)
            evaluations += more
            if settled:
                return x, here, evaluations
        else:
            x = 0.5 * (x + best)
    assert kept is not None and found is not None
    kept = replace(kept, deviations=found.deviations)  # of all rounds: the more, the better known is their spread
    _reweight(problem, given, kept)
    return best, kept, evaluations


@dataclass(frozen=True, eq=False)
class ErrorParts:
    """Of which a corrected error is made: where an answer is stored, they stand for it."""

    model: Model
    floors: Sequence[Floor]
    unknowns: Sequence[Unknown]
    signals: Mapping[str, float]
    faults: Array  # (8,), as the problem has those that do not move
    prior: Array
    added: Sequence[Mapping[str, Array]]
    x: Array
    least: float

    @classmethod
    def of(cls, problem: Problem, x: Array, least: float) -> ErrorParts:
        """Of a fit that ended at x."""
        own = problem.unknowns, problem.asked, problem.fixed_k, problem.prior, problem.added
        return cls(problem.model, problem.floors, *own, x, least)

    def made(self) -> CorrectedError:
        """The error, of which nothing is computed before it is asked for."""
        return CorrectedError(self)

    def problem(self) -> Problem:
        """The fit's."""
        made = Problem(self.model, self.floors, self.unknowns, self.signals, self.faults)
        made.prior = self.prior
        made.reweighted(self.floors, self.added)
        return made


class CorrectedError:
    """Rms of measured less model current with the model's own bias added, A: faults k (n, 8) → (n,).

    The bias, and all that moves beside k, are as one fit has them, so that any k may be compared by it; infinite where
    the model diverges.  What the plain rmse counts against an answer of the simplified model, this leaves out.
    """

    def __init__(self, parts: ErrorParts) -> None:
        self._x, self._given, self.least = parts.x, parts, parts.least  # at the fit itself

    @classmethod
    def of_fit(cls, found: Fitted) -> CorrectedError:
        """As a fit has it."""
        made = cls(ErrorParts.of(found.problem, found.x, math.nan))
        vars(made)["_problem"] = found.problem  # as the cached property does
        made.least = float(made._of(found.residual[None, :])[0])
        return made

    def made_of(self) -> ErrorParts:
        """As `ema_model.result` stores it."""
        return ErrorParts.of(self._problem, self._x, self.least) if "_problem" in vars(self) else self._given

    @cached_property
    def _problem(self) -> Problem:
        return self._given.problem()

    @cached_property
    def _parts(self) -> list[tuple[slice, Array]]:
        """Of the current: where its rows stand, and one over their σ."""
        problem = self._problem
        return [
            (rows, problem.over_sigma(i, name, np.ones(rows.stop - rows.start)))
            for i, name, rows in problem.parts()
            if name == CURRENT
        ]

    def __call__(self, k: ArrayLike) -> Array:
        """k (n, 8) → (n,), A."""
        problem = self._problem
        k = np.atleast_2d(np.asarray(k, dtype=float))
        x = np.tile(self._x, (len(k), 1))
        x[:, :FAULTS] = problem.at(k)[:, :FAULTS]
        few = [self._of(problem.residuals(x[first : first + TOGETHER])) for first in range(0, len(x), TOGETHER)]
        return np.concatenate(few)

    def _of(self, residuals: Array) -> Array:
        """Of residuals (n, values + unknowns)."""
        parts = [residuals[:, rows] for rows, _ in self._parts]
        errors = np.concatenate([part / over for part, (_, over) in zip(parts, self._parts)], axis=1)
        diverged = np.any([np.max(np.abs(part), axis=1) >= DIVERGED for part in parts], axis=0)
        return np.where(diverged, np.inf, np.sqrt(np.mean(errors**2, axis=1)))


def _better(problem: Problem, given: Setting, x: Array, other: Array, found: Sequence[Twins | None]) -> bool:
    """Whether the Reference Model itself is closer to the recordings at x than at the other; found: twins of both."""
    _reweight(problem, given, found[1])
    # both are counted with the same weights
    weights = [problem.over_sigma(i, name, np.ones(rows.stop - rows.start)) for i, name, rows in problem.parts()]
    return _cost(problem, given, x, found[0], weights) < _cost(problem, given, other, found[1], weights)


def _cost(problem: Problem, given: Setting, x: Array, found: Twins | None, weights: list[Array]) -> float:
    """χ² at x with its own twin, for given 1/σ of each part, and the prior."""
    _reweight(problem, given, found)
    residual = problem.residuals(x[None, :])[0]
    total = float(np.sum(residual[problem.values :] ** 2))
    for weight, (i, name, rows) in zip(weights, problem.parts()):
        own = problem.over_sigma(i, name, np.ones(rows.stop - rows.start))
        total += float(np.sum((residual[rows] / own * weight) ** 2))
    return total


def _reweight(problem: Problem, given: Setting, found: Twins | None) -> None:
    if found is None:
        problem.reweighted(given.floors)
    else:
        problem.reweighted(found.floors(given.floors), found.added)


def _descend(problem: Problem, x: Array, known: tuple[Array, Array] | None = None) -> tuple[Array, float, int]:
    """known: what `Problem.jacobians` gives at x."""
    descent = Descent.begin(problem, x, known)
    for _ in range(_STEPS):
        descent.step()
        if descent.done:
            break
    return descent.x[0], float(descent.cost[0]), descent.evaluations
