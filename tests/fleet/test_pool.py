"""The algebra over units' blocks, with blocks made by hand: no simulation."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest

from ema_model.fleet.block import DIFFERENCE, Block, Pool, scatter
from ema_model.fleet.fit import alike, price_of, select, total

PARAMETERS = 6
NONE = np.zeros(PARAMETERS)


def information(seed: int, strength: float = 40.0) -> np.ndarray:
    """Of a unit; the last parameter is told by nothing."""
    random = np.random.default_rng(seed)
    root = random.standard_normal((3 * PARAMETERS, PARAMETERS)) + 0.5
    found = strength * root.T @ root / len(root)
    found[-1] = found[:, -1] = 0.0
    return found


def fleet(seed: int, units: int, x: np.ndarray) -> list[Block]:
    """Blocks whose x̂ are x (units, parameters) with the noise that their information says."""
    random = np.random.default_rng([seed, 1])
    blocks = []
    for row in x:
        g = information(7)
        values, vectors = np.linalg.eigh(g)
        noise = vectors @ (np.sqrt(np.maximum(values, 0.0)) * random.standard_normal(PARAMETERS))
        blocks.append(Block(g, g @ row + noise))
    assert len(blocks) == units
    return blocks


def by_hand(blocks, pairs):
    """μ and δ of all equations in one matrix."""
    size = PARAMETERS + len(pairs)
    whole, right = np.zeros((size, size)), np.zeros(size)
    whole[:PARAMETERS, :PARAMETERS] += np.eye(PARAMETERS)
    for place in range(PARAMETERS, size):
        whole[place, place] += DIFFERENCE**-2
    for unit, one in enumerate(blocks):
        moves = np.zeros((PARAMETERS, size))
        moves[:, :PARAMETERS] = np.eye(PARAMETERS)
        for place, (u, p) in enumerate(pairs, PARAMETERS):
            moves[p, place] = u == unit
        whole += moves.T @ one.information @ moves
        right += moves.T @ one.pull
    return np.linalg.solve(whole, right), np.linalg.inv(whole)


def test_the_pool_is_the_whole_system_solved_at_once():
    blocks = fleet(0, 5, np.random.default_rng(0).standard_normal((5, PARAMETERS)))
    pairs = ((1, 2), (1, 3), (4, 0))
    pool = Pool(blocks, pairs, NONE)
    best, covariance = by_hand(blocks, pairs)
    assert pool.shared == pytest.approx(best[:PARAMETERS])
    assert pool.difference((4, 0)) == pytest.approx((best[-1], np.sqrt(covariance[-1, -1])))
    assert pool.fixed(1)[3] == pytest.approx(best[3] + best[PARAMETERS + 1])
    assert pool.shared_sigma[-1] == pytest.approx(1.0)  # nothing tells it: the file's tolerance is left


def test_a_gain_is_what_freeing_gains():
    blocks = fleet(1, 4, np.random.default_rng(1).standard_normal((4, PARAMETERS)))
    pool = Pool(blocks, ((2, 1),), NONE)
    for pair in ((0, 0), (2, 3), (3, 4)):
        freed = pool.with_pairs([*pool.pairs, pair])
        assert pool.gains[pair] == pytest.approx(pool.cost - freed.cost, rel=1e-9)
        assert freed.loss(pair) == pytest.approx(pool.gains[pair], rel=1e-9)
    assert pool.gains[2, 1] == 0.0 and pool.gains[:, -1] == pytest.approx(0.0, abs=1e-9)


def test_scatter_is_integrated_out_as_a_gaussian():
    """−2 log likelihood of x̂ ~ N(μ, G⁻¹ + τ²) with all told, against a scatter of 0, at the best μ of each."""
    random = np.random.default_rng(2)
    blocks = [Block(np.diag([4.0, 9.0]), np.diag([4.0, 9.0]) @ random.standard_normal(2)) for _ in range(6)]
    tau = np.array([0.7, 0.0])

    def cost(tau):
        x = np.array([one.pull / np.diag(one.information) for one in blocks])
        variance = 1.0 / np.diag(blocks[0].information) + tau**2
        mean = np.sum(x / variance, axis=0) / (len(blocks) / variance + 1.0)
        return float(np.sum(np.log(variance)) * len(blocks) + np.sum((x - mean) ** 2 / variance) + mean @ mean)

    fall = Pool(blocks, (), np.zeros(2)).cost - Pool(blocks, (), tau).cost
    assert fall == pytest.approx(cost(np.zeros(2)) - cost(tau))


def test_the_scatter_that_was_put_in_is_found():
    found = []
    for seed in range(10):
        x = np.zeros((20, PARAMETERS))
        x[:, 2] = 0.8 * np.random.default_rng(seed).standard_normal(20)
        found.append(scatter(Pool(fleet(seed, 20, x), (), NONE), 2))
    assert np.mean(found) == pytest.approx(0.8, rel=0.15)


@pytest.mark.parametrize("units", [2, 3, 8, 20])
def test_differences_are_found_with_unit_parameter_sign_and_interval(units):
    right = covered = 0
    for seed in range(20):
        x = np.tile(np.random.default_rng(seed).standard_normal(PARAMETERS), (units, 1))
        x[1, 2] -= 3.0
        if units > 3:
            x[-1, 4] += 3.0
        pool = select(fleet(seed, units, x), price_of(units, PARAMETERS))
        wanted = {(1, 2): -3.0} | ({(units - 1, 4): 3.0} if units > 3 else {})
        if units == 2 and set(pool.pairs) == {(0, 2)}:
            wanted = {(0, 2): 3.0}
        right += set(pool.pairs) == set(wanted) and not pool.tau.any()
        for pair in set(pool.pairs) & set(wanted):
            value, sigma = pool.difference(pair)
            covered += abs(value - wanted[pair]) < 3.0 * sigma
            assert value * wanted[pair] > 0.0
    assert right >= 19 and covered >= 19


def test_equal_units_are_not_said_to_differ():
    claimed = 0
    for seed in range(300):
        units = (2, 3, 6, 12)[seed % 4]
        pool = select(fleet(seed, units, np.zeros((units, PARAMETERS))), price_of(units, PARAMETERS))
        claimed += bool(pool.pairs) or bool(pool.tau.any())
    assert claimed <= 6  # 1 % is 3; more than 6 has a chance of 3 %


def test_all_units_that_scatter_are_not_named_one_by_one():
    x = np.zeros((16, PARAMETERS))
    x[:, 3] = 2.0 * np.random.default_rng(3).standard_normal(16)
    pool = select(fleet(3, 16, x), price_of(16, PARAMETERS))
    assert list(np.flatnonzero(pool.tau)) == [3] and not pool.pairs


def test_what_is_only_known_together_is_named_as_one():
    g = np.diag([50.0, 50.0, 50.0])
    g[:2, :2] = 50.0 * np.array([[1.0, 0.995], [0.995, 1.0]])
    blocks = [Block(g, g @ np.array([1.5 * (unit == 3), 0.0, 0.0])) for unit in range(6)]
    pool = select(blocks, price_of(6, 3))
    assert len(pool.pairs) == 1 and pool.pairs[0][0] == 3
    assert set(alike(pool, pool.pairs[0])) == {0, 1}


def test_more_units_and_less_known_ripple_ask_more():
    for price in ("first", "further"):
        prices = [price_of(*given) for given in ((20, 13), (4, 13), (2, 13), (4, 13, 20), (4, 13, 90))]
        twenty, four, two, hardly, better = (getattr(one, price) for one in prices)
        assert twenty > four > two and hardly > better > four


def test_a_further_difference_needs_less_than_the_first():
    """One of 3.9 σ beside one that is sure is said, and is not where it is alone."""
    g = 100.0 * np.eye(PARAMETERS)
    price = price_of(6, PARAMETERS)
    for sure, said in ((2.0, True), (0.0, False)):
        x = np.zeros((6, PARAMETERS))
        x[1, 2], x[4, 3] = sure, 0.41
        pool = select([Block(g, g @ row) for row in x], price)
        evidence = Pool(pool.blocks, ((4, 3),), NONE).loss((4, 3))
        assert price.further < evidence < price.first
        assert ((4, 3) in pool.pairs) == said and len(pool.pairs) == 2 * said


def test_several_differences_of_a_unit_are_chosen_together():
    """Two together look nearly like a third one alone, which must not stay when both are there."""
    g = np.diag([400.0, 400.0, 400.0, 400.0])
    g[2, :2] = g[:2, 2] = 270.0  # the third shows as the first and the second do together
    blocks = [Block(g, g @ (np.array([2.0, 2.0, 0.0, 0.0]) * (unit == 2))) for unit in range(6)]
    pool = select(blocks, price_of(6, 4))
    assert pool.pairs == ((2, 0), (2, 1))


def test_no_set_of_pairs_is_a_better_account_than_the_one_that_is_found():
    """Beside all sets of up to three pairs: what was freed first, by one's direction being another's, does not stay."""
    units, parameters = 3, 4
    for seed in range(40):
        random = np.random.default_rng(seed)
        root = random.standard_normal((parameters, parameters))
        root[:, 1] = root[:, 0] + 0.2 * root[:, 1]
        g = 40.0 * root.T @ root
        x = np.zeros((units, parameters))
        x[1, 0], x[2, 1] = -2.0, 1.5
        blocks = [Block(g, g @ (row + np.linalg.solve(root, random.standard_normal(parameters)) / 6.3)) for row in x]
        price = price_of(units, parameters)
        found = select(blocks, price)
        every = list(product(range(units), range(parameters)))
        bare = Pool(blocks, (), np.zeros(parameters))
        best = min(total(bare.with_pairs(one), price) for size in range(4) for one in combinations(every, size))
        assert total(found, price) <= best + 0.5  # two sets that are told apart by less are the same
