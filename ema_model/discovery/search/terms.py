"""Terms: what may be missing from a model, each as a change of its signals and what is known of it beforehand.

A Term is an effect of the library at settings that its amounts multiply (of a periodic one at an order, by cosine and
sine), a fault of the actuator, or an effect of the file beyond its tolerances.  What is known beforehand comes from the
catalogue and the actuator, never from the recordings.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.candidates.faults import fault_columns
from ema_model.discovery.candidates.fingerprints import Fingerprint
from ema_model.discovery.candidates.score import strong_case
from ema_model.discovery.evidence.counted import signals_of
from ema_model.discovery.result import Candidate
from ema_model.discovery.search.evidence import Unknowns
from ema_model.effects import CATALOGUE, catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation.model_fit import Data, Fit
from ema_model.estimation.noise import NoiseModel
from ema_model.estimation.problem import K_SIGMA, to_k, to_vector
from ema_model.faults import NAMES, cause_of

Array = NDArray[np.float64]

_BEYOND = 10.0  # tolerances of the file, that its own effects may be beyond


@dataclass(frozen=True, eq=False)
class Term:
    """What may be missing, with settings that its amounts multiply."""

    name: str  # of the catalogue, under its key in the model; of a fault its first k
    settings: dict[str, float]
    unknowns: Unknowns  # its amounts, (values, amounts)
    log_share: float  # of the probability of all its orders, as a logarithm
    beside: dict[str, float]  # of further amounts: what they multiply
    kind: str = "effect"  # "fault", "file"

    def at(self, amounts: Array, found: Fit) -> dict[str, float]:
        """Its settings with these amounts."""
        if self.kind == "fault":
            return _fault_at(self, amounts, found)
        effect = find(self.name, found.actuator.axes)
        own = {parameter.name: parameter for parameter in effect.parameters}
        first = effect.parameters[0]
        settings = dict(self.settings)
        if self.kind == "file":
            paths = [path for path in found.calibration.parameters if path.startswith(f"effects.{self.name}.")]
            for path, amount in zip(paths, amounts):
                name = path.rpartition(".")[2]
                settings[name] = own[name].nearest(settings[name] + found.actuator.tolerances[path].sigma * amount)
        elif effect.phase and len(amounts) == 2:
            settings[first.name] = first.nearest(settings[first.name] * math.hypot(*amounts))
            settings[effect.phase] = math.atan2(float(amounts[1]), float(amounts[0]))
        elif first.low <= 0.0:  # otherwise the parameter is no amplitude
            linear = {first.name: settings[first.name]} | self.beside
            settings |= {
                name: own[name].nearest(value * amount) for (name, value), amount in zip(linear.items(), amounts)
            }
        return settings


def noise_of(data: Data, found: Fit) -> NoiseModel:
    """The noise model of a fit's residual."""
    return NoiseModel.of(signals_of(data, found.plant))


def unknowns_of_fit(found: Fit, noise: NoiseModel) -> Unknowns:
    """A fit's own unknowns, as steps from where it ended, in σ of their tolerances.

    What is known of an effect's parameters is the catalogue's, not the tolerance that its refit began with.
    """
    calibration = found.calibration
    names = [*calibration.parameters, *calibration.starts]
    mean, sigma = -calibration.x.copy(), np.ones(len(names))
    for i, name in enumerate(names):
        if name.startswith("effects."):
            mean[i], sigma[i] = _of_catalogue(found, name)
    low, high = calibration.room
    columns = np.nan_to_num(noise.coefficients(calibration.weighted_jacobian), posinf=0.0, neginf=0.0)
    return Unknowns(columns, mean, sigma, np.minimum(low, 0.0), np.maximum(high, 0.0))


def of_parts(found: Fit, key: str) -> list[int]:
    """Where the unknowns of one of a fit's effects, or of a fault, stand."""
    names = [*found.calibration.parameters, *found.calibration.starts]
    own = cause_of(key) if key in NAMES else ()
    return [i for i, name in enumerate(names) if name in own or name.startswith(f"effects.{key}.")]


def idle_parts(found: Fit) -> list[int]:
    """Where the unknowns stand of further parameters of effects, which do nothing by default."""
    names = [*found.calibration.parameters, *found.calibration.starts]
    places = {}
    for i, name in enumerate(names):
        if name.startswith("effects."):
            _, key, own = name.split(".")
            if own in find(key, found.actuator.axes).beside:
                places[i] = name
    return [*places]


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


def terms_of(data: Data, found: Fit, prints: Sequence[Fingerprint], noise: NoiseModel) -> list[Term]:
    """The Terms of fingerprints and of the actuator's faults, beside a fit."""
    effects = [_of_print(found, one, noise) for one in prints]
    effects += [_plain(one) for one in effects if one.beside]
    faults = [_of_fault(found, *one, noise) for one in fault_columns(data, found)]
    every = [one for one in [*effects, *faults] if float(np.max(np.abs(one.unknowns.columns))) > 0.0]
    orders = Counter(name for name, _ in {(one.name, one.settings["order"]) for one in every if _is_at_an_order(one)})
    return [replace(one, log_share=-math.log(orders[one.name])) if _is_at_an_order(one) else one for one in every]


def _is_at_an_order(term: Term) -> bool:
    """Whether its order is one of several, each as likely as the others; what else varies is found by a refit."""
    if "order" not in term.settings or term.kind != "effect":
        return False
    return next(one for one in find(term.name).parameters if one.name == "order").integer


def candidate_of(term: Term, amounts: Array, found: Fit, drop: float) -> Candidate:
    """A Term with these amounts among the candidates; drop: the fall of χ² that is predicted."""
    return Candidate(name_of(term.name), max(0.0, drop), term.at(amounts, found))


def _of_print(found: Fit, one: Fingerprint, noise: NoiseModel) -> Term:
    effect = find(one.name, found.actuator.axes)
    first = effect.parameters[0]
    count = one.columns.shape[1]
    low, high = np.full(count, -np.inf), np.full(count, np.inf)
    sigma = np.ones(count)
    kind = "effect"
    if one.frees:
        sigma[:] = _BEYOND
        kind = "file"
    else:
        linear = {first.name: one.settings[first.name]} | one.beside
        sigma[:] = max(1.0, abs(strong_case(found, effect) / one.settings[first.name]))
        if not (effect.phase and count == 2 and not one.beside):
            own = {parameter.name: parameter for parameter in effect.parameters}
            for i, (name, value) in enumerate(linear.items()):
                low[i], high[i] = sorted((own[name].low / value, own[name].high / value))
                if i:
                    sigma[i] = 0.5 * (own[name].high - own[name].low) / abs(value)
            if first.low > 0.0:
                low[0], high[0] = 0.0, np.inf
    unknowns = Unknowns(noise.coefficients(one.columns), np.zeros(count), sigma, low, high)
    return Term(one.name, dict(one.settings), unknowns, 0.0, dict(one.beside), kind)


def _plain(term: Term) -> Term:
    """Without what does nothing by default."""
    return replace(term, unknowns=term.unknowns.without([*range(1, len(term.unknowns.mean))]), beside={})


def _of_fault(found: Fit, names: tuple[str, ...], step: float, columns: Array, noise: NoiseModel) -> Term:
    known = to_vector(found.calibration.k)[[NAMES.index(name) for name in names]]
    least = -1.0 if len(names) == 2 else 0.0
    ends = np.sort([(least - known) / step, (1.0 - known) / step], axis=0)
    sigma = np.full(len(names), K_SIGMA / abs(step))
    unknowns = Unknowns(
        noise.coefficients(columns), np.zeros(len(names)), sigma, np.minimum(ends[0], 0.0), np.maximum(ends[1], 0.0)
    )
    return Term(names[0], dict.fromkeys(names, step), unknowns, 0.0, {}, "fault")


def _fault_at(term: Term, amounts: Array, found: Fit) -> dict[str, float]:
    vector = to_vector(found.calibration.k)
    places = [NAMES.index(name) for name in term.settings]
    there = vector[places] + np.array(list(term.settings.values())) * amounts
    vector[places] = there / max(1.0, math.hypot(*there)) if len(places) == 2 else np.clip(there, 0.0, 1.0)
    k = to_k(vector)
    return {name: float(k[place]) for name, place in zip(term.settings, places)}


def name_of(key: str) -> str:
    """The catalogue's name of an effect in a model; a fault's own."""
    return key if key in NAMES else catalogue_name(key)
