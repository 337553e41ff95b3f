"""What the recordings of one unit tell of its parameters, in what they may disagree, and all units together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.discovery.uncertainty import colour
from ema_model.estimation import Floor, calibrate, default_free, floor
from ema_model.estimation.model_fit import Data
from ema_model.estimation.noise import POSITIONS
from ema_model.estimation.problem import SIGNALS, Problem, starts_of, unknowns_of
from ema_model.identification.fit import TWINS, Twins, twins
from ema_model.models import Model, model_for
from ema_model.models.measured_motion import fit_stretches
from ema_model.recordings import Measurement

# --- in what the recordings of one unit may disagree, and what it does to the model's errors --------------------------

Array = NDArray[np.float64]

_CURRENT = "current_A"
_BIAS = "sensors.current_bias_A"
_RESISTANCE = "motor.resistance_Ohm"
_COPPER_1_K = 0.0039  # of a winding's resistance, a kelvin: IEC 60034-1
_WARM_K = 20.0  # 1 σ of how much warmer one recording's winding may be
_WIDE = 3.0  # of the file's tolerances of a sensor's zero, 1 σ of what is known of one recording's
# Of a sample, 1 σ of a delay that the model itself is off by in another command: in fleets without any (seeds 76000 to
# 76003) a step's current seemed up to half a sample late in all units alike.
_MODEL = 0.25
_LATE_BENT = 0.3  # a sharp current that comes later is no multiple of its slope
# Steps of a winding warmer by 10 to 60 K than in another step are told to be by −4 to +31 %; up to 45 K no difference
# between units follows from it, at 60 K one does.
_WARM_BENT, _WARMEST = 0.15, 2.25


@dataclass(frozen=True)
class Candidate:
    """In what one recording may disagree with the others of its unit; counted in its σ."""

    recording: int  # its place
    name: str  # "current_zero", "current_delay" or "winding_temperature"
    sigma: float  # 1 σ of what is known beforehand
    unit: str
    model: float = 0.0  # of it, 1 σ of what the model is off by
    bent: float = 0.0  # of its size, 1 σ of how far what it does is no multiple of that
    farthest: float = np.inf  # up to which what is said of the unit does not suffer by it
    parameter: int | None = None  # the one that does the same to all recordings, by its place


def _parts_of(problem: Problem, recording: int) -> Iterator[tuple[int, str, slice]]:
    """Of a recording: each window, the name of a signal in it, and where that one's residuals stand."""
    for window, name, rows in problem.parts():
        if problem.model.windows[window].recording == recording:
            yield window, name, rows


def candidates_of(problem: Problem, residual: Array, slope: Array) -> tuple[tuple[Candidate, ...], Array]:
    """All of a unit, and what each does to the residual (values,): (values, so many).

    slope (values, unknowns): what the problem's unknowns do to it.
    """
    model = problem.model
    bias = model.actuator.tolerances.get(_BIAS)
    warm = _warmth(problem, slope)
    found: list[Candidate] = []
    columns: list[Array] = []
    for place, recorded in enumerate(model.measurements):
        if len(model.measurements) < 2:
            continue
        if warm is not None:
            found.append(Candidate(place, "winding_temperature", _WARM_K, "K", 0.0, _WARM_BENT, _WARMEST, warm[0]))
            warmer = np.zeros(problem.values)
            for _, _, rows in _parts_of(problem, place):
                warmer[rows] = warm[1][rows]
            columns.append(warmer)
        if _CURRENT not in recorded:
            continue
        zero, late = np.zeros(problem.values), np.zeros(problem.values)
        period_s = recorded.sample_period_s
        for window, name, rows in _parts_of(problem, place):
            if name != _CURRENT:
                continue
            at = model.windows[window]
            one = problem.over_sigma(window, _CURRENT, np.ones(rows.stop - rows.start))
            shown = at.measured[_CURRENT] + residual[rows] / one
            zero[rows], late[rows] = one, -period_s * np.gradient(shown, at.block_s) * one
        if bias is not None:
            found.append(Candidate(place, "current_zero", _WIDE * bias.sigma, "A"))
            columns.append(zero * _WIDE * bias.sigma)
        if any(position in recorded for position in POSITIONS):
            found.append(Candidate(place, "current_delay", period_s, "s", _MODEL, _LATE_BENT, 0.0))
            columns.append(late)
    return tuple(found), np.stack(columns, axis=1) if columns else np.zeros((problem.values, 0))


def _warmth(problem: Problem, slope: Array) -> tuple[int, Array] | None:
    """The resistance's place among the unknowns, and what a winding warmer by 1 σ does to all recordings."""
    paths = [one.name for one in problem.unknowns]
    if _RESISTANCE not in paths:
        return None
    place, actuator = paths.index(_RESISTANCE), problem.model.actuator
    of_sigma = _COPPER_1_K * actuator.value(_RESISTANCE) / actuator.tolerances[_RESISTANCE].sigma
    return place, slope[:, place] * _WARM_K * of_sigma


# --- what the recordings of one unit tell of its parameters, as a quadratic form in them ------------------------------
# The model is linearised at some parameters, with the difference to its three-phase twin added, so that the model's own
# bias, which depends on the command, is no difference between units.  The starts of all windows are integrated out.
#
# The form is the sandwich A M⁻¹ A: A is the curvature of the weighted squares, M what their gradient really scatters
# by: the sensors' noise, and the chopping's ripple, which no model repeats and which the twins show (`pooled`).

WIDER = 2.0  # times the file's tolerances, within whose 3 σ a unit may be: one that differs may well be outside
_ALL: dict[str, float] = dict.fromkeys(SIGNALS, 1.0)
_NOTHING = 1e-6  # information in σ⁻² that is none


@dataclass(frozen=True, eq=False)
class Block:
    """Of one unit: −½ (x − x̂)ᵀ G (x − x̂) is what its recordings say of x, in σ of the file's tolerances."""

    information: Array  # G, (parameters, parameters)
    pull: Array  # G x̂, (parameters,): x̂ itself is not known where G is small


@dataclass(frozen=True, eq=False)
class Linearised:
    """The normal equations of a unit, before the ripple is pooled with that of other units.

    Their columns: the parameters in σ of the file's tolerances, the starts, and in what a recording may disagree.
    """

    parameters: int  # number of them
    candidates: tuple[Candidate, ...]  # the last columns
    curvature: Array  # A, (columns, columns)
    gradient: Array  # A x̂, (columns,)
    noise: Array  # of the gradient, by the sensors: (columns, columns)
    ripple: Array  # (twins, columns): each twin's gradient from their mean
    rounds: int  # of twins, each with a mean of its own
    by_recording: Array  # (recordings, parameters): the curvature's diagonal, of each recording alone
    twins: Twins | None
    slope: Array  # (values, columns): what they do to the residual

    def nuisances(self, freed: Sequence[int]) -> list[int]:
        """The columns that are integrated out: the starts, and the candidates that are freed, by their places."""
        first = len(self.curvature) - len(self.candidates)
        return [*range(self.parameters, first), *(first + place for place in freed)]


@dataclass(frozen=True, eq=False)
class Unit:
    """A unit's recordings beside the model."""

    name: str
    model: Model
    floors: list[Floor]
    problem: Problem  # its parameters first, then its starts

    @property
    def parameters(self) -> tuple[str, ...]:
        """Paths of those that may differ."""
        return tuple(one.name for one in self.problem.unknowns if one.kind == "parameter")


def unit_of(
    name: str, recordings: Sequence[Measurement], actuator: Actuator, parameters: Sequence[str] | None = None
) -> Unit:
    """A unit beside the actuator's model; InputError for recordings that cannot be compared.

    parameters: that may differ; without it, those that the file leaves free.
    """
    paths = default_free(actuator) if parameters is None else tuple(parameters)
    model = model_for(recordings, wider(actuator), stretches=fit_stretches(recordings, actuator))
    floors = [floor(model, place) for place in range(len(model.windows))]
    starts = starts_of(model, floors, worn=False)
    return Unit(name, model, floors, Problem(model, floors, [*unknowns_of(model.actuator, paths), *starts]))


def wider(actuator: Actuator) -> Actuator:
    """The actuator with tolerances within which a unit that differs may be."""
    tolerances = {path: replace(one, sigma=WIDER * one.sigma) for path, one in actuator.tolerances.items()}
    return replace(actuator, tolerances=tolerances)


def linearised(
    unit: Unit,
    x: Array,
    seed: int = 0,
    rounds: int = 1,
    starts: Array | None = None,
    before: Twins | None = None,
    about: Array | None = None,
    lasting: Array | None = None,
) -> Linearised:
    """At parameters x in σ of the file's tolerances, and starts where the fit had them (or at none).

    rounds: of twins, beside those of `before`; the more, the better their spread is known.  about: a root of the
    covariance of x (parameters, parameters), within which the model's bias must hold.  lasting: the
    colour (values,) of what the unit's own calibration leaves; without it, of what is left here.
    """
    problem, count = unit.problem, len(x)
    at = problem.clip(np.concatenate([x / WIDER, np.zeros(problem.count - count) if starts is None else starts]))
    found = before
    problem.reweighted(unit.floors)
    near = None
    if about is not None:
        near = np.zeros((problem.count, problem.count))
        near[:count, :count] = about / WIDER
    for number in range(rounds):
        found = twins(problem, at, seed + number, found, near)
        if found is None:
            break
        problem.reweighted(found.floors(unit.floors), found.added)
    residuals, slopes = problem.jacobians(at[None, :])
    residual = residuals[0][: problem.values]
    slope = slopes[0][: problem.values]
    candidates, columns = candidates_of(problem, residual, slope)
    slope = np.concatenate([slope, columns], axis=1)
    slope[:, :count] /= WIDER
    at = np.concatenate([WIDER * at[:count], at[count:], np.zeros(len(candidates))])
    known = np.zeros((len(at), len(at)))
    known[range(count, problem.count), range(count, problem.count)] = 1.0  # a start's own prior is as a measurement
    curvature = slope.T @ slope + known
    lasting = colour_of(unit, residual) if lasting is None else lasting
    noise, ripple = known, np.zeros((0, len(at)))
    by_recording = np.zeros((len(unit.model.recorded), count))
    for window, name, rows in problem.parts():
        share = lasting[rows].copy()
        if found is not None:
            floors = problem.floors[window]
            share *= problem.over_sigma(window, name, floors.fit_noise(name)) ** 2
            moved = problem.over_sigma(window, name, found.deviations[window][name]) @ slope[rows]
            ripple = moved if not len(ripple) else ripple + moved
        by_recording[unit.model.windows[window].recording] += np.sum(slope[rows, :count] ** 2, axis=0)
        noise = noise + (slope[rows] * share[:, None]).T @ slope[rows]
    return Linearised(
        parameters=count,
        candidates=candidates,
        curvature=curvature,
        gradient=curvature @ at - slope.T @ residual - known @ at,
        noise=noise,
        ripple=ripple,
        rounds=len(ripple) // TWINS,
        by_recording=by_recording,
        twins=found,
        slope=slope,
    )


def colour_of(unit: Unit, residual: Array) -> Array:
    """How many times above white noise a residual (values,) of a unit is, (values,)."""
    return colour(Data(unit.model.recorded, None, unit.floors, _ALL), unit.model, residual)


def starts_at(unit: Unit, x: Array) -> Array:
    """The starts of a unit's windows that suit its recordings best at x, in σ of the file's tolerances."""
    model, count = unit.model, len(x)
    values = unit.problem.parameters(
        unit.problem.clip(np.concatenate([x / WIDER, np.zeros(unit.problem.count - count)]))
    )
    there = model_for(
        model.recorded, model.actuator.varied(values), stretches=fit_stretches(model.recorded, model.actuator)
    )
    return calibrate(there, unit.floors, free=()).x


def pooled(parts: Sequence[Linearised], freed: Sequence[Sequence[int]] | None = None) -> list[Block]:
    """The blocks of all units, whose ripple is taken to be alike relative to what their recordings tell.

    freed: of each unit, the places of candidates in which its recordings disagree.
    """
    alone = [_without(one, which) for one, which in zip(parts, freed or [()] * len(parts))]
    roots = [_root(curvature) for curvature, _, _, _ in alone]
    freedom = sum(one.rounds * (TWINS - 1) for one in parts)
    ripple = np.zeros_like(roots[0])
    if freedom:
        over = np.concatenate([one @ np.linalg.inv(root) for (_, _, _, one), root in zip(alone, roots)])
        ripple = (1.0 + 1.0 / TWINS) * over.T @ over / freedom  # of the recording itself, and of the twins' mean
    blocks = []
    for (curvature, gradient, noise, _), root in zip(alone, roots):
        scatter = noise + root @ ripple @ root
        weighed = np.asarray(np.linalg.solve(scatter + _NOTHING * np.eye(len(root)), curvature), dtype=float)
        blocks.append(Block(_symmetric(curvature @ weighed), weighed.T @ gradient))
    return blocks


def _without(part: Linearised, freed: Sequence[int]) -> tuple[Array, Array, Array, Array]:
    """Curvature, gradient, noise and ripple of the parameters, once all else has taken what it can of their effect."""
    count, others = part.parameters, part.nuisances(freed)
    known = np.zeros(len(part.curvature))
    known[others[len(others) - len(freed) :]] = 1.0  # as a start's prior
    curvature, noise = part.curvature + np.diag(known), part.noise + np.diag(known)
    taken = np.linalg.solve(curvature[np.ix_(others, others)], curvature[np.ix_(others, range(count))]).T
    without = np.zeros((count, len(known)))
    without[:, :count], without[:, others] = np.eye(count), -taken
    return (
        without @ curvature @ without.T,
        without @ part.gradient,
        without @ noise @ without.T,
        part.ripple @ without.T,
    )


def _root(matrix: Array) -> Array:
    """Its symmetric square root, of full rank."""
    values, vectors = np.linalg.eigh(_symmetric(matrix))
    return (vectors * np.sqrt(np.maximum(values, _NOTHING))) @ vectors.T


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


# --- all units together, with some parameters shared, some freed for a unit, some scattering over all units -----------
# x_u = μ + Σ δ + η_u: μ what the type shares, δ a difference of one unit in one parameter, η_u ~ N(0, diag τ²) where
# all units scatter. Everything is in the file's tolerances, and a sum over units: the cost grows linearly with them.

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
