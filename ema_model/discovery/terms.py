"""Terms: what may be missing from a model, each as a change of its signals and what is known of it beforehand.

A Term is an effect of the library at settings that its amounts multiply (of a periodic one at an order, by cosine and
sine), a fault of the actuator, or an effect of the file beyond its tolerances.  What is known beforehand comes from the
catalogue and the actuator, never from the recordings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.evidence import Unknowns, evidence_at, evidence_of, gains_of
from ema_model.discovery.fingerprints import Fingerprint, greatest
from ema_model.discovery.result import Candidate
from ema_model.discovery.uncertainty import signals_of
from ema_model.effects import CATALOGUE, MOTOR, Effect, catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation.calibrate import problem_of
from ema_model.estimation.model_fit import Data, Fit, holdout_signals
from ema_model.estimation.noise import NoiseModel
from ema_model.estimation.problem import K_SIGMA, to_k, to_vector
from ema_model.faults import CAUSES, NAMES, cause_of

Array = NDArray[np.float64]

_BEYOND = 10.0  # tolerances of the file, that its own effects may be beyond
_FAULT_SIZES = (0.03, 0.3)  # of a k, that its columns are made with: a straight line and a chord
_TORQUES = ("N·m", "N")
_OWN_TORQUE = 1.692  # N·m, of the motor of which the library's severities are (MODEL §1: 22.5 A × 0.0752)
_LEAST_ENERGY = 25.0  # χ² of a strong case of an effect, below which these recordings cannot show it
_AT_BOUND = 0.02  # σ from it, where a parameter stands at its bound


@dataclass(frozen=True, eq=False)
class Term:
    """What may be missing: settings, or a step of a fault, that its amounts multiply."""

    name: str  # of the catalogue, under its key in the model; of a fault its first k
    unknowns: Unknowns  # its amounts, in the noise model's coefficients
    columns: Array  # what they change of the residual, over the floor: (values, amounts)
    fingerprint: Fingerprint | None = None  # None: of a fault
    step: float = 0.0  # of a fault's k
    log_share: float = 0.0  # of the probability of all its orders, as a logarithm

    def at(self, amounts: Array, found: Fit) -> dict[str, float]:
        """Its settings with these amounts."""
        if self.fingerprint is None:
            return fault_at(to_vector(found.calibration.k), cause_of(self.name), self.step, amounts)[1]
        return settings_at(found, self.fingerprint, amounts)

    def candidate(self, amounts: Array, found: Fit, drop: float = 0.0) -> Candidate:
        """It with these amounts among the candidates; drop: the fall of χ² that is predicted."""
        name = catalogue_name(self.name) if self.fingerprint else self.name
        return Candidate(name, max(0.0, drop), self.at(amounts, found))


def noise_of(data: Data, found: Fit) -> NoiseModel:
    """The noise model of a fit's residual."""
    return NoiseModel.of(signals_of(data, found.plant))


def terms_of(
    data: Data, found: Fit, prints: Sequence[Fingerprint], noise: NoiseModel, orders: Sequence[float]
) -> list[Term]:
    """The Terms of fingerprints, also without what does nothing by default, and of the actuator's faults.

    orders: all that the recordings can show; a periodic effect is as likely at each of them.
    """
    plain = [replace(one, columns=one.columns[:, :1], beside={}) for one in prints if one.beside]
    terms = [_of_print(found, one, noise, orders) for one in [*prints, *plain]]
    terms += [_of_fault(found, *one, noise) for one in _fault_columns(data, found)]
    return [one for one in terms if float(np.max(np.abs(one.unknowns.columns))) > 0.0]


def _of_print(found: Fit, one: Fingerprint, noise: NoiseModel, orders: Sequence[float]) -> Term:
    effect = find(one.name, found.actuator.axes)
    first = effect.parameters[0]
    count = one.columns.shape[1]
    low, high = np.full(count, -np.inf), np.full(count, np.inf)
    if one.frees:
        sigma = np.full(count, _BEYOND)
    else:
        linear = {first.name: one.settings[first.name]} | one.beside
        sigma = np.full(count, max(1.0, abs(strong_case(found, effect) / one.settings[first.name])))
        if len(linear) == count:
            own = {parameter.name: parameter for parameter in effect.parameters}
            for i, (name, value) in enumerate(linear.items()):
                low[i], high[i] = sorted((own[name].low / value, own[name].high / value))
                if i:
                    sigma[i] = 0.5 * (own[name].high - own[name].low) / abs(value)
            if first.low > 0.0:
                low[0], high[0] = 0.0, np.inf
    order = next((own for own in effect.parameters if own.name == "order"), None)
    log_share = 0.0
    if order is not None and order.integer and not one.frees:  # one that is no whole number is found by a refit
        log_share = -math.log(max(1, sum(order.low <= at <= order.high for at in orders)))
    unknowns = Unknowns(noise.coefficients(one.columns), np.zeros(count), sigma, low, high)
    return Term(one.name, unknowns, one.columns, one, log_share=log_share)


def _of_fault(found: Fit, names: tuple[str, ...], step: float, columns: Array, noise: NoiseModel) -> Term:
    known = to_vector(found.calibration.k)[[NAMES.index(name) for name in names]]
    least = -1.0 if len(names) == 2 else 0.0
    low, high = np.sort([(least - known) / step, (1.0 - known) / step], axis=0)
    sigma = np.full(len(names), K_SIGMA / abs(step))
    mean = np.zeros(len(names))
    unknowns = Unknowns(noise.coefficients(columns), mean, sigma, np.minimum(low, 0.0), np.maximum(high, 0.0))
    return Term(names[0], unknowns, columns, step=step)


def hidden(found: Fit, prints: Sequence[Fingerprint]) -> dict[str, str]:
    """Effects that these recordings cannot show at any of their fingerprints, each with the reason.

    What counts is the change in a strong case that the parameters, within their tolerances, cannot make as well.
    """
    its = [one for one in prints if not one.frees]
    if not its:
        return {}
    low, high = found.calibration.room
    jacobian = found.calibration.weighted_jacobian[:, np.minimum(-low, high) > _AT_BOUND]
    gram = jacobian.T @ jacobian + np.eye(jacobian.shape[1])
    columns = np.concatenate([one.columns for one in its], axis=1)
    energies = np.sum(columns * (columns - jacobian @ np.linalg.solve(gram, jacobian.T @ columns)), axis=0)
    ends = np.cumsum([one.columns.shape[1] for one in its])[:-1]
    is_seen: dict[str, bool] = {}
    for one, energy in zip(its, np.split(energies, ends)):
        effect = find(one.name, found.actuator.axes)
        steps = strong_case(found, effect) / one.settings[effect.parameters[0].name]
        is_seen[one.name] = is_seen.get(one.name, False) or float(np.max(energy)) * steps**2 >= _LEAST_ENERGY
    reason = "these recordings cannot show it: what it would change is within the noise"
    return {name: reason for name, seen in is_seen.items() if not seen}


def settings_at(found: Fit, one: Fingerprint, amounts: Array) -> dict[str, float]:
    """A fingerprint's settings where its columns are taken so many times, (columns,).

    Of an effect of the file, amounts are steps of its parameters, in σ of their tolerances.
    """
    effect = find(one.name, found.actuator.axes)
    own = {parameter.name: parameter for parameter in effect.parameters}
    first = effect.parameters[0]
    settings = dict(one.settings)
    if one.frees:
        for path, step in zip(one.frees, amounts):
            name, sigma = path.rpartition(".")[2], found.actuator.tolerances[path].sigma
            settings[name] = own[name].nearest(settings[name] + sigma * float(step))
    elif len(amounts) == 1 + len(one.beside):
        linear = {first.name: settings[first.name]} | one.beside
        if first.low <= 0.0:  # otherwise the parameter is no amplitude
            # A product of the two may come to stand an ulp beyond the range that the amounts keep.
            settings |= {name: own[name].nearest(value * n) for (name, value), n in zip(linear.items(), amounts)}
    else:
        settings[first.name] = first.nearest(settings[first.name] * math.hypot(*amounts))
        settings[effect.phase] = math.atan2(float(amounts[1]), float(amounts[0]))
    return settings


def strong_case(found: Fit, effect: Effect) -> float:
    """A strong case of an effect's first parameter; of one that counts by a signal's size, what this machine may have.

    The library's own machine has other currents, and other torques: a greater motor's teeth pull as much harder.  Of
    friction or inertia that the file has as well, as much again is no more than strong.
    """
    return max(_of_machine(found, effect), _of_file(found, effect))


def _of_file(found: Fit, effect: Effect) -> float:
    """The file's own value of what an effect of the motor adds to, where that has its unit; else 0."""
    first = effect.parameters[0]
    if effect.duplicates == "motor.inertia_kgm2":
        return 1.0  # its share
    unit = first.name.partition("_")[2]
    is_more_of_it = unit and first.side is MOTOR and effect.duplicates.endswith(f"_{unit}")
    return abs(found.calibration.actuator.value(effect.duplicates)) if is_more_of_it else 0.0


def _of_machine(found: Fit, effect: Effect) -> float:
    first = effect.parameters[0]
    if first.side is MOTOR and first.unit in _TORQUES:
        usual = find(effect.name).severities[2]  # of the library's machine
        return max(effect.severities[2], usual * _greatest_torque(found) / _OWN_TORQUE)
    size = greatest(found, first.plausible_at) if first.plausible_at else 0.0
    most = first.plausible[1]
    return max(effect.severities[2], most / size) if most and size else effect.severities[2]


def _greatest_torque(found: Fit) -> float:
    """What the motor gives at most, N·m; of a linear one N; 0 where neither torque nor current is known."""
    constant = found.calibration.actuator.value("motor.torque_constant_Nm_A")
    return max(greatest(found, "motor_torque_Nm"), abs(constant) * greatest(found, "current_A"))


def _fault_columns(data: Data, current: Fit) -> Sequence[tuple[tuple[str, ...], float, Array]]:
    """Of each fault that is not in the model yet: its k, a step of it, and what that changes, over the floor.

    The changes are (values, 1), of an eccentricity (values, 2), as a vector.  Of other actuators there are none.
    """
    if not current.actuator.has_reference_model:
        return ()
    left = [names for names in CAUSES if names[0] not in current.faults]
    known = to_vector(current.calibration.k)
    lanes, tried = [known], []
    for names in left:
        for size in _FAULT_SIZES:
            # From where a fault is known to be almost whole, it can only be less.
            step = size if known[NAMES.index(names[0])] + size <= 1.0 else -size
            tried.append((names, step, range(len(lanes), len(lanes) + len(names))))
            for name in names:
                lanes.append(known.copy())
                lanes[-1][NAMES.index(name)] += step
    k = to_k(np.stack(lanes))
    shown = [
        current.plant.signals(i, current.calibration.actuator, k, *current.calibration.start_of(i))
        for i in range(len(current.plant.windows))
    ]
    signals = np.nan_to_num(data.over_floor(current.plant, shown))
    return tuple((names, step, (signals[its] - signals[0]).T) for names, step, its in tried)


def fault_at(known: Array, names: tuple[str, ...], step: float, amounts: Array) -> tuple[Array, dict[str, float]]:
    """So many steps from what is known, (8,), as far as k may go: the fault's parts, as a vector, and its k."""
    at = [NAMES.index(name) for name in names]
    there = known[at] + step * amounts
    there = there / max(1.0, math.hypot(*there)) if len(names) == 2 else np.clip(there, 0.0, 1.0)
    vector = known.copy()
    vector[at] = there
    k = to_k(vector)
    return there, {name: float(k[i]) for name, i in zip(names, at)}


# --- how probable models are: fitted ones, and by algebra what each Term would make of one ----------------------------
# About a fitted model its signals are straight in its parameters and in the amounts of Terms, in the noise model's
# coefficients; the evidence of either is a few solves.

_FURTHER = 3  # steps of a fitted model by algebra, each from what the one before it gave
_WORTH_A_RUN = 0.5  # of the logarithm of a probability, that a step promises
_CLOSER = 12  # Terms that are looked at with the noise that each leaves


@dataclass(frozen=True, eq=False)
class AboutFit:
    """A fitted model, straight about where it ended, in the noise model's coefficients."""

    unknowns: Unknowns  # steps from there, in σ of the tolerances
    residual: Array  # (values,)

    @classmethod
    def of(cls, found: Fit, noise: NoiseModel) -> AboutFit:
        """Of a fit; what is known of its effects' parameters is the catalogue's, not a refit's tolerance."""
        calibration = found.calibration
        names = [*calibration.parameters, *calibration.starts]
        mean, sigma = -calibration.x.copy(), np.ones(len(names))
        for i, name in enumerate(names):
            if name.startswith("effects."):
                mean[i], sigma[i] = _of_catalogue(found, name)
        low, high = calibration.room
        columns = np.nan_to_num(noise.coefficients(calibration.weighted_jacobian), posinf=0.0, neginf=0.0)
        unknowns = Unknowns(columns, mean, sigma, np.minimum(low, 0.0), np.maximum(high, 0.0))
        return cls(unknowns, noise.coefficients(found.residual))

    def to_mean(self, places: Sequence[int]) -> Array:
        """The step that takes some unknowns to what is expected of them beforehand, (unknowns,)."""
        steps = np.zeros(len(self.unknowns.mean))
        steps[places] = self.unknowns.mean[places]
        return steps

    def without(self, places: Sequence[int]) -> AboutFit:
        """The model with some unknowns held at what is expected of them: an effect at nothing."""
        moved = self.residual + self.unknowns.columns @ self.to_mean(places)
        return AboutFit(self.unknowns.without(places), moved)


def places_of(found: Fit, key: str) -> list[int]:
    """Where the unknowns of one of a fit's effects, or of a fault, stand."""
    names = [*found.calibration.parameters, *found.calibration.starts]
    own = cause_of(key) if key in NAMES else ()
    return [i for i, name in enumerate(names) if name in own or name.startswith(f"effects.{key}.")]


def places_beside(found: Fit) -> list[int]:
    """Where the unknowns stand of further parameters of effects, which do nothing by default."""
    places = []
    for i, name in enumerate([*found.calibration.parameters, *found.calibration.starts]):
        if name.startswith("effects."):
            _, key, own = name.split(".")
            if own in find(key, found.actuator.axes).beside:
                places.append(i)
    return places


def _of_catalogue(found: Fit, path: str) -> tuple[float, float]:
    """What the catalogue says of an effect's parameter: mean and σ, as steps from the fit in its own σ."""
    _, key, own = path.split(".")
    effect = find(key, found.actuator.axes)
    parameter = next(one for one in effect.parameters if one.name == own)
    value, unit = found.calibration.parameters[path].value, found.actuator.tolerances[path].sigma
    if key not in CATALOGUE and catalogue_name(key) not in CATALOGUE:  # a curve's own knots
        return -value / unit, 1.0
    half = 0.5 * (parameter.high - parameter.low)
    half = half if math.isfinite(half) else max(abs(parameter.default), abs(value))
    if own in ANGLES:
        about, spread = value, math.pi / math.sqrt(3.0)
    elif parameter is effect.parameters[0]:
        about = effect.nothing if math.isfinite(effect.nothing) else parameter.default
        spread = max(strong_case(found, effect), abs(effect.severities[2] - about))
    else:
        about, spread = parameter.default, half
    return (about - value) / unit, max(spread / unit, 1e-6)


class Evident(NamedTuple):
    """Of a fitted model, logarithms: how probable it makes the recordings."""

    fitted: float  # those that it was fitted to
    unseen: float  # given these, those that were held out
    density: float  # those that it was fitted to, at its most probable parameters alone

    @property
    def log(self) -> float:
        """All of them."""
        return self.fitted + self.unseen


def evidence_of_fit(data: Data, held: Data | None, found: Fit, noise: NoiseModel) -> Evident:
    """The evidence of a refitted model.

    It is taken where the fit ended, or where the algebra would go from there if that, simulated, is more probable; and
    where it would go from what was simulated, as long as that promises more: two unknowns that count by their product,
    as an inertia and its share, are far from straight.

    A further parameter of an effect, that does nothing by default, is as likely not there.
    """
    whole = AboutFit.of(found, noise)
    problem = problem_of(found.plant, data.floors, free=found.calibration.free, signals=data.signals)

    def about(left_out: Sequence[int]) -> tuple[float, float]:
        own = whole.without(left_out)
        moved = whole.to_mean(left_out)
        free = np.setdiff1d(np.arange(len(moved)), left_out)

        def simulated(amounts: Array) -> Array:
            points = np.tile(found.calibration.x + moved, (len(amounts), 1))
            points[:, free] += amounts
            shown = problem.residuals(problem.clip(points))[:, : problem.values]
            return np.array([noise.coefficients(one) for one in shown])

        there = evidence_of(noise, own.residual, own.unknowns).amounts
        first = np.array([np.zeros(len(there)), there])
        residuals = simulated(first)
        best = max(evidence_at(noise, one, own.unknowns, a) for one, a in zip(residuals, first))
        for _ in range(_FURTHER):
            promised = evidence_of(noise, residuals[-1] - own.unknowns.columns @ there, own.unknowns)
            if promised.log < best[0] + _WORTH_A_RUN:
                break
            there = promised.amounts
            residuals = simulated(there[None, :])
            best = max(best, evidence_at(noise, residuals[-1], own.unknowns, there))
        return best

    log, density = about([])
    beside = places_beside(found)
    if beside:
        plain = about(beside)
        log, density = float(np.logaddexp(log, plain[0])) - math.log(2.0), max(density, plain[1])
    return Evident(log, 0.0 if held is None else log_predictive(held, found), density)


def log_predictive(held: Data, found: Fit) -> float:
    """Logarithm of the probability of recordings that were not fitted."""
    plant = held.plant(found.calibration.actuator)
    shown = held.over_floor(plant, holdout_signals(held, found))
    measured = held.over_floor(plant, [window.measured for window in plant.windows])
    noise = noise_of(held, replace(found, plant=plant))
    left = noise.coefficients(np.nan_to_num(shown - measured, nan=1e6, posinf=1e6, neginf=-1e6))
    return noise.log_likelihood(left, noise.levels(left))


@dataclass(frozen=True, eq=False)
class ScoredTerm:
    """A Term beside a model, by algebra."""

    term: Term
    gain: float  # of the logarithm of the evidence, with what is known of the Term beforehand
    candidate: Candidate
    start: Mapping[str, float]  # of a refit: where the model's own unknowns go beside it, in σ
    change: Array | None = None  # of the model's signals with it, all that follows included, over the floor: (values,)


def scored_terms(found: Fit, terms: Sequence[Term], noise: NoiseModel) -> list[ScoredTerm]:
    """The best variant of each Term beside a model, the most probable first."""
    if not terms:
        return []
    about = AboutFit.of(found, noise)
    own = evidence_of(noise, about.residual, about.unknowns)
    names = [*found.calibration.parameters, *found.calibration.starts]

    def roughly(term: Term, gain: float) -> ScoredTerm:
        start = dict(zip(names, map(float, found.calibration.x)))
        return ScoredTerm(term, gain, term.candidate(np.zeros(len(term.unknowns.mean)), found), start)

    def closer(term: Term) -> ScoredTerm:
        whole = evidence_of(noise, about.residual, about.unknowns.beside([term.unknowns]), own.levels)
        moved, amounts = np.split(whole.amounts, [len(names)])
        drop = float(own.residual @ own.residual - whole.residual @ whole.residual)
        start = dict(zip(names, map(float, found.calibration.x + moved)))
        change = found.calibration.weighted_jacobian @ moved + term.columns @ amounts
        gain = whole.log - own.log + term.log_share
        return ScoredTerm(term, gain, term.candidate(amounts, found, drop), start, change)

    rough = gains_of(noise, own, about.unknowns, [one.unknowns for one in terms]) + [one.log_share for one in terms]
    variants: dict[str, list[int]] = {}
    for i in np.argsort(-rough):
        variants.setdefault(terms[i].name, []).append(int(i))
    scored = []
    for place, its in enumerate(variants.values()):
        looked_at = [closer(terms[i]) for i in its[:2]] if place < _CLOSER else [roughly(terms[its[0]], rough[its[0]])]
        scored.append(max(looked_at, key=lambda one: one.gain))
    return sorted(scored, key=lambda one: -one.gain)
