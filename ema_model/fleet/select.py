"""In which parameters which units differ: freed one by one where the data pay for it, and taken back where they do not.

A pair of a unit and a parameter is paid for where −2 log likelihood falls by more than chance would let the greatest
of all pairs' fall (Bonferroni), a scatter over all units likewise.  That units differ at all must be all but sure;
where they do, a further difference needs less (Holm, Scand. J. Stat. 6, 1979: each step a price of its own).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.special import chdtri, stdtrit

from ema_model.fleet.block import Block
from ema_model.fleet.criteria import ALIKE, FALSE, FURTHER, MINORITY, SCATTER_UNITS
from ema_model.fleet.pool import Pair, Pool, scatter

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
    pool = _paid(pool, price)
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
        changed = _paid(_best_of_unit(pool.with_pairs([*pool.pairs, pair]), pair[0]), price)
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
        yield _paid(pool.with_pairs([*others, *turned]), price)
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
                yield _paid(bare, price)


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


def _paid(pool: Pool, price: Price) -> Pool:
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
    changed = _paid(bare.with_tau(tau), price)
    return changed if tau[place] and total(changed, price) < total(pool, price) else pool
