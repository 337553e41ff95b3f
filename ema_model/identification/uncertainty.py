"""How sure an identification is: whether the model suffices, intervals, and which run would tell more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Annotated

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from scipy.special import chdtri, i0e, stdtrit

from ema_model import faults
from ema_model.actuator.parameters import on_axes
from ema_model.commands import command
from ema_model.errors import InputError
from ema_model.estimation.calibrate import driven_to_bound
from ema_model.estimation.least_squares import Combination, known_together
from ema_model.estimation.noise import CORRELATED_S, Floor, repeats_of, silent
from ema_model.estimation.problem import ECCENTRICITY, K_SIGMA, Problem, polar, to_vector
from ema_model.identification.fit import FAULTS, TWINS, Fitted
from ema_model.identification.search import logged_apart
from ema_model.models import ClosedLoop
from ema_model.quantities import HALF_90, in_sentence, of_signal
from ema_model.recordings import SIGNALS as SIGNAL_NAMES
from ema_model.result import as_named
from ema_model.simulation.run import Run, simulate_monitor

# --- whether the model, with the best k and all that may move, leaves no more than noise and its own floor ------------
# Two kinds of test.  The size of what is left, signal by signal, over what is expected.  And its shape: how much of
# it lies along what missing physics would look like — periodic in the motor's angle, following speed, current,
# position or their signs — beyond what the fitted numbers could take away; each such direction is a χ² test of few
# degrees of freedom, far sharper than the size.

Floating = NDArray[np.floating]

_SIZE = 1.3  # rms of what is left over what is expected, from which on the model has failed
_SLOW = 1.8  # the same of means over the time in which errors last
_SHAPE = 1e-5  # probability of so much along one shape in a model that fits
_ORDERS = 48  # periods in each turn of the motor, up to which its angle is looked at
_EDGE = 2.9  # σ, where a parameter stands at the edge of its tolerance


@dataclass(frozen=True)
class Adequacy:
    """The verdict on a fit."""

    adequate: bool
    ratio: float  # of what is left over what is expected, the worst of all signals and of the worst shape
    reason: str
    uninformative: bool = False  # the recordings tell nothing, whatever model they are held against


def adequacy(found: Fitted) -> Adequacy:
    """Judges a best fit."""
    name, why = silent(found.problem.model.windows, found.problem.floors)
    if why:
        title = in_sentence(SIGNAL_NAMES[name].title)
        return Adequacy(False, 1.0, f"the {title} is constant, or no larger than its floor", uninformative=True)
    sizes = _sizes(found)
    for name, (size, slow) in sizes.items():
        if size > _SIZE or slow > _SLOW:
            ratio = max(size, slow)
            shown = of_signal(name, found.problem.model.actuator.axes)
            left = f"{shown.scaled(rms := _in_unit(found, name)).text(rms)} rms"
            return Adequacy(False, ratio, f"the {in_sentence(shown.title)} is left {ratio:.1f} × its floor ({left})")
    axes = found.problem.model.actuator.axes
    edge = [
        in_sentence(on_axes(one.name, axes).title)
        for one, x in zip(found.problem.unknowns, found.x)
        if abs(x) > _EDGE and one.is_base
    ]
    if edge:
        whose = "its" if len(edge) == 1 else "their"
        return Adequacy(False, 1.0, f"{', '.join(edge)} would have to be outside {whose} tolerance")
    shape, ratio = _worst_shape(found)
    if shape:
        return Adequacy(False, ratio, f"the residual current {shape}")
    return Adequacy(True, max(size for size, _ in sizes.values()), "")


def _sizes(found: Fitted) -> dict[str, tuple[float, float]]:
    """By signal, over all windows: rms over σ, and the same of slow means."""
    whole: dict[str, list[Floating]] = {}
    means: dict[str, list[Floating]] = {}
    for window, name, rows in found.problem.parts():
        values = found.residual[rows]
        count = max(1, round(CORRELATED_S / found.problem.model.windows[window].block_s))
        whole.setdefault(name, []).append(values)
        if len(values) >= 4 * count:
            folded = values[: len(values) // count * count].reshape(-1, count)
            means.setdefault(name, []).append(folded.mean(axis=1) * np.sqrt(count))
    found_sizes = {}
    for name, values in whole.items():
        slow = means.get(name)
        # The weights of the positions count a lasting error as often as it lasts already.
        slow_rms = _rms(slow) if slow and name == "current_A" else 0.0
        found_sizes[name] = (_rms(values), slow_rms)
    return found_sizes


def _in_unit(found: Fitted, signal: str) -> float:
    """rms of what is left of a signal, in its unit, the model's known bias added."""
    parts: list[Floating] = [
        found.residual[rows] / found.problem.over_sigma(window, name, np.ones(rows.stop - rows.start))
        for window, name, rows in found.problem.parts()
        if name == signal
    ]
    return _rms(parts)


def _rms(parts: list[Floating]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def _worst_shape(found: Fitted) -> tuple[str, float]:
    """The most significant shape in what is left of the current, "" if none is; and how large it is over the noise."""
    problem = found.problem
    parts = [part for part in problem.parts() if part[1] == "current_A"]
    rows = np.concatenate([np.arange(part[2].start, part[2].stop) for part in parts])
    residual = found.residual[rows]
    scale = max(1.0, float(np.sqrt(np.mean(residual**2))))
    q, _ = np.linalg.qr(found.slopes)  # the prior's rows hold back what tolerances allow
    q = q[rows]
    shapes = _shapes(found, [part[0] for part in parts])
    worst, least, size = "", _SHAPE / len(shapes), 1.0
    from scipy.special import chdtrc

    for name, columns in shapes:
        columns = columns * np.concatenate(
            [problem.over_sigma(window, "current_A", np.ones(r.stop - r.start)) for window, _, r in parts]
        )[:, None]  # fmt: skip
        own = columns - q @ (q.T @ columns)
        norm = np.linalg.norm(own, axis=0)
        kept = norm > 1e-3 * np.linalg.norm(columns, axis=0) + 1e-12
        if not kept.any():
            continue
        basis, _ = np.linalg.qr(own[:, kept] / norm[kept])
        energy = float(np.sum((basis.T @ residual) ** 2)) / scale**2
        chance = float(chdtrc(basis.shape[1], energy))
        if chance < least:
            worst, least, size = name, chance, np.sqrt(1.0 + energy / len(residual))
    return worst, float(size)


def _shapes(found: Fitted, windows: list[int]) -> list[tuple[str, Floating]]:
    """What missing physics would look like in the current, by name: (blocks, few) each."""
    traces = [found.problem.simulate(found.x[None, :], i) for i in windows]
    blocks = [found.problem.model.windows[i].block_s for i in windows]

    def joined(name: str) -> Floating:
        return np.concatenate([one[name][0] for one in traces])

    angle, speed, current = joined("motor_position_rad"), joined("motor_speed_rad_s"), joined("current_A")
    acceleration = np.concatenate([np.gradient(one["motor_speed_rad_s"][0], b) for one, b in zip(traces, blocks)])
    top = np.max(np.abs(speed)) + 1e-12
    sign = np.tanh(speed / (0.02 * top))
    reversal = np.exp(-((speed / (0.05 * top)) ** 2))
    shapes = [
        ("follows the motor's speed", np.stack([speed, speed * np.abs(speed)], axis=1)),
        ("follows the direction of motion", sign[:, None]),
        ("follows the size of the load", np.stack([np.abs(current) * sign, current], axis=1)),
        ("is constant", np.ones((len(speed), 1))),
        ("follows the position", np.stack([angle - angle.mean(), (angle - angle.mean()) ** 2], axis=1)),
        ("follows the acceleration", acceleration[:, None]),
        ("stands at reversals", np.stack([reversal, reversal * np.sign(acceleration)], axis=1)),
        ("changes with time", np.linspace(-1.0, 1.0, len(speed))[:, None]),
    ]
    for order in range(1, _ORDERS + 1):
        wave = np.stack([np.cos(order * angle), np.sin(order * angle)], axis=1)
        shapes.append((f"repeats {order} times a turn of the motor", wave))
        shapes.append((f"repeats {order} times a turn, in step with the current", wave * current[:, None]))
    return shapes


# --- the run that would tell apart what a recording cannot: each of some commands, judged by what it would add --------

next_experiment_Array = NDArray[np.floating]

_COMMANDS: tuple[tuple[str, dict[str, float], float], ...] = (
    ("chirp", {"amplitude_rad": 0.005}, 0.5),
    ("chirp", {"amplitude_rad": 0.02}, 0.5),
    ("sine", {"amplitude_rad": 0.005, "frequency_Hz": 6.0}, 0.5),
    ("sine", {"amplitude_rad": 0.05, "frequency_Hz": 2.0}, 0.5),
    ("step", {"final_rad": 0.005}, 0.5),
    ("staircase", {"step_rad": 0.002}, 0.5),
)
_STEP_S = 5e-5  # of the model, as exact as an estimate of what a run would tell need be
_CURRENT_A = 0.2  # noise of a block, where the recording does not tell


@dataclass(frozen=True)
class Suggestion:
    """A run, and how much less k would be spread after it."""

    command: str
    settings: dict[str, float]  # of the command; the others are its usual ones
    duration_s: float
    gain: float  # of the σ of the k in question, before over after

    @property
    def options(self) -> str:
        """The run as `emaviz simulate` takes it."""
        chosen = "".join(f" --set {name}={value:g}" for name, value in self.settings.items())
        return f"--command {self.command}{chosen} --duration {self.duration_s:g}"


def separating(found: Fitted, covariance: next_experiment_Array, names: Sequence[str]) -> Suggestion | None:
    """The command after which the k of these names (k1…k8) would be known best; None if none helps."""
    columns = sorted({c for name in names for c in _columns(name)})
    best: Suggestion | None = None
    before = np.sqrt(np.diag(covariance)[columns])
    known = np.linalg.inv(np.linalg.cholesky(covariance))  # rows: kᵀ rowsᵀ rows k is what the recordings tell
    for name, settings, duration in _COMMANDS:
        told = _information(found, Run(command(name, settings), duration))
        if told is None:
            continue
        root = np.linalg.inv(np.linalg.qr(np.concatenate([known, told]), mode="r"))
        after = np.linalg.norm(root, axis=1)[columns]
        gain = float(np.max(before / after))
        if gain > 1.3 and (best is None or gain > best.gain):
            best = Suggestion(name, settings, duration, gain)
    return best


def _columns(name: str) -> tuple[int, ...]:
    return {"k6": (5, 6), "k7": (5, 6), "k8": (7,)}.get(name, (int(name[1]) - 1,))


def _information(found: Fitted, run: Run) -> next_experiment_Array | None:
    """What such a recording would tell of k, its rig's unknowns integrated out: (8, 8), a root of the information."""
    problem = found.problem
    plant = problem.model
    try:
        recording = simulate_monitor(run, plant.actuator, found.k, plant.effects, plant.stack.circuit)
        own = ClosedLoop([recording], plant.actuator, effects=plant.effects, circuit=plant.stack.circuit)
        own = own.at_longer_steps(_STEP_S)
    except (InputError, FloatingPointError):
        return None
    window = own.windows[0]
    typical = problem.floors[0]
    known = typical.model
    noise = {name: typical.noise.get(name, _CURRENT_A) for name in window.measured}
    model = {
        name: np.full(window.blocks, np.sqrt(np.mean(known[name] ** 2)) if name in known else 0.0)
        for name in window.measured
    }
    kept = [one for one in problem.unknowns if one.kind in ("fault", "parameter") or one.place == 0]
    own_floor = Floor(noise, model, repeats_of(window, noise), window.block_s, typical.white)
    own_problem = Problem(own, [own_floor], kept)
    _, slopes = own_problem.jacobians(own_problem.at(found.k)[None, :])
    # The faults last: what is left of them beside the rig's unknowns; normal equations would round it away.
    ordered = np.concatenate([slopes[0][:, FAULTS:], slopes[0][:, :FAULTS] / K_SIGMA], axis=1)
    return np.asarray(np.linalg.qr(ordered, mode="r"))[-FAULTS:, -FAULTS:]


# --- intervals of a number that cannot be negative, from an estimate that can lie anywhere ----------------------------
# An interval k̂ ± 1.645 σ cut off at 0 covers a true 0 too often, and one that follows the data alone too seldom.
# G. J. Feldman and R. D. Cousins, Unified approach to the classical statistical analysis of small signals, Phys. Rev.
# D 57 (1998) 3873–3889, order the outcomes by their likelihood against the best that is allowed, which covers each
# true value equally often.  Everything here is in units of σ.

feldman_cousins_Array = NDArray[np.float64]

_FAR = 6.0  # from here on the bound is not felt
_STEP = 0.02


def above_zero(estimate: float) -> tuple[float, float]:
    """90 % interval of μ ≥ 0 from an estimate that is normal about μ, σ = 1."""
    return _interval("normal", estimate)


def length_of_vector(estimate: float) -> tuple[float, float]:
    """90 % interval of the length of a vector in the plane from the length of its estimate, σ = 1 along each axis."""
    return _interval("rice", max(estimate, 0.0))


def _interval(kind: str, estimate: float) -> tuple[float, float]:
    if estimate >= _FAR:
        return estimate - HALF_90, estimate + HALF_90
    truth, low, high = _belt(kind)
    at = max(estimate, float(low[0]) + 1e-9)
    # the truths that would have given this estimate among their likely ones
    inside = truth[(low <= at) & (at <= high)]
    return float(inside[0]) if inside[0] > truth[0] else 0.0, float(inside[-1])


@lru_cache(maxsize=2)
def _belt(kind: str) -> tuple[feldman_cousins_Array, feldman_cousins_Array, feldman_cousins_Array]:
    """For truths μ (n,): the ends of the likely outcomes, 90 % of them, by the order of the likelihood ratio."""
    truth = np.arange(0.0, _FAR + 4.0, _STEP)
    outcome = np.arange(-4.0 if kind == "normal" else _STEP / 2, _FAR + 9.0, _STEP)
    m, x = truth[:, None], outcome[None, :]
    if kind == "normal":
        likelihood = np.exp(-0.5 * (x - m) ** 2)
    else:
        likelihood = x * np.exp(-0.5 * (x - m) ** 2) * i0e(x * m)
    ratio = likelihood / likelihood.max(axis=0)
    probability = likelihood / likelihood.sum(axis=1, keepdims=True)
    order = np.argsort(-ratio, axis=1, kind="stable")
    taken = np.cumsum(np.take_along_axis(probability, order, axis=1), axis=1)
    count = np.argmax(taken >= 0.9, axis=1) + 1
    ends = [(outcome[order[i, : count[i]]].min(), outcome[order[i, : count[i]]].max()) for i in range(len(truth))]
    low, high = np.array(ends).T
    return truth, np.where(low <= outcome[0], -np.inf, low), high


# --- how sure an identification is: intervals, a joint test of health, and what the data cannot separate --------------
# Everything is linearised at the best fit, in which the base parameters, the starts and unrecorded loads moved with k.
# The covariance is the sandwich H⁻¹ M H⁻¹: H from the weighted derivatives and the tolerances' prior, M from what the
# errors really are — the recordings' white noise, the tolerances, and the twins' deviations, which last.  A few twins
# tell their own spread roughly: what rests on it is widened as Student's t is beyond the normal distribution.

Array = NDArray[np.float64]

_GAIN = 7  # place of the controller's among the faults
_ALARM = 0.01 / 7  # of each of seven k, so that all together give a false one in 1 % of healthy actuators
_ALARM_Z = 2.98  # one-sided, of a k that is healthy at 0
_ALARM_Z_BOTH = 3.19  # two-sided
_ALARM_LENGTH = float(np.sqrt(-2.0 * np.log(_ALARM)))  # of a vector
_INSEPARABLE = 0.9
_WIDE = 0.03  # σ of a k below which it counts as known
_ANY = 0.4  # width of an interval from which on a k is hardly known
_LEAST_SPREAD = 0.02  # of a fit that left the base parameters where they were
_SLIGHT = 2e-5  # least σ: as well as the models' steps in time let any k be told


@dataclass(frozen=True)
class Uncertainty:
    """What the recordings leave open about k.

    k7 is an angle: its interval stands about k7 and may reach beyond 0 or 1; it is 0 … 1 where k6 may be 0.
    """

    interval90: Annotated[  # (8, 2)
        Array, as_named("k_interval90", "the ends of the 90 % interval of each k", dimensions=2)
    ]
    healthy: Annotated[bool, Meta(description="joint test of all k at 1 %")]  # of a model that fits
    alarms: Annotated[  # none where the model does not fit
        tuple[str, ...], Meta(description="names of the k that are surely not healthy")
    ]
    ambiguous: Annotated[
        tuple[tuple[str, ...], ...], Meta(description="groups of k that the recordings cannot separate")
    ]
    hardly_known: Annotated[  # without the angle k7
        tuple[str, ...], Meta(description="k that could be nearly anything")
    ] = ()
    adequate: Annotated[bool, Meta(description="whether the model with this k leaves no more than the floor")] = True
    uninformative: Annotated[bool, Meta(description="whether the recordings tell nothing, whatever the model")] = False
    warnings: Annotated[tuple[str, ...], Meta(description="what the answer must be read with")] = ()
    separated_by: Suggestion | None = None  # the run that would tell the groups apart, and the hardly known
    identifiable: tuple[Combination, ...] = ()  # what is known only together, of k's factors and the parameters
    covariance: Array = field(default_factory=lambda: np.zeros((FAULTS, FAULTS)))  # of k
    detectable: Array = field(default_factory=lambda: np.zeros(8))  # (8,) from healthy, where an alarm begins; k7: NaN
    # Of k with the eccentricity as a vector: the best one without bounds (8,), and its covariance in two parts, what
    # the base parameters do, in σ of each (8, base parameters), and what is this recording's own (8, 8).
    unbounded: Array = field(default_factory=lambda: np.zeros(FAULTS))
    common: Array = field(default_factory=lambda: np.zeros((FAULTS, 0)))
    own: Array = field(default_factory=lambda: np.zeros((FAULTS, FAULTS)))
    sigmas: dict[str, float] = field(default_factory=dict)  # of the parameters beside k, by path; none at a bound

    @property
    def to_run(
        self,
    ) -> Annotated[str, as_named("separated_by", "the run that would tell them, as options of `emaviz simulate`")]:
        """Of `separated_by`; empty without one."""
        return "" if self.separated_by is None else self.separated_by.options


def uncertainty(found: Fitted, k: Array) -> Uncertainty:
    """Intervals and tests of a best fit; the intervals contain the answer k (8,) that is shown.

    Where other basins fit within the floor as well, intervals reach over all of them, and an alarm is one of each.
    """
    basins = [_basin(found, k), *(_basin(one, one.k) for one in found.rivals)]
    best, *others = basins
    interval = best.interval90
    for one in others:
        lower, upper = zip(interval.T, one.interval90.T)
        interval = np.stack([np.minimum(*lower), np.maximum(*upper)], axis=1)
    if interval[5, 0] <= 0.0 or np.ptp(interval[6]) >= 1.0:
        interval[6] = 0.0, 1.0
    groups = _groups(best.covariance)
    hardly = tuple(name for name, width in zip(faults.NAMES, np.ptp(interval, axis=1)) if width > _ANY and name != "k7")
    unclear = [*hardly, *(name for group in groups for name in group)]
    return Uncertainty(
        interval90=interval,
        healthy=best.healthy or any(one.healthy for one in others),
        alarms=tuple(name for name in best.alarms if all(name in one.alarms for one in others)),
        ambiguous=groups,
        hardly_known=hardly,
        adequate=best.fit.adequate,
        uninformative=best.fit.uninformative,
        warnings=(*_warnings(best.fit), *logged_apart(found, best.of_x)),
        separated_by=separating(found, best.covariance, unclear) if unclear else None,
        identifiable=_identifiable([found, *found.rivals], best) if best.fit.adequate else (),
        covariance=best.covariance,
        detectable=_detectable(best),
        unbounded=best.free,
        common=best.common,
        own=best.own,
        sigmas=_sigmas([found, *found.rivals], basins),
    )


@dataclass(frozen=True, eq=False)
class _Basin:
    """What one best fit alone says."""

    of_x: Array  # covariance of all unknowns, in σ of their priors
    covariance: Array  # of the faults, the eccentricity as a vector
    free: Array  # (8,), without bounds
    common: Array  # (8, base parameters), the part of the covariance that all recordings of a unit share
    own: Array  # (8, 8), the other part
    fit: Adequacy
    interval90: Array  # (8, 2)
    healthy: bool
    alarms: tuple[str, ...]


def _basin(found: Fitted, k: Array) -> _Basin:
    of_x = _covariance(found)
    covariance = K_SIGMA**2 * of_x[:FAULTS, :FAULTS]
    fit = adequacy(found)
    if not fit.adequate:  # a misfit says how wrong the model is, and the intervals with it
        covariance = covariance * max(1.0, fit.ratio) ** 2
    free = found.problem.vector(_unbounded(found))
    healthy = _from_healthy(free, covariance) < float(chdtri(FAULTS, 0.01))
    common = K_SIGMA * _of_base(found)[:FAULTS]
    return _Basin(
        of_x,
        covariance,
        free,
        common,
        _positive(covariance - common @ common.T),
        fit,
        _intervals(free, covariance, k),
        bool(healthy and fit.adequate),
        () if healthy or not fit.adequate else _alarms(free, covariance),
    )


def _identifiable(fits: Sequence[Fitted], best: _Basin) -> tuple[Combination, ...]:
    """Products of what faults multiply, and of parameters, that are known far better than any of their factors.

    Where other basins fit as well, as surely as they agree.
    """
    unknowns = fits[0].problem.unknowns
    chosen = [i for i, one in enumerate(unknowns) if one.is_scale or one.name in faults.FACTORS]
    names, sigmas = [unknowns[i].name for i in chosen], np.array([unknowns[i].sigma for i in chosen])
    slopes = faults.factors(fits[0].k)[1]
    for place, i in enumerate(chosen):
        if unknowns[i].kind == "fault":
            sigmas[place] *= slopes[unknowns[i].place]  # of a phase's turns negative: more of k, fewer turns
    values = [_scales(one, names) for one in fits]
    found = known_together(names, values[0], sigmas, best.of_x[np.ix_(chosen, chosen)])
    apart = [
        max(
            abs(sum(power * np.log(each[names.index(name)]) for name, power in one.powers.items()) - np.log(one.value))
            for each in values
        )
        for one in found
    ]
    return tuple(replace(one, relative=one.relative + float(more) / HALF_90) for one, more in zip(found, apart))


def _scales(found: Fitted, names: Sequence[str]) -> Array:
    """What faults multiply and parameters are, as a fit has them, by name: (names,)."""
    of_k = dict(zip(faults.NAMES, faults.factors(found.k)[0]))
    at = {one.name: one.nominal + one.sigma * x for one, x in zip(found.problem.unknowns, found.x)}
    return np.array([of_k.get(name, at.get(name, np.nan)) for name in names])


def _sigmas(fits: Sequence[Fitted], basins: Sequence[_Basin]) -> dict[str, float]:
    """1 σ of each parameter that moved beside the faults, in its unit; its interval reaches over all basins.

    A misfit widens it as it widens k.
    """
    problem, x = fits[0].problem, fits[0].x
    sigmas = {}
    for i, one in enumerate(problem.unknowns):
        if one.kind != "parameter" or driven_to_bound(one, float(x[i])):
            continue
        halves = []
        for fit, basin in zip(fits, basins):
            wider = 1.0 if basin.fit.adequate else max(1.0, basin.fit.ratio)
            halves.append(abs(fit.x[i] - x[i]) + HALF_90 * wider * np.sqrt(basin.of_x[i, i]))
        sigmas[one.name] = float(one.sigma * max(halves) / HALF_90)
    return sigmas


def _covariance(found: Fitted) -> Array:
    """Of x, (unknowns, unknowns), such that z of the normal distribution is right for 90 %."""
    problem, slopes = found.problem, found.slopes
    held, inverse = _curvature(found)
    meat = np.diag(held**4 / problem.prior**2)
    for window, name, rows in problem.parts():
        part = slopes[rows]
        noise = problem.floors[window].fit_noise(name)
        if found.twins is None:  # the model's own error, taken to last as its weight says
            noise = 1.0 / problem.over_sigma(window, name, np.ones(len(noise)))
        weighted = part * problem.over_sigma(window, name, noise)[:, None]
        meat = meat + weighted.T @ weighted
    covariance = inverse @ meat @ inverse + (_SLIGHT / K_SIGMA) ** 2 * np.eye(len(inverse))
    if found.twins is not None:
        scores = _twin_scores(found) @ inverse
        freedom = len(scores) // TWINS * (TWINS - 1)
        of_twins = (1.0 + 1.0 / found.twins.count) * scores.T @ scores / freedom
        covariance += of_twins
        share = np.diag(of_twins) / np.diag(covariance)
        wider = stdtrit(freedom / np.maximum(share, 1e-6) ** 2, 0.95) / HALF_90  # Welch and Satterthwaite's freedom
        covariance *= np.outer(wider, wider)
    return 0.5 * (covariance + covariance.T)


def _curvature(found: Fitted) -> tuple[Array, NDArray[np.floating]]:
    """The weight by which each unknown was held to its prior, and the inverse of the fit's Hessian with it."""
    problem, rows = found.problem, slice(0, found.problem.values)
    held = problem.prior.copy()  # as the fit had it; what is really unknown is the whole tolerance
    held[problem.base] /= np.maximum(found.spreads, _LEAST_SPREAD)
    return held, np.linalg.inv(found.slopes[rows].T @ found.slopes[rows] + np.diag(held**2))


def _of_base(found: Fitted) -> Array:
    """What each base parameter moves x by when it is 1 σ of its tolerance off, (unknowns, base parameters).

    A fit that holds x by H⁻¹ held² moves as much against what is true: it is the same in each recording of a unit.
    """
    held, inverse = _curvature(found)
    base = found.problem.base
    return -inverse[:, base] * (held**2 / found.problem.prior)[base]


def _positive(covariance: Array) -> Array:
    """The nearest covariance: what rounding, and a widening of the whole, left below zero is taken out."""
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    return (vectors * np.maximum(values, _SLIGHT**2)) @ vectors.T


def _twin_scores(found: Fitted) -> Array:
    """What each twin's deviation would move the fit by, before the curvature: (twins, unknowns)."""
    assert found.twins is not None
    total = 0.0
    for window, name, rows in found.problem.parts():
        deviations = found.problem.over_sigma(window, name, found.twins.deviations[window][name])
        total = total + deviations @ found.slopes[rows]
    return np.asarray(total)


def _unbounded(found: Fitted) -> Array:
    """Where x would be without its bounds: a Gauss–Newton step from the fit, the prior as the fit had it."""
    problem, x = found.problem, found.x
    moves = np.ones(problem.count, dtype=bool)
    prior = problem.prior.copy()
    freed = found.spreads > 0.0
    moves[problem.base] = freed
    prior[moves & problem.base] /= found.spreads[freed]
    rows = slice(0, problem.values)
    slopes, residual = found.slopes[rows][:, moves], found.residual[rows]
    hessian = slopes.T @ slopes + np.diag(prior[moves] ** 2)
    gradient = slopes.T @ residual + (prior**2 * x)[moves]
    at_bound = (x <= problem.low + 1e-6) | (x >= problem.high - 1e-6)
    step = np.zeros(problem.count)
    if (at_bound & moves)[:FAULTS].any():  # elsewhere the fit is there already
        step[moves] = -np.linalg.solve(hessian + 1e-9 * np.diag(np.diag(hessian)), gradient)
    return x + step


def _intervals(free: Array, covariance: Array, k: Array) -> Array:
    sigma = np.sqrt(np.diag(covariance))
    interval = np.zeros((8, 2))
    for i in range(5):
        interval[i] = _bounded(free[i], sigma[i])
    gain = free[_GAIN]
    interval[7] = gain - HALF_90 * sigma[_GAIN], gain + HALF_90 * sigma[_GAIN]
    along, across, length = _polar(free, covariance)
    low, high = length_of_vector(length / along)
    interval[5] = low * along, high * along
    interval = np.clip(interval, 0.0, 1.0)
    interval[:, 0], interval[:, 1] = np.minimum(interval[:, 0], k), np.maximum(interval[:, 1], k)
    half = HALF_90 * across / max(length, 1e-9) / (2.0 * np.pi)
    interval[6] = (0.0, 1.0) if interval[5, 0] <= 0.0 or half >= 0.5 else (k[6] - half, k[6] + half)
    return interval


def _bounded(value: float, sigma: float) -> tuple[float, float]:
    """Of a k between 0 and 1, the nearer end counting."""
    if value > 0.5:
        low, high = above_zero((1.0 - value) / sigma)
        return 1.0 - high * sigma, 1.0 - low * sigma
    low, high = above_zero(value / sigma)
    return low * sigma, high * sigma


def _polar(free: Array, covariance: Array) -> tuple[float, float, float]:
    """`polar` of all faults (8,)."""
    return polar(free[list(ECCENTRICITY)], covariance[np.ix_(ECCENTRICITY, ECCENTRICITY)])


def _from_healthy(free: Array, covariance: Array) -> float:
    """χ² by which health fits worse than the best k that can be."""
    from scipy.optimize import lsq_linear  # takes a third of a second to import

    root = np.linalg.inv(np.linalg.cholesky(covariance))
    low = np.array([0.0] * 5 + [-1.0, -1.0, 0.0])
    best = lsq_linear(root, root @ free, bounds=(low, np.ones(FAULTS)))
    healthy = root @ (to_vector(faults.HEALTHY) - free)
    return float(healthy @ healthy - 2.0 * best.cost)


def _alarms(free: Array, covariance: Array) -> tuple[str, ...]:
    sigma = np.sqrt(np.diag(covariance))
    outside = [faults.NAMES[i] for i in range(5) if free[i] > _ALARM_Z * sigma[i]]
    along, _, length = _polar(free, covariance)
    if length > _ALARM_LENGTH * along:
        outside.append("k6")
    if abs(free[_GAIN] - faults.HEALTHY[7]) > _ALARM_Z_BOTH * sigma[_GAIN]:
        outside.append("k8")
    return tuple(outside)


def _detectable(basin: _Basin) -> Array:
    """How far from healthy each k would have to be found for an alarm of its own; an angle has none."""
    sigma = np.sqrt(np.diag(basin.covariance))
    at = list(ECCENTRICITY)
    along = float(np.sqrt(np.linalg.eigvalsh(basin.covariance[np.ix_(at, at)])[-1]))  # in whatever direction
    return np.array([*(_ALARM_Z * sigma[:5]), _ALARM_LENGTH * along, np.nan, _ALARM_Z_BOTH * sigma[_GAIN]])


def _groups(covariance: Array) -> tuple[tuple[str, ...], ...]:
    """k that trade against each other: strongly correlated and, each, poorly known."""
    names = [*faults.NAMES[:5], "k6", "k6", "k8"]
    sigma = np.sqrt(np.diag(covariance))
    correlation = np.abs(covariance / np.outer(sigma, sigma))
    groups: list[set[str]] = []
    for i in range(FAULTS):
        for j in range(i):
            if correlation[i, j] > _INSEPARABLE and min(sigma[i], sigma[j]) > _WIDE and names[i] != names[j]:
                touching = [g for g in groups if names[i] in g or names[j] in g]
                groups = [g for g in groups if g not in touching] + [set.union({names[i], names[j]}, *touching)]
    return tuple(tuple(sorted(group)) for group in groups)


def _warnings(fit: Adequacy) -> tuple[str, ...]:
    if fit.adequate:
        return ()
    if fit.uninformative:
        return (f"The recordings tell nothing of the faults: {fit.reason}.",)
    return (
        f"The model does not fit, whatever k: {fit.reason}. What is found here may stand in for physics that the model "
        "lacks; Discover, on the same recordings, looks for it.",
    )
