"""Least squares in lanes: steps, descent, the answer, and what the recordings tell of its unknowns."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ema_model.estimation.problem import Problem
from ema_model.quantities import HALF_90

# --- one descent of a fit, in two ways one after the other ------------------------------------------------------------
# One descent of a fit, in two ways one after the other, each ended where nothing changes any more that counts.
#
# scipy's trust region goes far along a valley that bends; from a start at a bound, or in a valley that is narrow and
# rough, it goes nowhere. There Marquardt's steps go on.

Array = NDArray[np.float64]

_LONGEST = 40  # evaluations, or steps, of each way
# What one may change of half χ² and mean nothing: stick and slip make it rough, and a trust region takes half a dozen
# steps into that roughness before it gives up.
_IDLE, _IDLE_SHARE = 0.5, 1e-4
_MOST_IDLE = 2  # one after the other


@dataclass(frozen=True, eq=False)
class Descended:
    """Where a descent ended."""

    x: Array  # (unknowns,)
    cost: float  # half of χ², or of the loss that stands in for it
    ended: bool  # before its longest


def descended(
    problem: Problem,
    start: Array,
    soft: float | None = None,
    tell: Callable[[], None] = lambda: None,
    *,
    near: bool = False,
) -> Descended:
    """Down from a start (unknowns,), inside the problem's bounds.

    soft: beyond so many σ, errors count as themselves instead of as their squares.
    tell is called before each evaluation and may raise to stop.
    near: the start is near the end: Marquardt's steps alone, up to the first that changes nothing that counts.
    """
    taken = problem if soft is None else _Soft(problem, soft)
    if near:
        return _by_marquardt(taken, start, None, tell, most_idle=1)
    return _by_marquardt(taken, *_by_trust_region(taken, start, tell), tell)


def _by_trust_region(
    problem: BoundedProblem, start: Array, tell: Callable[[], None]
) -> tuple[Array, tuple[Array, Array]]:
    """The lowest point that was seen, and the problem's `jacobians` there."""
    from scipy.optimize import least_squares  # takes a third of a second to import

    way = _Way(problem, tell)
    try:
        least_squares(
            way.residual,
            np.clip(start, 0.98 * problem.low, 0.98 * problem.high),
            jac=way.jacobian,  # pyright: ignore[reportArgumentType]
            bounds=(problem.low, problem.high),
            max_nfev=_LONGEST,
            xtol=1e-4,
            ftol=5e-5,
            # The long Jacobian's singular values cost more than all else, but lsmr looks for its step in a plane.
            tr_solver="exact" if len(start) == 1 else "lsmr",
        )
    except _Ended:
        pass
    return way.x, way.lowest


def _by_marquardt(
    problem: BoundedProblem,
    start: Array,
    known: tuple[Array, Array] | None,
    tell: Callable[[], None],
    most_idle: int = _MOST_IDLE,
) -> Descended:
    descent = Descent.begin(problem, start, known)
    before, idle, steps = np.inf, 0, 0
    while not descent.done and idle < most_idle and steps < _LONGEST:
        tell()
        descent.step()
        now = 0.5 * float(descent.cost[0])
        idle = idle + 1 if before - now < _IDLE + _IDLE_SHARE * now else 0
        before, steps = now, steps + 1
    return Descended(descent.x[0], before, steps < _LONGEST)


class _Ended(Exception):
    pass


class _Way:
    """What is known on the way: the lowest point, and the Jacobian of the last one, which comes with its residual."""

    def __init__(self, problem: BoundedProblem, tell: Callable[[], None]) -> None:
        self.x, self._cost = np.zeros(0), np.inf
        self._problem, self._tell = problem, tell
        self._at, self._jacobian = np.zeros(0), np.zeros((0, 0))
        self.lowest = np.zeros((1, 0)), np.zeros((1, 0, 0))
        self._idle = 0

    def residual(self, x: Array) -> Array:
        """(values + unknowns,).  Raises _Ended where the last evaluations changed nothing that counts."""
        self._tell()
        residual = self._simulated(x)
        cost = 0.5 * float(residual @ residual)
        idle = abs(self._cost - cost) < _IDLE + _IDLE_SHARE * cost
        if cost < self._cost:
            self.x, self._cost, self.lowest = self._at, cost, (residual[None], self._jacobian[None])
        self._idle = self._idle + 1 if idle else 0
        if self._idle == _MOST_IDLE:
            raise _Ended
        return residual

    def jacobian(self, x: Array) -> Array:
        """(values + unknowns, unknowns)."""
        if not np.array_equal(x, self._at):
            self._simulated(x)
        return self._jacobian

    def _simulated(self, x: Array) -> Array:
        residuals, jacobians = self._problem.jacobians(x[None, :], in_whole_blocks=True)
        self._at, self._jacobian = x.copy(), jacobians[0]
        return residuals[0]


class _Soft:
    """A problem whose residuals r are √(2 s² (√(1 + (r/s)²) − 1)), with r's sign: r if small, √(2 s r) if large."""

    def __init__(self, problem: Problem, scale: float) -> None:
        self._problem, self._scale = problem, scale
        self.low, self.high, self.count = problem.low, problem.high, problem.count
        self.clip, self.points_in_whole_blocks = problem.clip, problem.points_in_whole_blocks
        self.has_room_for = problem.has_room_for

    def residuals(self, x: Array) -> Array:
        return self._softened(self._problem.residuals(x))[0]

    def jacobians(self, x: Array, *, in_whole_blocks: bool) -> tuple[Array, Array]:
        residuals, slopes = self._problem.jacobians(x, in_whole_blocks=in_whole_blocks)
        softened, share = self._softened(residuals)
        return softened, slopes * share[:, :, None]

    def jacobians_beside(self, x: Array, others: Array, *, in_whole_blocks: bool) -> tuple[Array, Array, Array]:
        residuals, slopes, beside = self._problem.jacobians_beside(x, others, in_whole_blocks=in_whole_blocks)
        softened, share = self._softened(residuals)
        return softened, slopes * share[:, :, None], self._softened(beside)[0]

    def _softened(self, residuals: Array) -> tuple[Array, Array]:
        """And their derivative by the residuals."""
        root = np.sqrt(1.0 + (residuals / self._scale) ** 2)
        return residuals * np.sqrt(2.0 / (1.0 + root)), np.sqrt(0.5 * (1.0 + root)) / root


# --- bounded least squares from many starts at once -------------------------------------------------------------------
# Bounded least squares from many starts at once: Levenberg and Marquardt's steps, an active set at the bounds.
#
# D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, J. SIAM 11 (1963) 431–441. All
# starts' derivatives are one population of the kernel, and so are all steps with several dampings each.

_DAMPINGS = (1e-4, 1e-2, 1.0, 30.0)  # of one step, times the start's own
_SMALL = 1e-3  # least fall of the cost, in units of χ², that is worth another step
_RELATIVE = 1e-5


class BoundedProblem(Protocol):
    """Least squares within bounds, of many candidates x (…, count) at once; their prior is among the residuals."""

    low: Array  # (count,)
    high: Array

    @property
    def count(self) -> int:
        """Unknowns."""
        ...

    def clip(self, x: Array) -> Array:
        """Candidates moved into the bounds."""
        ...

    def residuals(self, x: Array) -> Array:
        """(n, residuals) of candidates (n, count)."""
        ...

    def jacobians(self, x: Array, *, in_whole_blocks: bool) -> tuple[Array, Array]:
        """The same, and their derivatives (n, residuals, count), to one side where that spares a block of lanes."""
        ...

    def points_in_whole_blocks(self, n: int) -> int:
        """How many are simulated for those derivatives of n candidates."""
        ...

    def jacobians_beside(self, x: Array, others: Array, *, in_whole_blocks: bool) -> tuple[Array, Array, Array]:
        """`jacobians`, and the residuals of others (l, count) that are simulated with them."""
        ...

    def has_room_for(self, others: int) -> bool:
        """Whether these fit in the block of lanes of one candidate's derivatives, and leave those as they are."""
        ...


@dataclass(eq=False)
class Descent:
    """Where n starts stand; `step` moves each of them downhill."""

    problem: BoundedProblem
    x: Array  # (n, unknowns)
    cost: Array  # (n,), χ² with the prior
    damping: Array
    moving: NDArray[np.bool_]
    evaluations: int = 0
    known: tuple[Array, Array] | None = None  # residuals and their derivatives where the next step begins
    _best: int = 0  # of the dampings, in the last step

    @classmethod
    def begin(cls, problem: BoundedProblem, x: Array, known: tuple[Array, Array] | None = None) -> Descent:
        """At these starts (n, unknowns); known: the problem's `jacobians` there, if they were asked for before."""
        given = np.atleast_2d(np.asarray(x, dtype=float))
        x = problem.clip(given)
        n = len(x)
        known = known if np.array_equal(x, given) else None
        return cls(problem, x, np.full(n, np.inf), np.ones(n), np.ones(n, dtype=bool), known=known)

    @property
    def done(self) -> bool:
        """Whether no start falls any further."""
        return not self.moving.any()

    def step(self) -> None:
        """One step of those that still move."""
        problem = self.problem
        chosen = np.flatnonzero(self.moving)
        if self.known is None:
            self.known = problem.jacobians(self.x[chosen], in_whole_blocks=True)
            self.evaluations += problem.points_in_whole_blocks(len(chosen))
        (residuals, slopes), self.known = self.known, None
        self.cost[chosen] = np.sum(residuals**2, axis=1)
        dampings = np.outer(self.damping[chosen], _DAMPINGS)
        trials = problem.clip(_newton(problem, self.x[chosen], residuals, slopes, dampings).reshape(dampings.size, -1))
        residuals_there, expected = self._tried(trials)
        costs = np.sum(residuals_there**2, axis=1).reshape(len(chosen), -1)
        self.evaluations += len(trials)
        trials = trials.reshape(len(chosen), len(_DAMPINGS), -1)
        best = np.argmin(costs, axis=1)
        stayed = np.zeros(len(chosen), dtype=bool)
        for place, i in enumerate(chosen):
            fall = self.cost[i] - costs[place, best[place]]
            if fall > 0.0:
                self.x[i], self.cost[i] = trials[place, best[place]], costs[place, best[place]]
                self.damping[i] = np.clip(self.damping[i] * 10.0 ** (2 * (best[place] - 1.5) / 3), 1e-6, 1e6)
                self.moving[i] = fall > _SMALL + _RELATIVE * self.cost[i]
            else:
                self.damping[i] *= 100.0
                self.moving[i] = self.damping[i] < 1e5
                stayed[place] = self.moving[i]
        self._best = int(best[-1])
        if expected is not None and not stayed.any() and self.moving.any() and best[0] == expected[0]:
            self.known = expected[1]
        if stayed.any() and stayed.sum() == self.moving.sum():  # all that go on stand where they stood
            self.known = residuals[stayed], slopes[stayed]

    def _tried(self, trials: Array) -> tuple[Array, tuple[int, tuple[Array, Array]] | None]:
        """Residuals of the trials; of one start, with the derivatives at the one that is expected to be best.

        The lanes that these fill are there anyway, and most often the next step needs them.
        """
        problem, at = self.problem, self._best
        if len(trials) != len(_DAMPINGS) or not problem.has_room_for(len(trials) - 1):
            return problem.residuals(trials), None
        others = np.delete(trials, at, axis=0)
        here, slopes, beside = problem.jacobians_beside(trials[at : at + 1], others, in_whole_blocks=True)
        return np.insert(beside, at, here[0], axis=0), (at, (here, slopes))

    def keep(self, rows: NDArray[np.intp]) -> None:
        """Goes on with these starts only."""
        self.known = None
        self.x, self.cost = self.x[rows], self.cost[rows]
        self.damping, self.moving = self.damping[rows], self.moving[rows]


def _newton(problem: BoundedProblem, x: Array, residuals: Array, slopes: Array, dampings: Array) -> Array:
    """The damped Gauss–Newton points of x (n, unknowns) for dampings (n, d), (n, d, unknowns).

    What stands at a bound and would leave it is held there.
    """
    turned = np.swapaxes(slopes, 1, 2)
    hessians = (turned @ slopes)[:, None]
    gradients = (turned @ residuals[:, :, None])[:, None, :, 0]
    diagonals = np.diagonal(hessians, axis1=2, axis2=3)
    most = diagonals.max(axis=2, initial=1e-12, keepdims=True)
    damped = 1e-2 * dampings[:, :, None] * np.maximum(diagonals, 1e-6 * most)
    each = np.eye(x.shape[1])
    systems = hessians + damped[..., None] * each
    low, high = (x <= problem.low)[:, None], (x >= problem.high)[:, None]
    free = np.ones(damped.shape, dtype=bool)
    moves = np.zeros(damped.shape)
    for _ in range(x.shape[1]):
        both = free[..., :, None] & free[..., None, :]
        wanted = np.where(free, -gradients, 0.0)
        moves = np.linalg.solve(np.where(both, systems, each), wanted[..., None])[..., 0]
        leaves = free & ((low & (moves < 0.0)) | (high & (moves > 0.0)))
        if not leaves.any():
            break
        free &= ~leaves
    return x[:, None] + moves


# --- what recordings tell of the unknowns of a fit: the directions they hardly show -----------------------------------
# A difference over a small step along one unknown after the other tells nothing of a combination of them in which the
# signals do not change: its truncation, or the roughness of stick and slip, stands there as information. So those
# directions are simulated themselves, over as far as the fit leaves them open.

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
