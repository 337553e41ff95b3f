"""All units together, with some parameters shared, some freed for a unit, some scattering over all units.

x_u = μ + Σ δ + η_u: μ what the type shares, δ a difference of one unit in one parameter, η_u ~ N(0, diag τ²) where all
units scatter.  Everything is in the file's tolerances, and a sum over units: the cost grows linearly with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ema_model.fleet.block import Block

Array = NDArray[np.float64]
Pair = tuple[int, int]  # a unit and a parameter, by their places

DIFFERENCE = 3.0  # tolerances, 1 σ of what is known of a difference beforehand


@dataclass(frozen=True, eq=False)
class Pool:
    """The best fit to all units' blocks; all its answers are exact for these quadratic forms."""

    blocks: Sequence[Block]
    pairs: tuple[Pair, ...]  # that are freed
    tau: Array  # (parameters,), 0 where units do not scatter

    def with_pairs(self, pairs: Sequence[Pair]) -> Pool:
        """The same with other pairs freed."""
        return Pool(self.blocks, tuple(sorted(pairs)), self.tau)

    def with_tau(self, tau: Array) -> Pool:
        """The same with another scatter."""
        return Pool(self.blocks, self.pairs, tau)

    @property
    def parameters(self) -> int:
        """Number of them."""
        return len(self.tau)

    @cached_property
    def _scattered(self) -> list[tuple[Array, Array, float]]:
        """Of each unit: information and pull with η integrated out, and what that adds to −2 log likelihood."""
        found = []
        at = np.flatnonzero(self.tau)
        for one in self.blocks:
            if not len(at):
                found.append((one.information, one.pull, 0.0))
                continue
            root = self.tau[at]
            left = one.information[:, at] * root
            inner = np.eye(len(at)) + root[:, None] * left[at]
            taken = np.linalg.solve(inner, np.concatenate([left.T, (root * one.pull[at])[:, None]], axis=1))
            pull = one.pull - left @ taken[:, -1]
            own = float(np.linalg.slogdet(inner)[1] - (root * one.pull[at]) @ taken[:, -1])
            found.append((one.information - left @ taken[:, :-1], pull, own))
        return found

    @cached_property
    def _columns(self) -> list[list[int]]:
        """Of each unit, the places of its differences among the unknowns."""
        return [[self.parameters + i for i, (u, _) in enumerate(self.pairs) if u == unit] for unit in self._units]

    @property
    def _units(self) -> range:
        return range(len(self.blocks))

    @cached_property
    def _solved(self) -> tuple[Array, Array, float]:
        """The unknowns (μ, δ), their covariance, and −2 log likelihood but for a constant."""
        count = self.parameters
        whole, right = np.eye(count + len(self.pairs)), np.zeros(count + len(self.pairs))
        whole[count:, count:] /= DIFFERENCE**2
        cost = 0.0
        for unit, (information, pull, own) in enumerate(self._scattered):
            places = [*range(count), *self._columns[unit]]
            rows = [*range(count), *(p for u, p in self.pairs if u == unit)]
            whole[np.ix_(places, places)] += information[np.ix_(rows, rows)]
            right[places] += pull[rows]
            cost += own
        covariance = np.asarray(np.linalg.inv(whole), dtype=float)
        best = covariance @ right
        return best, covariance, cost - float(right @ best)

    @property
    def cost(self) -> float:
        """−2 log likelihood but for a constant."""
        return self._solved[2]

    @property
    def shared(self) -> Array:
        """μ (parameters,)."""
        return self._solved[0][: self.parameters]

    @property
    def shared_root(self) -> Array:
        """A root of its covariance, (parameters, parameters)."""
        return np.asarray(np.linalg.cholesky(self._solved[1][: self.parameters, : self.parameters]), dtype=float)

    @property
    def shared_sigma(self) -> Array:
        """1 σ of it, as one unit tells it: what the model is off by is common to all, and averages out nowhere."""
        of_one = sum(information for information, _, _ in self._scattered) / len(self.blocks)
        return np.sqrt(np.diag(np.linalg.inv(of_one + np.eye(self.parameters))))

    def difference(self, pair: Pair) -> tuple[float, float]:
        """δ and 1 σ of it."""
        place = self.parameters + self.pairs.index(pair)
        return float(self._solved[0][place]), float(np.sqrt(self._solved[1][place, place]))

    def fixed(self, unit: int) -> Array:
        """μ + δ of a unit, (parameters,)."""
        x = self.shared.copy()
        for place, pair in enumerate(self.pairs):
            if pair[0] == unit:
                x[pair[1]] += self._solved[0][self.parameters + place]
        return x

    def unit(self, unit: int) -> Array:
        """x of a unit, with the most likely η, (parameters,)."""
        block, x = self.blocks[unit], self.fixed(unit)
        whole = np.eye(len(x)) + self.tau[:, None] * block.information * self.tau
        return x + self.tau * np.linalg.solve(whole, self.tau * (block.pull - block.information @ x))

    @cached_property
    def gains(self) -> Array:
        """By how much −2 log likelihood falls where a pair is freed besides, (units, parameters)."""
        found = np.zeros((len(self.blocks), self.parameters))
        for unit in self._units:
            score, curvature = self.freeing(unit)
            found[unit] = score**2 / np.maximum(np.diag(curvature), 1e-12)
            found[unit, [p for u, p in self.pairs if u == unit]] = 0.0
        return found

    def freeing(self, unit: int) -> tuple[Array, Array]:
        """Score (parameters,) and curvature of a unit's differences, were they freed besides, all else following.

        Freeing a set of them gains scoreᵀ curvature⁻¹ score of that set.
        """
        _, covariance, _ = self._solved
        information, pull, _ = self._scattered[unit]
        places = [*range(self.parameters), *self._columns[unit]]
        rows = [*range(self.parameters), *(p for u, p in self.pairs if u == unit)]
        linked = information[rows]
        taken = linked.T @ covariance[np.ix_(places, places)] @ linked
        curvature = information + DIFFERENCE**-2 * np.eye(self.parameters) - taken
        return pull - information @ self.fixed(unit), curvature

    def loss(self, pair: Pair) -> float:
        """By how much −2 log likelihood rises where a pair is shared again."""
        value, sigma = self.difference(pair)
        return (value / sigma) ** 2


def scatter(pool: Pool, place: int) -> float:
    """The most likely τ of a parameter, in tolerances, all else of the pool as it is but μ and δ."""
    costs = [_with(pool, place, tau).cost for tau in _GRID]
    best = int(np.argmin(costs))
    if best == 0:
        return 0.0
    fine = np.geomspace(_GRID[best - 1] or 0.5 * _GRID[best], _GRID[min(best + 1, len(_GRID) - 1)], 9)
    return float(fine[int(np.argmin([_with(pool, place, tau).cost for tau in fine]))])


_GRID = np.concatenate([[0.0], np.geomspace(0.01, 4.0, 14)])


def _with(pool: Pool, place: int, tau: float) -> Pool:
    changed = pool.tau.copy()
    changed[place] = tau
    return pool.with_tau(changed)
