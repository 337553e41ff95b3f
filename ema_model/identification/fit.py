"""From a k that a search found to the best fit: everything that is not exactly known moves, the twin's bias is out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.estimation.floor import Floor, floor
from ema_model.estimation.least_squares import Descent
from ema_model.estimation.problem import DIVERGED, TOGETHER, Problem
from ema_model.estimation.unknowns import K_SIGMA, Unknown, lags_of, loads_of, starts_of, unknowns_of
from ema_model.faults import HEALTHY, NAMES
from ema_model.identification.base_spreads import spreads_of
from ema_model.identification.model_bias import Twins, errors_near, of_errors, twins
from ema_model.models import ClosedLoop
from ema_model.models.closed_loop import LOAD

Array = NDArray[np.float64]
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
    floors = [floor(bare, place) for place in range(len(bare.windows))]
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


class CorrectedError:
    """Rms of measured less model current with the model's own bias added, A: faults k (n, 8) → (n,).

    The bias, and all that moves beside k, are as one fit has them, so that any k may be compared by it; infinite where
    the model diverges.  What the plain rmse counts against an answer of the simplified model, this leaves out.
    """

    def __init__(self, found: Fitted) -> None:
        self._found = found
        problem = found.problem
        self._parts = [
            (rows, problem.over_sigma(i, name, np.ones(rows.stop - rows.start)))
            for i, name, rows in problem.parts()
            if name == CURRENT
        ]
        self.least = float(self._of(found.residual[None, :])[0])  # at the fit itself

    def __call__(self, k: ArrayLike) -> Array:
        """k (n, 8) → (n,), A."""
        problem = self._found.problem
        k = np.atleast_2d(np.asarray(k, dtype=float))
        x = np.tile(self._found.x, (len(k), 1))
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
