"""Each unit's own calibration, and all units' linearisations at what they together say of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from ema_model.estimation import Calibration, Floor, after_fit, calibrate
from ema_model.estimation.floor import twin_errors
from ema_model.fleet.block import WIDER, Candidate, Linearised, Unit, colour_of, linearised, pooled
from ema_model.fleet.criteria import FALSE
from ema_model.fleet.pool import Pool
from ema_model.fleet.select import price_of, select
from ema_model.identification.fit import TWINS

# --- in what the recordings of one unit disagree ----------------------------------------------------------------------
# The zero of the current's sensor, by how long the current is late, and how warm the winding was.
# None is the unit's: a sensor's zero drifts from day to day, and a logger takes the signals a little apart.  They are
# freed for a recording where the data pay for it, as differences between units are, and integrated out; of a unit with
# a recording whose current is late, or whose winding was far warmer, no difference is told before that is set right.

Array = NDArray[np.float64]

_ANYWHERE = 1e-3  # σ⁻², of a parameter whose value the other recordings are to tell, not the file
_WHITE = 1_000_000  # independent values where nothing but the sensors' noise scatters


@dataclass(frozen=True)
class Paid:
    """One that the data pay for."""

    place: int  # among the unit's candidates
    of: Candidate
    value: float  # in its unit
    sigma: float

    @property
    def is_allowed_for(self) -> bool:
        """Whether what is said of the unit does not suffer by it."""
        return abs(self.value) <= self.of.farthest * self.of.sigma


def disagreements(parts: Sequence[Linearised]) -> list[list[Paid]]:
    """Of each unit what the data pay for, the best first; its ripple is taken to be alike in all units."""
    total = sum(len(one.candidates) for one in parts)
    if not total:
        return [[] for _ in parts]
    freedom = sum(one.rounds * (TWINS - 1) for one in parts)
    price = float(stdtrit(freedom or _WHITE, 0.5 * FALSE / total)) ** 2
    ripple = _ripple(parts, freedom)
    found = []
    for part in parts:
        chosen: list[int] = []
        while left := [place for place in range(len(part.candidates)) if place not in chosen]:
            scores = {place: _score(part, place, chosen, ripple) for place in left}
            best = max(left, key=lambda place: abs(scores[place][0]) / scores[place][1])
            value, sigma = scores[best]
            if (value / sigma) ** 2 <= price:
                break
            chosen.append(best)
        found.append(
            [
                _paid(part, place, *_score(part, place, [one for one in chosen if one != place], ripple))
                for place in chosen
            ]
        )
    return found


def _paid(part: Linearised, place: int, value: float, sigma: float) -> Paid:
    one = part.candidates[place]
    return Paid(place, one, one.sigma * value, one.sigma * float(np.hypot(sigma, one.bent * value)))


def _score(part: Linearised, place: int, chosen: Sequence[int], ripple: dict[str, float]) -> tuple[float, float]:
    """How far one is off, once all else has taken what it can of it, and 1 σ, in its own σ."""
    whole, information, known = _left(part, place, chosen)
    variance = float(whole @ part.noise @ whole + known @ whole**2) + ripple[part.candidates[place].name] * information
    sigma = np.hypot(np.sqrt(variance) / information, part.candidates[place].model)
    return float(whole @ part.gradient) / information, float(sigma)


def _left(part: Linearised, place: int, chosen: Sequence[int]) -> tuple[Array, float, Array]:
    """The combination of columns (columns,) that is left of a candidate, its curvature, and the priors (columns,)."""
    others = [*range(part.parameters), *part.nuisances(chosen)]
    column = part.nuisances([place])[-1]
    prior = np.zeros(len(others))
    prior[: part.parameters] = 1.0  # a tolerance
    if (same := part.candidates[place].parameter) is not None:
        prior[same] = _ANYWHERE
    prior[len(others) - len(chosen) :] = 1.0
    taken = np.linalg.solve(part.curvature[np.ix_(others, others)] + np.diag(prior), part.curvature[others, column])
    whole = np.zeros(len(part.curvature))
    whole[column], whole[others] = 1.0, -taken
    known = np.zeros(len(whole))
    known[others] = prior
    return whole, max(float(part.curvature[column] @ whole), 1e-12), known


def _ripple(parts: Sequence[Linearised], freedom: int) -> dict[str, float]:
    """The ripple's variance over the curvature, of each kind."""
    ratios: dict[str, list[float]] = {}
    for part in parts:
        for place, one in enumerate(part.candidates):
            whole, information, _ = _left(part, place, ())
            square = float(np.sum((part.ripple @ whole) ** 2)) / max(part.rounds * (TWINS - 1), 1)
            ratios.setdefault(one.name, []).append((1.0 + 1.0 / TWINS) * square / information if freedom else 0.0)
    return {name: float(np.mean(each)) for name, each in ratios.items()}


# --- how far units go from where they were linearised, towards where all units together say that they are -------------
# A model is only straight near there: a step is taken as far as the units' own recordings, simulated again, agree.

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


# --- each unit's own calibration, and all units' linearisations at what they together say of each ---------------------
# The first common point is the middle of the units' own; each pass goes on from the last one's answer (Gauss and
# Newton's steps for all units at once, each as far as the unit's recordings agree), and adds to what is known of the
# chopping's ripple.

PASSES = 4  # after which the answers of made fleets stay
_SETTLING = 2  # of them, in which the point still moves, and the model's bias with it
_FIRST = 0.2  # tolerances, about the first point
_WORSE = 1.5  # times the χ² of the best unit so far, from which on a unit is fitted from further starts
_FREEDOM = 60  # independent values, over all units, that the ripple's spread is to be known by
_SURE = 3.0  # times the price, which a difference must be worth before it moves the next pass's point
_SEVERAL = 2  # differences of a unit, in whose place one alone is looked for
_NEXT = 1000  # from one pass's seeds to the next one's, and
_NEXT_UNIT = 50  # from one unit's


@dataclass(frozen=True, eq=False)
class Fitted:
    """A unit alone, with the model as it is: with its own bias."""

    unit: Unit
    calibration: Calibration

    @property
    def x(self) -> Array:
        """Its parameters, in the file's tolerances."""
        return WIDER * self.calibration.x[: len(self.unit.parameters)]

    @property
    def starts(self) -> Array:
        """Of its windows."""
        return self.calibration.x[len(self.unit.parameters) :]

    @cached_property
    def lasting(self) -> Array:
        """The colour of what its own calibration leaves, (values,): a difference to other units is none of it."""
        return colour_of(self.unit, self.calibration.residual)

    @cached_property
    def error(self) -> float:
        """What it leaves, in floors."""
        return float(self.over_floor(self.calibration.residual))

    @cached_property
    def floors(self) -> list[Floor]:
        """What a true model leaves once it is fitted."""
        model, found = self.unit.model, self.calibration
        return after_fit(self.unit.floors, found, twin_errors(model, found.actuator, found.k))

    def over_floor(self, residuals: Array) -> Array:
        """rms of what models leave of the unit's recordings, (…, values) as fits weigh it, in its floors, (…,)."""
        problem = self.unit.problem
        problem.reweighted(self.unit.floors)
        squared, counts = [], []
        for window, name, rows in problem.parts():
            floor = self.floors[window]
            squared.append((residuals[..., rows] / problem.over_sigma(window, name, floor.sigma(name))) ** 2)
            counts.append(floor.counts)
        return np.sqrt(np.average(np.concatenate(squared, axis=-1), axis=-1, weights=np.concatenate(counts)))


def fit(unit: Unit, before: Sequence[Fitted] = ()) -> Fitted:
    """Calibrates one; it begins where the first of those before ended, unless that leaves more."""
    free = unit.parameters
    if before:
        start = dict(zip(free, before[0].calibration.x))
        found = calibrate(unit.model, unit.floors, free=free, start=start)
        if found.chi2_per_value <= _WORSE * min(one.calibration.chi2_per_value for one in before):
            return Fitted(unit, found)
    return Fitted(unit, calibrate(unit.model, unit.floors, free=free))


@dataclass(frozen=True, eq=False)
class Together:
    """All units' last linearisations, and what they say."""

    parts: list[Linearised]
    pool: Pool
    freedom: int  # independent values that the ripple's spread is known by, 0 where there is none
    disagreements: list[list[Paid]]  # of each unit


def together(fits: Sequence[Fitted], seed: int = 0, tell: Callable[[str], None] = lambda text: None) -> Together:
    """Linearises and selects, PASSES times."""
    count = len(fits)
    middle = np.median([one.x for one in fits], axis=0)
    common, points, about = middle, [middle] * count, _FIRST * np.eye(len(middle))
    parts: list[Linearised] = []
    rounds = max(1, -(-_FREEDOM // ((PASSES - _SETTLING) * (TWINS - 1) * count)))
    found: Together | None = None
    for number in range(PASSES):
        settling = number < _SETTLING
        before = parts if number > _SETTLING else None
        parts = []
        for i, one in enumerate(fits):
            tell(f"linearising {one.unit.name}, pass {number + 1} of {PASSES}")
            place = seed + _NEXT * number + _NEXT_UNIT * i
            last = before[i].twins if before else None
            again = 1 if settling else rounds
            parts.append(linearised(one.unit, points[i], place, again, one.starts, last, about, one.lasting))
        freedom = sum((TWINS - 1) * one.rounds for one in parts)
        paid = disagreements(parts)
        freed = [[each.place for each in of_unit] for of_unit in paid]
        blocks = pooled(parts, freed)
        price = price_of(count, len(middle), freedom)
        found = Together(parts, select(blocks, price), freedom, paid)
        # What just pays may be how curved the model is: it leads the point astray along what is hardly told.
        sure = select(blocks, price.times(_SURE))
        units = [At(one.unit, one.starts, part, which) for one, part, which in zip(fits, parts, freed)]
        common, points = _next_points(units, sure, found.pool, price.further, common, points)
        about = sure.shared_root
    assert found is not None
    return found


def _next_points(
    units: Sequence[At], pool: Pool, found: Pool, price: float, common: Array, points: Sequence[Array]
) -> tuple[Array, list[Array]]:
    """Where to linearise next: the units that do not differ at one point, as how curved the model is differs nowhere.

    pool: with the differences that are sure; found: with all that pay; price: of one; common: that point before;
    points: of each unit.
    """
    apart = {*range(len(units))} if pool.tau.any() else {unit for unit, _ in pool.pairs}
    alike = [one for i, one in enumerate(units) if i not in apart]
    if alike:
        common = step(alike, common, (pool.shared,))
    own = []
    for i, one in enumerate(units):
        x = step([one], points[i], (pool.unit(i), pool.shared)) if i in apart else common
        several = sum(unit == i for unit, _ in found.pairs)
        own.append(simpler(one, x, common, price * (several - 1)) if several >= _SEVERAL else x)
    return common, own
