"""Each unit's own calibration, and all units' linearisations at what they together say of each.

The first common point is the middle of the units' own; each pass goes on from the last one's answer (Gauss and
Newton's steps for all units at once, each as far as the unit's recordings agree), and adds to what is known of the
chopping's ripple.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation import Calibration, Floor, after_fit, calibrate
from ema_model.estimation.floor import twin_error
from ema_model.identification.model_bias import TWINS
from ema_model.units.block import WIDER, Linearised, Unit, colour_of, linearised, pooled
from ema_model.units.disagreement import Paid, disagreements
from ema_model.units.pool import Pool
from ema_model.units.select import price_of, select
from ema_model.units.step import At, simpler, step

Array = NDArray[np.float64]

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
        twins = [twin_error(model, place, found.actuator, found.k) for place in range(len(model.windows))]
        return after_fit(self.unit.floors, found, twins)

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
