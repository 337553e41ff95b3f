"""What is drawn at random for a task, each from its seed alone: plants, faults, effects, loads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ema_model import faults
from ema_model.actuator import Actuator
from ema_model.effects import CATALOGUE
from ema_model.effects.effect import Effect
from ema_model.estimation import default_free

SEVERITIES = ("slight", "clear", "strong")
NEEDS_LOAD = ("gear_load_friction", "load_dependent_friction")  # do nothing to an actuator without a load
_TEETH = 12.0  # the order of what is periodic
_FAULTS_ALONE = ("k1", "k2", "k3", "k6", "k8")
_BESIDE = ("cogging_torque", "stribeck_friction", "hinge_moment", "asymmetric_friction", "position_sensor_delay")


def base_parameters(actuator: Actuator, which: str, scale: float, seed: int) -> dict[str, float]:
    """Values drawn about the file's, normal with `scale` σ of their tolerances; the sensors' are left.

    which: "free", those that a calibration moves; or "all", within 3 σ.
    """
    if which == "free":
        random = np.random.default_rng(seed)
        paths = [path for path in default_free(actuator) if not path.startswith("sensors.")]
        size = {path: float(random.standard_normal()) for path in paths}
    else:
        random = np.random.default_rng([seed, 78])
        paths = [path for path in actuator.tolerances if not path.startswith("sensors.")]
        size = {path: float(np.clip(random.standard_normal(), -3.0, 3.0)) for path in paths}
    return {path: actuator.value(path) + scale * actuator.tolerances[path].sigma * size[path] for path in paths}


def load(low: float, high: float, seed: int) -> float:
    """N·m, uniform."""
    return float(np.random.default_rng([seed, 79]).uniform(low, high))


def uniform_faults(ranges: Mapping[str, Sequence[float]], seed: int) -> dict[str, float]:
    """Each k uniform in its own range."""
    random = np.random.default_rng([seed, 80])
    return {name: float(random.uniform(low, high)) for name, (low, high) in ranges.items()}


def worn(seed: int) -> dict[str, float]:
    """k1, k2, k6 and one shorted phase from U(0, 0.5), k7 from U(0, 1), k8 from U(0.2, 0.8)."""
    random = np.random.default_rng([seed, 77])
    k = faults.HEALTHY.copy()
    k[[0, 1, 5]] = random.uniform(0.0, 0.5, 3)
    k[2 + random.integers(3)] = random.uniform(0.0, 0.5)
    k[6], k[7] = random.random(), random.uniform(0.2, 0.8)
    return faults.named(k)


def one_fault(seed: int) -> dict[str, float]:
    """One fault of 0.15 … 0.6 (the gain to either side); which one follows from the seed."""
    return _one_fault(seed)[0]


def one_effect_beside(seed: int) -> dict[str, dict[str, Any]]:
    """A clear effect for the plant of `one_fault`, of any phase; which one follows from the seed."""
    random = _one_fault(seed)[1]
    effect = CATALOGUE[_BESIDE[(seed // len(_FAULTS_ALONE)) % len(_BESIDE)]]
    settings = {effect.parameters[0].name: effect.severities[1]}
    if effect.is_periodic:
        settings |= {"order": _TEETH, "phase_rad": float(random.uniform(-3.0, 3.0))}
    return {effect.name: settings}


def effect_of(name: str, severity: int, seed: int) -> dict[str, float]:
    """An effect's settings at a severity; what is periodic has the teeth's order and any phase."""
    effect = CATALOGUE[name]
    settings = {effect.parameters[0].name: effect.severities[severity]}
    if _has_order(effect):
        settings |= {"order": _TEETH, "phase_rad": float(np.random.default_rng(seed).uniform(-3.0, 3.0))}
    return settings


def pair_of_effects(names: Sequence[str], severities: Sequence[int], seed: int) -> dict[str, dict[str, float]]:
    """Two of these effects, each of one of these neighbouring severities."""
    random = np.random.default_rng(seed)
    chosen = [str(name) for name in random.choice(list(names), 2, replace=False)]
    drawn = {name: int(random.integers(severities[0], severities[-1] + 1)) for name in chosen}
    return {name: effect_of(name, severity, seed) for name, severity in drawn.items()}


FAULTS: dict[str, Callable[[int], dict[str, float]]] = {"worn": worn, "one": one_fault}
EFFECTS: dict[str, Callable[[int], dict[str, dict[str, Any]]]] = {"one_beside_a_fault": one_effect_beside}


def _has_order(effect: Effect) -> bool:
    return "order" in {parameter.name for parameter in effect.parameters}


def _one_fault(seed: int) -> tuple[dict[str, float], np.random.Generator]:
    random = np.random.default_rng(seed)
    name = _FAULTS_ALONE[seed % len(_FAULTS_ALONE)]
    size = float(random.uniform(0.15, 0.6))
    found = {name: 0.5 + 0.5 * float(random.choice([-1.0, 1.0])) * size if name == "k8" else size}
    if name == "k6":
        found["k7"] = float(random.uniform(0.1, 0.9))
    return found, random
