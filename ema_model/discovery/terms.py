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

from ema_model.discovery.evidence import Unknowns
from ema_model.discovery.fingerprints import Fingerprint, greatest
from ema_model.discovery.result import Candidate
from ema_model.discovery.uncertainty import signals_of
from ema_model.effects import MOTOR, Effect, catalogue_name, find
from ema_model.estimation.model_fit import Data, Fit
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
