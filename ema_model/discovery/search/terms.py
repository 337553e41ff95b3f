"""Terms: what may be missing from a model, each as a change of its signals and what is known of it beforehand.

A Term is an effect of the library at settings that its amounts multiply (of a periodic one at an order, by cosine and
sine), a fault of the actuator, or an effect of the file beyond its tolerances.  What is known beforehand comes from the
catalogue and the actuator, never from the recordings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.candidates.faults import fault_at, fault_columns
from ema_model.discovery.candidates.fingerprints import Fingerprint
from ema_model.discovery.candidates.score import settings_at, strong_case
from ema_model.discovery.evidence.counted import signals_of
from ema_model.discovery.result import Candidate
from ema_model.discovery.search.evidence import Unknowns
from ema_model.effects import CATALOGUE, catalogue_name, find
from ema_model.effects.effect import ANGLES
from ema_model.estimation.model_fit import Data, Fit
from ema_model.estimation.noise import NoiseModel
from ema_model.estimation.problem import K_SIGMA, to_vector
from ema_model.faults import NAMES, cause_of

Array = NDArray[np.float64]

_BEYOND = 10.0  # tolerances of the file, that its own effects may be beyond


@dataclass(frozen=True, eq=False)
class Term:
    """What may be missing: settings, or a step of a fault, that its amounts multiply."""

    name: str  # of the catalogue, under its key in the model; of a fault its first k
    unknowns: Unknowns  # its amounts, (values, amounts)
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


def terms_of(
    data: Data, found: Fit, prints: Sequence[Fingerprint], noise: NoiseModel, orders: Sequence[float]
) -> list[Term]:
    """The Terms of fingerprints, also without what does nothing by default, and of the actuator's faults.

    orders: all that the recordings can show; a periodic effect is as likely at each of them.
    """
    plain = [replace(one, columns=one.columns[:, :1], beside={}) for one in prints if one.beside]
    terms = [_of_print(found, one, noise, orders) for one in [*prints, *plain]]
    terms += [_of_fault(found, *one, noise) for one in fault_columns(data, found)]
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
    return Term(one.name, unknowns, one, log_share=log_share)


def _of_fault(found: Fit, names: tuple[str, ...], step: float, columns: Array, noise: NoiseModel) -> Term:
    known = to_vector(found.calibration.k)[[NAMES.index(name) for name in names]]
    least = -1.0 if len(names) == 2 else 0.0
    low, high = np.sort([(least - known) / step, (1.0 - known) / step], axis=0)
    sigma = np.full(len(names), K_SIGMA / abs(step))
    mean = np.zeros(len(names))
    unknowns = Unknowns(noise.coefficients(columns), mean, sigma, np.minimum(low, 0.0), np.maximum(high, 0.0))
    return Term(names[0], unknowns, step=step)
