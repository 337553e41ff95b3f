"""What recordings tell of the unknowns of a fit: the directions they hardly show, and what is known only together.

A difference over a small step along one unknown after the other tells nothing of a combination of them in which the
signals do not change: its truncation, or the roughness of stick and slip, stands there as information.  So those
directions are simulated themselves, over as far as the fit leaves them open.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ema_model.quantities import HALF_90

if TYPE_CHECKING:
    from ema_model.estimation.problem import Problem

Array = NDArray[np.float64]

_WEAK = 0.05  # σ of its prior, that a direction must be left open by to be simulated: less is known well either way
_WIDEST = 2  # directions, that are simulated however little they seem to be left open
_STRAIGHT = 3.0  # floors, that the signals may change by over a step along one unknown
_ROUNDS = 12  # of measurements: what was false information leaves its direction wider open than was seen before
_ROOM = 0.02  # of the longest way, that one must be long within the bounds to tell anything
_GROWN = 1.05  # times as wide open, from which on a direction is measured again


def covariance_of(jacobian: Array) -> Array:
    """(JᵀJ)⁻¹ of a Jacobian (rows, unknowns) of full rank; JᵀJ itself would round a prior away beside fine floors."""
    root = np.linalg.inv(np.linalg.qr(jacobian, mode="r"))
    return root @ root.T


def posterior(sensitivities: Array) -> Array:
    """(JᵀJ + 1)⁻¹ of weighted sensitivities (values, unknowns), by unknowns in σ of their tolerances."""
    return covariance_of(np.concatenate([sensitivities, np.eye(sensitivities.shape[1])]))


_PIECES = 12, 25  # of each window, whose pulls on the unknowns are independent: the division that says least counts


def by_pieces(sensitivities: Array, residual: Array, parts: Sequence[tuple[int, slice]]) -> list[Array]:
    """Covariances (unknowns, unknowns), in σ² of the tolerances, from how pieces of windows pull at a fit's unknowns.

    What is left may last where a model is not quite the rig's: White, Econometrica 48 (1980), by clusters.
    sensitivities: weighted, (values, unknowns); residual: (values,); parts: window and rows of each of its signals, all
    signals of a moment in the same piece.
    """
    inverse = posterior(sensitivities)
    found = []
    for count in _PIECES:
        places = [
            window * count + np.arange(rows.stop - rows.start) * count // (rows.stop - rows.start)
            for window, rows in parts
        ]
        pieces = np.unique(np.concatenate(places), return_inverse=True)[1]
        pulls = np.zeros((pieces.max() + 1, sensitivities.shape[1]))
        np.add.at(pulls, pieces, sensitivities * residual[:, None])
        pulls = (pulls - pulls.mean(axis=0)) @ inverse * np.sqrt(len(pulls) / (len(pulls) - 1.0))
        found.append(pulls.T @ pulls + inverse @ inverse)  # the prior pulls as well
    return found


def measured(problem: Problem, x: Array, jacobian: Array, scale: float = 1.0) -> Array:
    """The derivatives (values + unknowns, unknowns) at x, those along weak directions taken by simulating along them.

    jacobian: by the problem's own steps, with its prior's rows below; scale: by which what the model misses widens the
    covariance.  A direction is an eigenvector of the covariance; positive quantities are moved along it by ratios.
    """
    found, before = _over_short_steps(problem, x, jacobian), np.zeros(problem.count)
    for turn in range(_ROUNDS):
        variances, directions = np.linalg.eigh(covariance_of(found))
        open_by = np.sqrt(np.clip(scale * variances, 0.0, 1.0))  # rounding may leave one below 0
        weak = open_by > _WEAK
        if turn == 0:  # what is left of truncation may hide the widest
            weak[-_WIDEST:] = True
        if turn > 0 and not (open_by > _GROWN * np.maximum(before, _WEAK)).any():
            break
        if not weak.any():
            break
        before = open_by
        steps = np.maximum(open_by, _WEAK)[weak, None] * directions[:, weak].T
        at = np.broadcast_to(x, steps.shape)
        ends = [problem.clip(problem.moved(at, sign * steps)) for sign in (-1.0, 1.0)]
        ways = problem.distance(at, *ends)
        below, above = np.split(problem.residuals(np.concatenate(ends)), 2)
        changes = (above - below)[:, : problem.values]
        shown = found[: problem.values]
        # Of all derivatives that make these ways change the signals as they do, those nearest to the known ones.
        least = np.linalg.pinv(ways, rcond=_ROOM)
        found = np.concatenate([shown - (least @ (ways @ shown.T - changes)).T, found[problem.values :]])
    return found


def _over_short_steps(problem: Problem, x: Array, jacobian: Array) -> Array:
    """The derivatives, of unknowns by whose steps the signals change far beyond their floors over shorter ones.

    There the steps are beyond what is straight, and the columns do not cancel along a direction that changes nothing:
    the position of a motor in open loop moves by radians with a hundredth of its torque.
    """
    values = problem.values
    far = problem.steps * np.sqrt(np.mean(np.square(jacobian[:values]), axis=0)) / _STRAIGHT
    columns = np.flatnonzero(far > 1.0)
    if not columns.size:
        return jacobian
    by = np.zeros((columns.size, problem.count))
    by[np.arange(columns.size), columns] = (problem.steps / np.maximum(far, 1.0))[columns]
    at = np.broadcast_to(x, by.shape)
    ends = [problem.clip(problem.moved(at, sign * by)) for sign in (-1.0, 1.0)]
    ways = problem.distance(at, *ends)[np.arange(columns.size), columns]
    below, above = np.split(problem.residuals(np.concatenate(ends)), 2)
    found = jacobian.copy()
    room = ways > 0.0
    found[:values, columns[room]] = ((above - below)[room, :values] / ways[room, None]).T
    return found


# --- what is known only together: products of powers that recordings tell, though none of their factors ---------------

_ROUNDING = 1e-15  # of the greatest variance
_BY_OTHERS = 3.0  # how many times wider open a factor must be than if all others were known
_KNOWN = 0.2  # of what its factors leave each on its own, that a product may be left open by
_POWERS = {
    2: (1, -1, 2, -2),
    3: (1, -1),
    4: (1, -1),
}  # by the number of factors: more of them bend any sum to a product
_MOST_OPEN = 8


@dataclass(frozen=True)
class Combination:
    """A product of powers of parameters that is known far better than any of them."""

    powers: dict[str, int]  # by "section.parameter"
    value: float
    relative: float  # 1 σ of the value, as a share of it

    @property
    def interval90(self) -> tuple[float, float]:
        """Its ends; a product of positive quantities is positive."""
        half = HALF_90 * self.relative
        return self.value * math.exp(-half), self.value * math.exp(half)


def known_together(names: Sequence[str], values: Array, sigmas: Array, covariance: Array) -> tuple[Combination, ...]:
    """The combinations of positive parameters that recordings tell, simplest first, none of which follows from others.

    values, sigmas: (n,) as fitted, and 1 σ of the prior in the same unit; covariance: (n, n) in units of sigmas.
    """
    shares = sigmas / values
    logarithms = covariance * np.outer(shares, shares)
    variances, directions = np.linalg.eigh(covariance)
    variances = np.maximum(variances, _ROUNDING * variances[-1:])  # one that is known to rounding may be below 0
    taken_up = np.sqrt(np.diag(covariance) * np.sum(directions**2 / variances, axis=1))
    order = np.argsort(-taken_up, kind="stable")[:_MOST_OPEN]
    open_ones = sorted(int(i) for i in order if taken_up[i] > _BY_OTHERS)
    found: list[tuple[Array, Combination]] = []
    for factors in _POWERS:
        seen = [
            one
            for places in itertools.combinations(open_ones, factors)
            for powers in itertools.product(_POWERS[factors], repeat=factors)
            if powers[0] > 0 and (one := _product(np.array(places), np.array(powers), logarithms)) is not None
        ]
        for relative, places, powers in sorted(seen, key=lambda one: (int(np.abs(one[2]).sum()), one[0])):
            vector = np.zeros(len(names))
            vector[places] = powers
            known = [one for one, _ in found]
            if np.linalg.matrix_rank(np.array([*known, vector])) == len(known):
                continue  # it follows from those
            value = float(np.prod(values[places] ** powers))
            pairs = {names[int(place)]: int(power) for place, power in zip(places, powers)}
            found.append((vector, Combination(pairs, value, relative)))
    return tuple(one for _, one in found)


def _product(
    places: NDArray[np.int_], powers: NDArray[np.int_], logarithms: Array
) -> tuple[float, NDArray[np.int_], NDArray[np.int_]] | None:
    """1 σ of a product, as a share of it, where it is known far better than each factor and any part of it."""
    if np.gcd.reduce(powers) > 1:
        return None
    its = logarithms[np.ix_(places, places)]
    relative = math.sqrt(max(0.0, float(powers @ its @ powers)))
    each = np.abs(powers) * np.sqrt(np.diag(its))
    return (relative, places, powers) if relative < _KNOWN * float(each.min()) else None
