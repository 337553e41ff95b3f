"""Fingerprints: what each effect would change in the signals, for all of them in one population.

Effects that can be switched off by their first parameter share one stack, in which every lane has one of them
on; the others get stacks of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.discovery.fitting import Data, Fit
from ema_model.effects import CATALOGUE, Effect
from ema_model.faults import HEALTHY

Array = NDArray[np.float64]

_TOGETHER = 6  # effects in one stack


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """What an effect with these settings changes, over the floor: (values, columns).

    Two columns are the two phases of a periodic effect.
    """

    name: str
    settings: dict[str, float]
    columns: Array


def off(effect: Effect) -> float | None:
    """The value of an effect's first parameter that switches it off, if there is one."""
    first = effect.parameters[0]
    if first.low <= 0.0 <= first.high:
        return 0.0
    return first.low if effect.states == () else None


def variants(effect: Effect, orders: Sequence[int]) -> list[list[dict[str, float]]]:
    """Settings to try; those of one entry are columns of one fingerprint."""
    names = [parameter.name for parameter in effect.parameters]
    first = effect.parameters[0].name
    middle = effect.severities[1]
    if "phase_rad" in names and "order" in names:
        return [
            [{first: middle, "order": float(order), "phase_rad": phase} for phase in (0.0, 0.5 * np.pi)]
            for order in orders
        ]
    if "phase_rad" in names:
        return [[{first: middle, "phase_rad": phase} for phase in (0.0, 0.5 * np.pi)]]
    return [[{first: severity}] for severity in effect.severities]


def fingerprints(data: Data, found: Fit, names: Iterable[str], orders: Sequence[int]) -> list[Fingerprint]:
    """Those of all effects that are not yet in the model, at the model's calibrated parameters."""
    wanted = [CATALOGUE[name] for name in names if name not in found.effects]
    shared = [effect for effect in wanted if off(effect) is not None]
    alone = [effect for effect in wanted if off(effect) is None]
    groups = [shared[i : i + _TOGETHER] for i in range(0, len(shared), _TOGETHER)] + [[effect] for effect in alone]
    return [print_ for group in groups for print_ in _of_group(data, found, group, orders)]


def _of_group(data: Data, found: Fit, effects: list[Effect], orders: Sequence[int]) -> list[Fingerprint]:
    tried = [(effect, settings) for effect in effects for settings in variants(effect, orders)]
    lanes = [(effect, one) for effect, settings in tried for one in settings]
    if not lanes:
        return []
    actuator: Actuator = found.calibration.actuator
    resting = {effect.name: effect.settings({}) for effect in effects}
    for effect in effects:
        neutral = off(effect)
        if neutral is not None:
            resting[effect.name] = {**resting[effect.name], effect.parameters[0].name: neutral}
    varied = {
        **actuator.effects,
        **{
            name: {parameter: np.full(len(lanes) + 1, value) for parameter, value in values.items()}
            for name, values in resting.items()
        },
    }
    for lane, (effect, settings) in enumerate(lanes, 1):
        for parameter, value in effect.settings(settings).items():
            varied[effect.name][parameter][lane] = value
    plant = data.plant(replace(actuator, effects={**actuator.effects, **resting}))
    model = replace(actuator, effects=varied)
    k = np.tile(np.asarray(HEALTHY, float), (len(lanes) + 1, 1))
    parts = []
    for i, (window, one) in enumerate(zip(plant.windows, data.floors)):
        starts = found.calibration.starts
        at = [starts[f"{kind} {i}"].value if f"{kind} {i}" in starts else 0.0 for kind in ("turned", "play")]
        shown = plant.signals(window, model, k, *at)  # pyright: ignore[reportArgumentType]
        parts += [
            shown[name] * (data.signals[name] / one.fit_sigma(name)) for name in data.signals if name in window.measured
        ]
    signals = np.concatenate(parts, axis=1)
    if off(effects[0]) is None:
        signals[0] = _resting(data, found)
    change = np.nan_to_num(signals[1:] - signals[0])
    prints, lane = [], 0
    for effect, settings in tried:
        columns = change[lane : lane + len(settings)].T
        lane += len(settings)
        prints.append(Fingerprint(effect.name, settings[0], columns))
    return prints


def _resting(data: Data, found: Fit) -> Array:
    """The fitted model's own signals, over the floor."""
    return np.concatenate(
        [
            signals[name] * (data.signals[name] / one.fit_sigma(name))
            for window, one, signals in zip(found.plant.windows, data.floors, found.calibration.signals)
            for name in data.signals
            if name in window.measured
        ]
    )
