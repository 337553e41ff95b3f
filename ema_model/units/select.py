"""In which parameters which units differ: freed one by one where the data pay for it, and taken back where they do not.

A pair of a unit and a parameter is paid for where −2 log likelihood falls by more than chance would let the greatest
of all pairs' fall (Bonferroni), a scatter over all units likewise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import chdtri, stdtrit

from ema_model.units.block import Block
from ema_model.units.criteria import ALIKE, FALSE, MINORITY, SCATTER_UNITS
from ema_model.units.pool import Pair, Pool, scatter

_LARGEST_SET = 4  # parameters of a unit, that are chosen together


@dataclass(frozen=True)
class Price:
    """What must be gained."""

    pair: float
    scatter: float


def price_of(units: int, parameters: int, freedom: int = 0) -> Price:
    """For so many pairs.

    freedom: independent values that the ripple's spread is known by, 0 where there is no ripple.
    """
    pairs = parameters * (units if units > 2 else 1)  # of two, it is the same difference in either
    pair = stdtrit(freedom, 0.5 * FALSE / pairs) ** 2 if freedom else chdtri(1, FALSE / pairs)
    return Price(float(pair), float(chdtri(1, 2.0 * FALSE / parameters)))


def select(blocks: Sequence[Block], price: Price, start: Pool | None = None) -> Pool:
    """The pairs and the scatter that the data pay for; start: from which it goes on."""
    pool = start or Pool(blocks, (), np.zeros(len(blocks[0].pull)))
    if start is not None:
        pool = _paid(Pool(blocks, start.pairs, start.tau), price)
    for _ in range(4 * len(blocks) * pool.parameters):
        at = np.unravel_index(int(np.argmax(pool.gains)), pool.gains.shape)
        pair = int(at[0]), int(at[1])
        if pool.gains[pair] > price.pair:
            changed = _paid(_best_of_unit(pool.with_pairs([*pool.pairs, pair]), pair[0]), price)
            if sum(p == pair[1] for _, p in changed.pairs) > MINORITY * len(blocks):
                changed = _scattered(changed, pair[1], (), price)
        else:  # a scatter in which no unit stands out
            every = [_scattered(pool, p, pool.pairs, price) for p in range(pool.parameters)]
            changed = min(every, key=lambda one: _total(one, price))
        if _total(changed, price) >= _total(pool, price) - 1e-9:
            break
        pool = changed
    return pool


def alike(pool: Pool, pair: Pair) -> tuple[int, ...]:
    """The parameters that tell a difference as well as the one that was freed, itself first."""
    unit, chosen = pair
    gains = pool.with_pairs([one for one in pool.pairs if one != pair]).gains[unit]
    order = np.argsort(-gains)
    return (chosen, *(int(p) for p in order if p != chosen and gains[p] > gains[chosen] - ALIKE))


def _total(pool: Pool, price: Price) -> float:
    return pool.cost + len(pool.pairs) * price.pair + np.count_nonzero(pool.tau) * price.scatter


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
        if pool.loss(least) > price.pair:
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
    return changed if tau[place] and _total(changed, price) < _total(pool, price) else pool
