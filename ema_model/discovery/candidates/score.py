"""The score test: how much of the error each fingerprint would take away, before any refit.

A fingerprint counts only as far as the calibrated parameters, within their prior, cannot do the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ema_model.discovery.candidates.fingerprints import Fingerprint
from ema_model.discovery.candidates.let_go import Freed, at_bounds, let_go
from ema_model.discovery.evidence.extents import greatest
from ema_model.discovery.result import Candidate
from ema_model.effects import MOTOR, Effect, find
from ema_model.estimation.model_fit import Fit

Array = NDArray[np.float64]

_TORQUES = ("N·m", "N")
_OWN_TORQUE = 1.692  # N·m, of the motor of which the library's severities are (MODEL §1: 22.5 A × 0.0752)
_LEAST_ENERGY = 25.0  # χ² of a strong case of the effect, below which these recordings cannot show it


def scored(found: Fit, prints: Sequence[Fingerprint]) -> list[Candidate]:
    """A candidate for each effect, at the best of its variants, the most promising first."""
    best: dict[str, Candidate] = {}
    for candidate in scored_all(found, prints):
        other = best.get(candidate.name)
        if other is None or candidate.predicted_drop > other.predicted_drop:
            best[candidate.name] = candidate
    return sorted(best.values(), key=lambda candidate: -candidate.predicted_drop)


def hidden(found: Fit, prints: Sequence[Fingerprint]) -> dict[str, str]:
    """Effects that these recordings cannot show at any of their fingerprints, each with the reason."""
    its = [one for one in prints if not one.frees]
    reasons: dict[str, list[str]] = {}
    for one, beyond in zip(its, _beyond_all(*movable(found), [one.columns for one in its])):
        reasons.setdefault(one.name, []).append(unseen(one.columns.T @ beyond, _strong_steps(found, one)))
    return {name: said[0] for name, said in reasons.items() if all(said)}


def scored_all(found: Fit, prints: Sequence[Fingerprint]) -> list[Candidate]:
    """A candidate for each fingerprint, in their order."""
    usual = movable(found)
    beyond = _beyond_all(*usual, [one.columns for one in prints if not one.frees])
    return [
        _scored(found, one, *movable(found, one.frees))
        if one.frees
        else _scored(found, one, *usual, next(beyond), let_go(found, one.columns))
        for one in prints
    ]


def signatures(found: Fit, prints: Mapping[str, Sequence[Fingerprint]]) -> dict[str, Array]:
    """What the best of each effect's fingerprints would take from measurement − model, over the floor: (values,).

    At the strength that suits best, and only what the parameters cannot do as well.
    """
    beyond = _beyond_all(*movable(found), [one.columns for its in prints.values() for one in its if not one.frees])
    told = {}
    for name, its in prints.items():
        parts = []
        for one in its:
            own = beyond_of(*movable(found, one.frees), one.columns) if one.frees else next(beyond)
            freed = None if one.frees else let_go(found, one.columns)
            parts.append(own @ np.linalg.lstsq(own, -found.residual, rcond=None)[0] if freed is None else freed.change)
        told[name] = min(parts, key=lambda part: float(np.sum((found.residual + part) ** 2)))
    return told


def scored_together(found: Fit, prints: Sequence[Fingerprint], most: int) -> list[Candidate]:
    """Up to `most` fingerprints that tell most beside each other, each scored beside those before it."""
    jacobian, _ = movable(found)
    prior = np.ones(jacobian.shape[1])
    left = list(prints)
    chosen: list[Candidate] = []
    while left and len(chosen) < most:
        gram = jacobian.T @ jacobian + np.diag(prior)
        beyond = _beyond_all(jacobian, gram, [one.columns for one in left])
        candidates = [_scored(found, one, jacobian, gram, own) for one, own in zip(left, beyond)]
        best = int(np.argmax([candidate.predicted_drop for candidate in candidates]))
        chosen.append(candidates[best])
        columns = left.pop(best).columns
        jacobian = np.concatenate([jacobian, columns], axis=1)
        prior = np.concatenate([prior, np.zeros(columns.shape[1])])
    return chosen


def scored_beside(found: Fit, prints: Sequence[Fingerprint], known: Sequence[Candidate]) -> list[Candidate]:
    """Fingerprints scored beside some that are taken to be in the model, the known ones among them as nothing."""
    jacobian, _ = movable(found)
    orders = {one.settings["order"] for one in known}
    taken = [one.columns for one in prints if one.settings["order"] in orders]
    count = jacobian.shape[1]
    jacobian = np.concatenate([jacobian, *taken], axis=1)
    gram = jacobian.T @ jacobian + np.diag(np.r_[np.ones(count), np.full(jacobian.shape[1] - count, 1e-6)])
    left = found.residual - jacobian @ np.linalg.solve(gram, jacobian.T @ found.residual)
    beside = replace(found, calibration=replace(found.calibration, residual=left))
    beyond = _beyond_all(jacobian, gram, [one.columns for one in prints])
    return [_scored(beside, one, jacobian, gram, own) for one, own in zip(prints, beyond)]


def movable(found: Fit, but: Sequence[str] = ()) -> tuple[Array, Array]:
    """J = ∂residual/∂x of the parameters that do not stand at a bound, (values, unknowns), and JᵀJ with the prior.

    but: parameters that are left out.
    """
    free = ~at_bounds(found)
    free &= np.isin([*found.calibration.parameters, *found.calibration.starts], but, invert=True)
    jacobian = found.calibration.weighted_jacobian[:, free]
    return jacobian, jacobian.T @ jacobian + np.eye(jacobian.shape[1])


def beyond_of(jacobian: Array, gram: Array, columns: Array) -> Array:
    """What of some columns the parameters cannot do; gram: JᵀJ with the prior's weights."""
    return columns - jacobian @ np.linalg.solve(gram, jacobian.T @ columns)


def _beyond_all(jacobian: Array, gram: Array, columns: Sequence[Array]) -> Iterator[Array]:
    """The same of many, solved together."""
    if columns:
        widths = np.cumsum([one.shape[1] for one in columns])
        yield from np.split(beyond_of(jacobian, gram, np.concatenate(columns, axis=1)), widths[:-1], axis=1)


def amounts_of(
    found: Fit, columns: Array, jacobian: Array, gram: Array, beyond: Array | None = None
) -> tuple[Array, Array, Array]:
    """How much of some columns the residual asks for beyond what the parameters can do, and what that is worth.

    The amounts a (columns,), and E and t, such that χ² falls by 2 a·t − a·E·a with any amounts.
    beyond: what of the columns the parameters cannot do, if it is known.
    """
    own = beyond_of(jacobian, gram, columns) if beyond is None else beyond
    energy = columns.T @ own
    toward = -(own.T @ found.residual)  # the residual is model − measurement
    ridge = energy + 1e-9 * (np.trace(energy) + 1e-300) * np.eye(len(energy))
    return np.linalg.solve(ridge, toward), energy, toward


def unseen(energy: Array, strong: float) -> str:
    """Why these recordings cannot show what has this energy, and `strong` times the size in a strong case; "" if so."""
    if np.max(np.diag(energy)) * strong**2 < _LEAST_ENERGY:
        return "these recordings cannot show it: what it would change is within the noise"
    return ""


def _scored(
    found: Fit,
    one: Fingerprint,
    jacobian: Array,
    gram: Array,
    beyond: Array | None = None,
    freed: Freed | None = None,
) -> Candidate:
    amounts, energy, toward = amounts_of(found, one.columns, jacobian, gram, beyond)
    effect = find(one.name, found.actuator.axes)
    if one.frees:
        return Candidate(one.name, max(0.0, float(toward @ amounts)), settings_at(found, one, amounts))
    first = effect.parameters[0]
    reason = unseen(energy, _strong_steps(found, one))
    given = 0.0
    if freed:
        amounts, energy, toward, given = freed[:4]
    linear = {first.name: one.settings[first.name]} | one.beside
    if len(amounts) == len(linear):
        own = {parameter.name: parameter for parameter in effect.parameters}
        ranges = [(own[name].low / value, own[name].high / value) for name, value in linear.items()]
        amounts = np.clip(amounts, *np.transpose(ranges))
        drop = given + float(2.0 * amounts @ toward - amounts @ energy @ amounts)
        if first.low > 0.0 and amounts[0] < 0.0:
            drop = 0.0
    else:
        drop = given + float(toward @ amounts)
    return Candidate(one.name, 0.0 if reason else max(0.0, drop), settings_at(found, one, amounts), reason)


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


def _strong_steps(found: Fit, one: Fingerprint) -> float:
    """How many times a fingerprint's own strength a strong case of its effect is."""
    effect = find(one.name, found.actuator.axes)
    return strong_case(found, effect) / one.settings[effect.parameters[0].name]


def strong_case(found: Fit, effect: Effect) -> float:
    """A strong case of an effect's first parameter; of one that counts by a signal's size, what this machine may have.

    The library's own machine has other currents, and other torques: a greater motor's teeth pull as much harder.
    """
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
