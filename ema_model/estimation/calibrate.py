"""Calibration within tolerances, what it says, and what is identifiable."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.parameters import on_axes
from ema_model.estimation.least_squares import (
    Combination,
    by_pieces,
    covariance_of,
    descended,
    known_together,
    measured,
    posterior,
)
from ema_model.estimation.noise import CORRELATED_S, DRAWS, Floor, local_rms
from ema_model.estimation.problem import (
    ECCENTRICITY,
    K_SIGMA,
    STARTS,
    Problem,
    Unknown,
    physical_limits,
    polar,
    starts_of,
    unknowns_of,
)
from ema_model.faults import FACTORS, NAMES, named
from ema_model.models import Model
from ema_model.models.model import Signals
from ema_model.quantities import HALF_90, Axes, in_sentence, number, with_uncertainty
from ema_model.result import NAME, as_named
from ema_model.side_by_side import windows
from ema_model.text import Severity, Table

Interval = tuple[float, float]

# --- which of an actuator's free parameters a recording tells of, and which it cannot separate ------------------------
# By the Fisher information of the calibration: F = JᵀJ of the signals over their floors, in units of each parameter's
# own tolerance, so that the covariance beside the prior is (F + 1)⁻¹ (Bayesian Cramér–Rao bound).

_NOTHING = 0.9  # of the prior's σ that is left were all others known, from which on the recording told nothing
_MUCH = 0.45  # of it that is left: n parameters of which only a ratio shows keep 1/√n each
_BY_OTHERS = 3.0  # how many times more is left than were all others known, where they take it up
_TOGETHER = 0.7  # correlation from which on a parameter is named as one of them


@dataclass(frozen=True)
class Told:
    """How far a recording narrows one free parameter."""

    name: str  # "section.parameter"
    left: float  # posterior σ over the tolerance's, 0 … 1
    alone: float  # the same if all others were known
    like: tuple[str, ...]  # free parameters that it trades against, most of all first

    @property
    def is_unseen(self) -> bool:
        """Whether the recording tells nothing of it, even were all else known."""
        return self.alone > _NOTHING

    @property
    def is_confounded(self) -> bool:
        """Whether it shows, but others of its direction take it up."""
        return not self.is_unseen and self.left > max(_MUCH, _BY_OTHERS * self.alone) and bool(self.like)


def told(calibration: Calibration) -> tuple[Told, ...]:
    """One for each free parameter, in the file's order."""
    jacobian = calibration.weighted_jacobian / np.sqrt(calibration.covariance_scale)
    covariance = posterior(jacobian)
    left = np.sqrt(np.diag(covariance))
    alone = 1.0 / np.sqrt(1.0 + np.sum(jacobian**2, axis=0))
    correlation = np.abs(covariance / np.outer(left, left))
    names = calibration.free
    found = []
    for i, name in enumerate(names):
        with_it = correlation[i, : len(names)]
        order = [int(j) for j in np.argsort(-with_it) if j != i and with_it[j] > _TOGETHER]
        found.append(Told(name, float(left[i]), float(alone[i]), tuple(names[j] for j in order)))
    return tuple(found)


# --- what a fit takes up of the difference between its model and the three-phase twin ---------------------------------

Array = NDArray[np.float64]

_OF_TWINS = 0.25  # of the squares that the twins before and after the fit differ by: as much is left of true models


def after_fit(
    floors: Sequence[Floor], calibration: Calibration, twins: Sequence[Signals], taken: Array | None = None
) -> list[Floor]:
    """The floors of a calibration's windows with `left`: what no parameter takes up of the twin's difference t.

    t − J(JᵀJ + I)⁻¹Jᵀt, weighted as the fit was: J are its sensitivities, and I is the prior.  twins: as of
    `twin_error`, by window, with the calibrated parameters; taken: as of `taken_up`, where it is known.  Floors
    without a twin stay as they are.
    """
    taken = taken_up(floors, calibration, twins) if taken is None else taken
    return _floors_left(floors, twins, calibration.weighted_sensitivities, taken)


def taken_up(floors: Sequence[Floor], calibration: Calibration, twins: Sequence[Signals]) -> Array:
    """By how far a calibration is off, as it takes up what its twins differ by: (unknowns, draws), in σ."""
    return _solved(_parts(floors, twins, calibration.weighted_sensitivities), calibration.x.size)


def of_unseen(
    model: Model,
    floors: Sequence[Floor],
    calibration: Calibration,
    taken: Array,
    twins: Sequence[Signals],
    signals: Mapping[str, float],
) -> list[Floor]:
    """Floors of recordings that were not fitted, with `left` as of `after_fit`.

    model: the calibrated one beside them; taken: as of `taken_up`, there; twins: here.  The parameters are off by what
    they took up elsewhere, which moves this model, too; only where it starts is fitted here.
    """
    problem = problem_of(model, floors, free=calibration.free, signals=signals)
    if not problem.count:
        return list(floors)
    _, jacobian = problem.jacobians(np.zeros((1, problem.count)), in_whole_blocks=True)
    slopes = by_window(problem, jacobian[0], weighted=True)
    shared = len(calibration.free)
    moved = np.concatenate([taken[:shared], np.zeros((problem.count - shared, taken.shape[1]))])
    rest = [(place, name, part, own - part @ moved) for place, name, part, own in _parts(floors, twins, slopes)]
    own_starts = [(place, name, part[:, shared:], own) for place, name, part, own in rest]
    moved[shared:] = _solved(own_starts, problem.count - shared)
    return _floors_left(floors, twins, slopes, moved)


# Window, signal; weighted: sensitivities (blocks, unknowns), and the twin's difference (blocks, draws).
_Part = tuple[int, str, Array, Array]


def _parts(floors: Sequence[Floor], twins: Sequence[Signals], slopes: Sequence[Mapping[str, Array]]) -> list[_Part]:
    return [
        (place, name, part[name], (twins[place][name] / floors[place].fit_sigma(name)).T)
        for place, part in enumerate(slopes)
        for name in part
        if name in twins[place]
    ]


def _solved(parts: Sequence[_Part], unknowns: int) -> Array:
    """(JᵀJ + I)⁻¹Jᵀt: (unknowns, draws)"""
    if not parts or not unknowns:
        return np.zeros((unknowns, DRAWS))
    jacobian, twin = (np.concatenate(one) for one in zip(*((j, t) for _, _, j, t in parts)))
    return np.asarray(np.linalg.solve(jacobian.T @ jacobian + np.eye(unknowns), jacobian.T @ twin), dtype=float)


def _floors_left(
    floors: Sequence[Floor], twins: Sequence[Signals], slopes: Sequence[Mapping[str, Array]], taken: Array
) -> list[Floor]:
    """With `left`, where unknowns that are off by `taken` move the model by its weighted sensitivities."""
    if not taken.size:
        return list(floors)
    left: list[dict[str, Array]] = [{} for _ in floors]
    for place, name, part, own in _parts(floors, twins, slopes):
        one = floors[place]
        before, after = (local_rms(t.T * one.fit_sigma(name), one.block_s) for t in (own, own - part @ taken))
        besides = _OF_TWINS * (np.maximum(one.model[name], before) ** 2 - before**2)
        left[place][name] = np.sqrt(besides + np.minimum(before, after) ** 2)
    return [replace(one, left=its) for one, its in zip(floors, left)]


# --- a calibration in words -------------------------------------------------------------------------------------------
# A calibration in words: whether it has converged, what it moved and how surely, what it cannot tell apart.


def convergence(fit: Calibration) -> str:
    """'It has converged after 87 evaluations.'"""
    how = "It has converged" if fit.converged else "It has not converged: its values are not to be trusted,"
    return f"{how} after {fit.evaluations} evaluations."


def calibration_table(fit: Calibration, axes: Axes, among: Collection[str] | None = None) -> Table | None:
    """What each parameter, or some, was in the file and is now, with its interval, and how many σ that is apart."""
    rows, remarks = [], []
    fitted = {path: one for path, one in fit.parameters.items() if among is None or path in among}
    for path, one in fitted.items():
        low, high = (number(edge, 4) for edge in one.interval90)
        moved = f"{round(one.z, 2) + 0.0:+.2f}".replace("-", "−")
        interval = "the file's" if one.from_file else f"{low} … {high}"
        rows.append([_title(path, axes), number(one.initial, 4), number(one.value, 4), interval, moved])
        cut = one.cut and not one.from_file
        said = f"{'  at its bound' if one.at_bound else ''}{'  interval cut at its physical limit' if cut else ''}"
        remarks.append(f"{one.unit}{said}".strip())
    if not rows:
        return None
    state = "converged" if fit.converged else "NOT converged"
    severities: list[Severity | None] = ["bad" if one.at_bound else None for one in fitted.values()]
    head = ("file", "value", "90 % interval", "moved [σ]")
    return Table(head, rows, f"calibration {state}", remarks, severities=severities)


def warnings(fit: Calibration, axes: Axes) -> list[str]:
    """The parameters at their bounds, and those that are only known together, as products where such are known."""
    products = {name for one in fit.identifiable for name in one.powers}
    found = [
        f"{_title(path, axes)} stands at the bound of its tolerance: the model wants more than the file allows."
        for path, one in fit.parameters.items()
        if one.at_bound
    ]
    return [*found, *together(fit, axes)] + [
        f"{_title(a, axes)} and {in_sentence(_title(b, axes))} trade against each other here: "
        "only both together are known."
        for a, b in fit.confounded
        if not {a, b} <= products
    ]


def together(fit: Calibration, axes: Axes) -> list[str]:
    """'Known only together, if the model is right: gain · torque constant / resistance = 0.0230 ± 0.0021. …'"""
    if not fit.identifiable:
        return []
    found = [combination_in_words(one, axes) for one in fit.identifiable]
    silent = "current_A" not in {name for part in fit.weighted_sensitivities for name in part}
    how = "Record the current as well, or measure one of them apart" if silent else "Measure one of them apart"
    return [f"Known only together, if the model is right: {'; '.join(found)}. {how}."]


def combination_in_words(one: Combination, axes: Axes) -> str:
    """'gain · torque constant / resistance = 0.0230 ± 0.0021'"""
    low, high = one.interval90
    return f"{product_in_words(one, axes)} = {with_uncertainty(one.value, 0.5 * (high - low), '')}"


def product_in_words(one: Combination, axes: Axes) -> str:
    """'gain · torque constant / resistance²'; a fault by its factor, '(1 − k3)'."""
    above, below = (
        [
            f"{FACTORS.get(name) or in_sentence(_title(name, axes))}{'²' if abs(power) == 2 else ''}"
            for name, power in one.powers.items()
            if (power > 0) is over
        ]
        for over in (True, False)
    )
    divided = f" / {below[0]}" if len(below) == 1 else f" / ({' · '.join(below)})" if below else ""
    return f"{' · '.join(above)}{divided}"


@dataclass(frozen=True)
class KnownTogether:
    """Parameters that are known only together, as the product of their powers."""

    members: Annotated[dict[str, int], Meta(description="powers by the names in the actuator's file", extra=NAME)]
    combination: Annotated[str, Meta(description="the product in words")]
    value: Annotated[float, Meta(description="of the product, in SI units")]
    interval90: Annotated[Interval, Meta(description="the ends of the 90 % interval about value")]


def combinations(known: Sequence[Combination], axes: Axes) -> list[KnownTogether]:
    """What is known only together, with its words."""
    return [KnownTogether(one.powers, product_in_words(one, axes), one.value, one.interval90) for one in known]


def _title(path: str, axes: Axes) -> str:
    return path if path in NAMES else on_axes(path, axes).title


# --- fits the actuator's parameters to recordings: least squares with the tolerances as a prior -----------------------

_OF_FILE = 0.9  # of the file's σ, that is left where the recordings tell nothing
_OUTSIDE_Z = 2.99  # from which on a parameter stands at the edge of its tolerance
_AS_IN_THE_FILE = 0.05  # σ, up to which a parameter is where it was
_DRAWN = 192  # of the prior, from which further starts are taken
_STARTS = 5
_MISFIT = 25.0  # χ² per value, from which on the model misses by far


@dataclass(frozen=True)
class Calibrated:
    """A calibrated parameter, in its `unit`."""

    value: Annotated[float, Meta(description="what was found")]
    initial: Annotated[float, Meta(description="what the actuator's file says")]
    interval90: Interval
    unit: Annotated[str, Meta(description="of value, initial and interval90; empty for a ratio")]
    z: Annotated[float, Meta(description="value − initial, in σ of the file's tolerance")]
    at_bound: Annotated[bool, Meta(description="whether the fit ended at the end of what is allowed")]
    spread: float | None = None  # 1 σ of the value before its interval was cut; half the interval's own without it
    cut: bool = False  # whether the interval ends where the parameter's physics does
    from_file: Annotated[
        bool, Meta(description="whether the recordings tell nothing beyond the file's tolerance, its interval's")
    ] = False

    @property
    def told90(
        self,
    ) -> Annotated[
        Interval | None, as_named("interval90", "the ends of the 90 % interval about value; null: see from_file")
    ]:
        """The interval, where it is the recordings'."""
        return None if self.from_file else self.interval90

    @property
    def sigma(self) -> float:
        """1 σ of the value, in its unit."""
        low, high = self.interval90
        return 0.5 * (high - low) / HALF_90 if self.spread is None else self.spread


@dataclass(frozen=True, eq=False)
class Calibration:
    """The fit of the actuator's parameters within their tolerances, and what it leaves."""

    converged: Annotated[bool, Meta(description="whether several starts end in the same minimum")]
    parameters: Annotated[
        dict[str, Calibrated],
        Meta(description="by the names in the actuator's file, section.name, and k1 … k8", extra=NAME),
    ]
    starts: Annotated[  # of the windows: "turned 0" and "play 0", rad at the motor, "faster 0", rad/s
        dict[str, Calibrated],
        Meta(
            description="of the recordings: turned N is the motor's offset at the start, faster N its speed's, pull N "
            "that of the torque that its drive asked for, play N where in the backlash it was, lag N by how much later "
            "than the positions the current was recorded"
        ),
    ]
    actuator: Actuator  # with the fitted values, and with k for its faults
    k: Array  # (8,)
    residual: Array  # (values,), model − measurement over the floor that weights the fit
    chi2_per_value: float  # of the signals over the floor they are weighted by
    covariance_scale: float  # by which what the model misses widens all intervals' squares
    signals: list[dict[str, Array]]  # the fitted model's, per window, (blocks,) each
    before: list[dict[str, Array]]  # the file's own model's
    sensitivities: list[dict[str, Array]]  # per window and fitted signal: ∂signal/∂x, (blocks, unknowns)
    weighted_sensitivities: list[dict[str, Array]]  # the same over the floor that weights the fit
    x: Array  # (unknowns,), the fitted values, in σ from the file's
    room: tuple[Array, Array]  # (unknowns,) each, how far x may still go down and up, in σ
    evaluations: Annotated[int, Meta(description="how many times the recordings were simulated")]
    confounded: Annotated[  # pairs that trade against each other
        tuple[tuple[str, str], ...],
        Meta(description="pairs of parameters that are known only together", extra=NAME),
    ]
    identifiable: tuple[Combination, ...]  # what is known only together, of parameters that are hardly known alone
    free: tuple[str, ...]
    is_final: bool = True  # it went to its end, and its intervals are the recordings'

    def start_of(self, window: int | None) -> tuple[float, float, float, float]:
        """How a fitted window began beyond what was measured; 0 if unknown.

        The motor's angle and its place in the play, rad at the motor, its speed, rad/s, and the torque that its drive
        asked for, N·m.
        """
        found = (self.starts.get(f"{kind} {window}") for kind in STARTS)
        turned, play, faster, pull = (0.0 if one is None else one.value for one in found)
        return turned, play, faster, pull

    @property
    def as_result(self) -> Calibration:
        """The same as a fit's result: the tolerances of its actuator are the σ found, and so are those of its file.

        A parameter at a bound keeps its tolerance: its interval says nothing of where it would have gone.
        """
        sigmas = {name: one.sigma for name, one in self.parameters.items() if not one.at_bound}
        return replace(self, actuator=self.actuator.with_fitted_sigmas(sigmas))

    @property
    def weighted_jacobian(self) -> Array:
        """`weighted_sensitivities` below each other, beside `residual`: (values, unknowns)."""
        return np.concatenate([part[name] for part in self.weighted_sensitivities for name in part])

    @property
    def outside_tolerance(
        self,
    ) -> Annotated[tuple[str, ...], Meta(description="parameters that end at the edge of their tolerance", extra=NAME)]:
        """Parameters that stand at 3 σ of their tolerance, or would go beyond."""
        return tuple(name for name, one in self.parameters.items() if abs(one.z) > _OUTSIDE_Z)


def calibrate(
    model: Model,
    floors: Sequence[Floor],
    *,
    free: Sequence[str] | None = None,
    k: ArrayLike | None = None,
    signals: Mapping[str, float] | None = None,
    start: Mapping[str, float] | None = None,
    on_progress: Callable[[int], None] | None = None,
    final: bool = True,
    rough: bool = False,
) -> Calibration:
    """Fits the free parameters ("section.name", "effects.name.parameter", or k1…k8), and each window's start.

    signals: those to fit, with weights; without it, current and positions as their floors say.
    k: that do not move; without it, the actuator's own.
    free: what may move; without it, every parameter that the actuator's file leaves free.
    Two starts or more; the best is kept, and the fit has converged when it ended before its limit and two agree.
    start: x by name, from an earlier fit, from which alone this one begins.
    on_progress is told the evaluations so far, and may raise to stop.
    final: whether its intervals are told; else directions that are hardly known are not simulated for them.
    rough: the start is near the end, and half a unit of χ² less would change nothing; it is then not final.
    Raises InputError for a parameter that does not exist or has no tolerance.
    """
    final = final and not rough
    problem = problem_of(model, floors, free=free, k=k, signals=signals)
    search = _Search(problem, on_progress, rough)
    fit = search.solve(start)
    x = fit.x
    chi2 = fit.chi2
    scale = max(1.0, chi2)
    if chi2 > _MISFIT:  # errors of a wrong model last
        scale *= max(1.0, CORRELATED_S / min(one.block_s for one in floors))
    jacobian = measured(problem, x, fit.jacobian, scale) if final else fit.jacobian
    covariance = covariance_of(jacobian) * scale
    fitted_k = problem.k(x)
    actuator = replace(model.actuator.varied(problem.parameters(x)), faults=named(fitted_k))
    found = calibrated(problem, x, covariance)
    chosen = tuple(u.name for u in problem.unknowns if u.kind in ("parameter", "fault"))
    shown, before = _signals(problem, np.array([x, np.zeros(len(x))]))
    return Calibration(
        converged=fit.converged,
        parameters={name: found[name] for name in chosen},
        starts={name: one for name, one in found.items() if name not in chosen},
        actuator=actuator,
        k=fitted_k,
        residual=fit.residual,
        chi2_per_value=chi2,
        covariance_scale=scale,
        signals=shown,
        before=before,
        sensitivities=by_window(problem, jacobian, weighted=False),
        weighted_sensitivities=by_window(problem, jacobian, weighted=True),
        x=x,
        room=(problem.low - x, problem.high - x),
        evaluations=search.evaluations,
        confounded=_confounded(problem.unknowns, covariance),
        identifiable=_products(problem, x, covariance, jacobian[: problem.values], fit.residual) if final else (),
        free=chosen,
        is_final=final,
    )


def problem_of(
    model: Model,
    floors: Sequence[Floor],
    *,
    free: Sequence[str] | None = None,
    k: ArrayLike | None = None,
    signals: Mapping[str, float] | None = None,
) -> Problem:
    """What `calibrate` solves, and raises for."""
    chosen = unknowns_of(model.actuator, default_free(model.actuator) if free is None else free)
    starts = starts_of(model, floors, worn="k2" in [u.name for u in chosen])
    return Problem(model, floors, [*chosen, *starts], signals, k)


@dataclass(frozen=True, eq=False)
class _Found:
    x: Array
    residual: Array  # (values,)
    jacobian: Array
    chi2: float  # of the signals, per value
    cost: float
    converged: bool


class _Search:
    """Least squares from several starts, until the two best agree."""

    def __init__(self, problem: Problem, on_progress: Callable[[int], None] | None, rough: bool) -> None:
        self.problem, self.rough = problem, rough
        self.on_progress = on_progress
        self.evaluations = 0

    def _tell(self) -> None:
        self.evaluations += 1
        if self.on_progress is not None:
            self.on_progress(self.evaluations)

    def solve(self, start: Mapping[str, float] | None) -> _Found:
        """The best fit; where the model misses by far, one in which large errors count less."""
        count = self.problem.count
        if not count:
            fun = self.problem.residuals(np.zeros((1, 0)))[0]
            return _Found(np.zeros(0), fun, np.zeros((len(fun), 0)), float(fun @ fun) / self.problem.values, 0.0, True)
        if start is not None:
            x = np.array([start.get(u.name, 0.0) for u in self.problem.unknowns])
            return self._from_near(x)
        starts = [np.zeros(count), *_promising(self.problem)]
        found = self._from(starts)
        return self._softened(found, [found.x, *starts]) if found.chi2 > _MISFIT else found

    def _softened(self, found: _Found, starts: Sequence[Array]) -> _Found:
        """With large errors counted less than one that misses by far does; whole again where it does not any more."""
        softened = self._from(starts, _soft(found.chi2))
        if softened.chi2 > _MISFIT:
            return softened
        whole = self._from([softened.x])
        return replace(whole, converged=whole.converged and softened.converged)

    def _from_near(self, x: Array) -> _Found:
        """From an earlier fit's answer: at once with large errors counted less, where it misses by far there."""
        before = self.problem.residuals(self.problem.clip(x)[None, :])[0][: self.problem.values]
        chi2 = float(before @ before) / self.problem.values
        if chi2 > _MISFIT:
            found = self._from([x], _soft(chi2))
            if found.chi2 > _MISFIT:
                return found
            x = found.x
        found = self._from([x])
        return self._softened(found, [found.x]) if found.chi2 > _MISFIT else found

    def _from(self, starts: Sequence[Array], soft: float | None = None) -> _Found:
        fits, agree = [], len(starts) == 1
        for start in starts:
            fits.append(descended(self.problem, start, soft, self._tell, near=self.rough))
            fits.sort(key=lambda fit: fit.cost)
            # "At most a hundredth apart": two minima of the same depth are one answer, and none is deeper than nothing.
            if fits[0].cost < 2.0 or (len(fits) > 1 and fits[1].cost < 1.01 * fits[0].cost + 2.0):
                agree = True
                break
            if soft is None and len(fits) > 1 and 2.0 * fits[0].cost > _MISFIT * self.problem.values:
                break  # it misses by far: what counts large errors less goes through all of the starts
        best = fits[0]
        x = self.problem.clip(best.x)
        residuals, jacobians = self.problem.jacobians(x[None, :])  # the fit's own are weighted by its loss
        fun, jacobian = residuals[0], jacobians[0]
        chi2 = float(fun @ fun - x @ x) / self.problem.values
        return _Found(x, fun[: self.problem.values], jacobian, chi2, best.cost, best.ended and agree)


def _soft(chi2: float) -> float:
    """From how many σ on an error counts less, where the model leaves χ² per value."""
    return float(np.sqrt(chi2)) / 3.0


def _promising(problem: Problem) -> Array:
    """Starts of their own: the best of a population drawn from the prior, (starts, unknowns)."""
    least, greatest = problem.low, problem.high
    drawn = np.random.default_rng(0).standard_normal((_DRAWN, len(least)))
    drawn = np.clip(drawn, np.maximum(0.8 * least, -2.0), np.minimum(0.8 * greatest, 2.0))
    return drawn[np.argsort(np.sum(problem.residuals(drawn) ** 2, axis=1))[:_STARTS]]


def default_free(actuator: Actuator) -> tuple[str, ...]:
    """What the actuator's file leaves free to calibrate."""
    return tuple(path for path, tolerance in actuator.tolerances.items() if tolerance.free)


def _signals(problem: Problem, x: Array) -> list[list[dict[str, Array]]]:
    """The model's at each x (n, unknowns), per window."""
    shown = windows(lambda window: problem.simulate(x, window), range(len(problem.model.windows)))
    return [[{name: values[i] for name, values in one.items()} for one in shown] for i in range(len(x))]


def by_window(problem: Problem, jacobian: Array, *, weighted: bool) -> list[dict[str, Array]]:
    """A Jacobian per window and signal, in the signals' own units unless weighted: (blocks, unknowns) each."""
    parts: list[dict[str, Array]] = [{} for _ in problem.weights]
    for i, name, rows in problem.parts():
        parts[i][name] = jacobian[rows] if weighted else jacobian[rows] / problem.weights[i][name][:, None]
    return parts


def calibrated(problem: Problem, x: Array, covariance: Array, most: float = 1.0) -> dict[str, Calibrated]:
    """What each unknown was found to be, by name; the eccentricity by its size and its angle.

    most: tolerances that one may stay unsure by, since none is less sure than the file itself.
    """
    axes = problem.model.actuator.axes
    found = {}
    for i, u in enumerate(problem.unknowns):
        value = float(u.nominal + u.sigma * x[i])
        half = HALF_90 * u.sigma * min(most, float(np.sqrt(covariance[i, i])))
        at_bound = driven_to_bound(u, float(x[i]))
        unit = on_axes(u.name, axes).unit
        ends, cut = within(value, half, physical_limits(u.name, problem.model.actuator))
        of_file = u.is_base and half > _OF_FILE * HALF_90 * u.sigma and not at_bound
        found[u.name] = Calibrated(value, u.nominal, ends, unit, float(x[i]), at_bound, half / HALF_90, cut, of_file)
    return {**found, **_eccentricity(problem, x, covariance)} if "k6" in found else found


def within(value: float, half: float, limits: tuple[float, float]) -> tuple[tuple[float, float], bool]:
    """The ends of value ± half inside a parameter's physical limits, and whether they were cut there.

    A friction is not negative, and a ratio of static to sliding friction not below 1, however little a recording says.
    """
    low, high = value - half, value + half
    least, most = min(limits[0], value), max(limits[1], value)
    return (max(low, least), min(high, most)), low < least or high > most


def driven_to_bound(unknown: Unknown, x: float) -> bool:
    """Whether x, in σ, ended at a bound.

    What the file gives the value of its bound, as a delay of 0, was driven nowhere by standing there.
    """
    return (x < unknown.low + 0.01 or x > unknown.high - 0.01) and abs(x) > _AS_IN_THE_FILE


def _eccentricity(problem: Problem, x: Array, covariance: Array) -> dict[str, Calibrated]:
    at = [next(i for i, u in enumerate(problem.unknowns) if u.name == name) for name in ("k6", "k7")]
    along, across, size = polar(problem.vector(x)[list(ECCENTRICITY)], K_SIGMA**2 * covariance[np.ix_(at, at)])
    k, file = problem.k(x), problem.model.actuator.k
    turned = float((k[6] - file[6] + 0.5) % 1.0 - 0.5)
    halves = HALF_90 * min(K_SIGMA, along), min(0.5, HALF_90 * across / max(2.0 * np.pi * size, 1e-9))
    scores = float(k[5] - file[5]) / K_SIGMA, 2.0 * np.pi * float(file[5]) * turned / K_SIGMA
    at_bounds = not 0.01 * K_SIGMA < k[5] < 1.0 - 0.01 * K_SIGMA, False
    found = {}
    limits = (0.0, 1.0), (-math.inf, math.inf)  # an angle has none
    for name, i, half, z, at_bound, of in zip(("k6", "k7"), ECCENTRICITY, halves, scores, at_bounds, limits):
        ends, cut = within(float(k[i]), half, of)
        found[name] = Calibrated(float(k[i]), float(file[i]), ends, "", z, bool(at_bound), half / HALF_90, cut)
    return found


def _products(
    problem: Problem, x: Array, covariance: Array, sensitivities: Array, residual: Array
) -> tuple[Combination, ...]:
    """What is known only together, as surely as noise and what is left both allow."""
    scales = [i for i, unknown in enumerate(problem.unknowns) if unknown.is_scale]
    if not scales or not problem.values:
        return ()
    lasting = by_pieces(sensitivities, residual, [(window, rows) for window, _, rows in problem.parts()])
    covariance = covariance + max(lasting, key=np.trace)
    unknowns = [problem.unknowns[i] for i in scales]
    values = np.array([one.nominal + one.sigma * x[i] for i, one in zip(scales, unknowns)])
    sigmas = np.array([one.sigma for one in unknowns])
    return known_together([one.name for one in unknowns], values, sigmas, covariance[np.ix_(scales, scales)])


def _confounded(unknowns: Sequence[Unknown], covariance: NDArray[np.floating]) -> tuple[tuple[str, str], ...]:
    scale = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance / np.outer(scale, scale))
    pairs = [(i, j) for i in range(len(unknowns)) for j in range(i) if correlation[i, j] > 0.95]
    return tuple((unknowns[j].name, unknowns[i].name) for i, j in pairs)
