"""Each unit's own calibration, and all units' linearisations at what they together say of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from ema_model.estimation import Calibration, Floor, after_fit, calibrate
from ema_model.estimation.noise import twin_errors
from ema_model.fleet.block import (
    WIDER,
    Block,
    Candidate,
    Linearised,
    Pair,
    Pool,
    Unit,
    colour_of,
    linearised,
    pooled,
    scatter,
)
from ema_model.fleet.result import ALIKE, FALSE, FURTHER, MINORITY, SCATTER_UNITS
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


# --- in which parameters which units differ: freed one by one where the data pay for it, or taken back ----------------
# A pair of a unit and a parameter is paid for where −2 log likelihood falls by more than chance would let the greatest
# of all pairs' fall (Bonferroni), a scatter over all units likewise. That units differ at all must be all but sure;
# where they do, a further difference needs less (Holm, Scand. J. Stat. 6, 1979: each step a price of its own).

_LARGEST_SET = 4  # parameters of a unit, that are chosen together
_MOST_EXCHANGES = 20
_FIRSTS = 8  # pairs that a search begins with
_LEAST = 1e-6  # of −2 log likelihood, that is a better account


@dataclass(frozen=True)
class Price:
    """What must be gained."""

    first: float  # by the only pair
    further: float  # by each of several
    scatter: float

    def of(self, pairs: int) -> float:
        """By so many pairs together."""
        return self.first + (pairs - 1) * self.further if pairs else 0.0

    def times(self, factor: float) -> Price:
        """All of it so many times."""
        return Price(factor * self.first, factor * self.further, factor * self.scatter)


def price_of(units: int, parameters: int, freedom: int = 0) -> Price:
    """For so many pairs.

    freedom: independent values that the ripple's spread is known by, 0 where there is no ripple.
    """
    pairs = parameters * (units if units > 2 else 1)  # of two, it is the same difference in either

    def of_one(chance: float) -> float:
        return float(stdtrit(freedom, 0.5 * chance / pairs) ** 2 if freedom else chdtri(1, chance / pairs))

    return Price(of_one(FALSE), of_one(FURTHER), float(chdtri(1, 2.0 * FALSE / parameters)))


def select(blocks: Sequence[Block], price: Price, start: Pool | None = None) -> Pool:
    """The pairs and the scatter that the data pay for; start: from which it goes on."""
    none = Pool(blocks, (), np.zeros(len(blocks[0].pull)))
    pool = none if start is None else Pool(blocks, start.pairs, start.tau)
    several = _searched(pool, replace(price, first=price.further))
    return min(several, _grown(none, price), key=lambda one: total(one, price))


def _searched(pool: Pool, price: Price) -> Pool:
    """The best account that one change after another reaches."""
    pool = _price_paid(pool, price)
    every = [_with_pairs(first, price) for first in _firsts(pool, price)]
    pool = _grown(min(every, key=lambda one: total(one, price)), price)
    for _ in range(_MOST_EXCHANGES):
        changed = min(_exchanged(pool, price), key=lambda one: total(one, price), default=pool)
        if total(changed, price) >= total(pool, price) - _LEAST:
            break
        pool = _grown(changed, price)
    return pool


def _firsts(pool: Pool, price: Price) -> list[Pool]:
    """From which a search goes on: as it is, and with one pair that pays, the best of each parameter.

    Of few units, any may be the one that differs: the pair that gains most may be none that does.
    """
    best = [(int(unit), place) for place, unit in enumerate(np.argmax(pool.gains, axis=0))]
    paying = sorted((one for one in best if pool.gains[one] > price.further), key=lambda one: -pool.gains[one])
    return [pool, *(pool.with_pairs([*pool.pairs, one]) for one in paying[:_FIRSTS])]


def _grown(pool: Pool, price: Price) -> Pool:
    """With all that pays besides: pairs, and a scatter in which no unit stands out."""
    while True:
        pool = _with_pairs(pool, price)
        every = [_scattered(pool, p, pool.pairs, price) for p in range(pool.parameters)]
        changed = min(every, key=lambda one: total(one, price))
        if total(changed, price) >= total(pool, price) - _LEAST:
            return pool
        pool = changed


def _with_pairs(pool: Pool, price: Price) -> Pool:
    """With all pairs that pay besides, the best first."""
    while True:
        at = np.unravel_index(int(np.argmax(pool.gains)), pool.gains.shape)
        pair = int(at[0]), int(at[1])
        if pool.gains[pair] <= price.further:
            return pool
        changed = _price_paid(_best_of_unit(pool.with_pairs([*pool.pairs, pair]), pair[0]), price)
        if sum(p == pair[1] for _, p in changed.pairs) > MINORITY * len(pool.blocks):
            changed = _scattered(changed, pair[1], (), price)
        if total(changed, price) >= total(pool, price) - _LEAST:
            return pool
        pool = changed


def _exchanged(pool: Pool, price: Price) -> Iterator[Pool]:
    """Neighbours that a search which adds one by one does not reach, each where it may be the better account.

    In place of one or two pairs others, as many or fewer; and in place of the units that differ in a parameter all the
    others, which then differ the other way.
    """
    for place in {p for _, p in pool.pairs}:
        units = {u for u, p in pool.pairs if p == place}
        others = [one for one in pool.pairs if one[1] != place]
        turned = [(u, place) for u in range(len(pool.blocks)) if u not in units]
        yield _price_paid(pool.with_pairs([*others, *turned]), price)
    for count in (1, 2):
        for left in combinations(pool.pairs, count):
            if len({u for u, _ in left}) > 1 and len({p for _, p in left}) > 1:
                continue  # they have nothing in common
            bare = pool.with_pairs([one for one in pool.pairs if one not in left])
            for _ in range(count):
                gains = bare.gains.copy()
                gains[tuple(zip(*left))] = 0.0
                unit, place = np.unravel_index(int(np.argmax(gains)), gains.shape)
                bare = bare.with_pairs([*bare.pairs, (int(unit), int(place))])
                yield _price_paid(bare, price)


def alike(pool: Pool, pair: Pair) -> tuple[int, ...]:
    """The parameters that tell a difference as well as the one that was freed, itself first."""
    unit, chosen = pair
    gains = pool.with_pairs([one for one in pool.pairs if one != pair]).gains[unit]
    order = np.argsort(-gains)
    return (chosen, *(int(p) for p in order if p != chosen and gains[p] > gains[chosen] - ALIKE))


def total(pool: Pool, price: Price) -> float:
    """What its fit leaves, and what its pairs and scatters cost: the less, the better the account."""
    return pool.cost + price.of(len(pool.pairs)) + np.count_nonzero(pool.tau) * price.scatter


def _best_of_unit(pool: Pool, unit: int) -> Pool:
    """A unit's pairs replaced by as many others that tell its differences best, whichever came first.

    Of more than a few, the last one alone has been chosen, since sets grow fast.
    """
    own = [p for u, p in pool.pairs if u == unit]
    if not 1 <= len(own) <= _LARGEST_SET:
        return pool
    others = [pair for pair in pool.pairs if pair[0] != unit]
    score, curvature = pool.with_pairs(others).freeing(unit)
    sets = np.array(list(combinations(range(pool.parameters), len(own))))
    scores = score[sets]
    solved = np.linalg.solve(curvature[sets[:, :, None], sets[:, None, :]], scores[:, :, None])[:, :, 0]
    best = sets[int(np.argmax(np.sum(scores * solved, axis=1)))]
    return pool.with_pairs([*others, *((unit, int(p)) for p in best)])


def _price_paid(pool: Pool, price: Price) -> Pool:
    """Without the pairs that do not pay, the least one first."""
    while pool.pairs:
        least = min(pool.pairs, key=pool.loss)
        if pool.loss(least) > price.further:
            break
        pool = pool.with_pairs([one for one in pool.pairs if one != least])
    return pool


def _scattered(pool: Pool, place: int, kept: Sequence[Pair], price: Price) -> Pool:
    """With a scatter of one parameter over all units, where that is the better account; of its pairs, those kept."""
    if len(pool.blocks) < SCATTER_UNITS or pool.tau[place]:
        return pool
    bare = pool.with_pairs([one for one in pool.pairs if one[1] != place or one in kept])
    each = np.maximum(bare.gains[:, place], 1.0)
    if np.sum(each - 1.0 - np.log(each)) <= price.scatter:  # the most that a variance for each unit could gain
        return pool
    tau = pool.tau.copy()
    tau[place] = scatter(bare, place)
    changed = _price_paid(bare.with_tau(tau), price)
    return changed if tau[place] and total(changed, price) < total(pool, price) else pool
