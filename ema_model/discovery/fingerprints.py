"""Fingerprints: what each effect would change in the signals, for all of them in one population.

Effects that can be switched off by their first parameter share one stack, that of the whole library, in which every
lane has one of them on: it is compiled once and serves whatever the model already holds.  The others need stacks of
their own, and keep their first fingerprints while effects are added beside them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.discovery.model_fit import Data, Fit
from ema_model.effects import CATALOGUE, Effect, find
from ema_model.simulation.pack import stack_for
from ema_model.stacks import Stack

Array = NDArray[np.float64]
Lane = tuple[Effect, dict[str, float]]

_FAR = 30.0  # times what there is to explain
_ATTEMPTS = 3
_DIVERGED = 1e100  # floors, from which on a change has no meaning: its square would overflow


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


def stacks_of_their_own(actuator: Actuator) -> list[Stack]:
    """Those of the effects that nothing switches off, beside what an actuator has; none without a known controller."""
    if actuator.controller.kind == "unknown":
        return []
    alone = [effect for effect in CATALOGUE.values() if off(effect) is None and effect.name not in actuator.effects]
    return [stack_for(actuator, [effect.name]) for effect in alone]


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


def fingerprints(
    data: Data, found: Fit, names: Iterable[str], orders: Sequence[int], earlier: Sequence[Fingerprint] = ()
) -> list[Fingerprint]:
    """Those of all effects that are not yet in the model, at the model's calibrated parameters.

    earlier: those of a model with fewer effects.
    """
    wanted = [find(name) for name in names if name not in found.effects]
    alone = [effect for effect in wanted if off(effect) is None]
    prints = _of_group(data, found, [effect for effect in wanted if off(effect) is not None], orders)
    for effect in alone:
        known = [one for one in earlier if one.name == effect.name]
        prints += known or _of_group(data, found, [effect], orders)
    return prints


def _of_group(data: Data, found: Fit, effects: list[Effect], orders: Sequence[int]) -> list[Fingerprint]:
    tried = [(effect, settings) for effect in effects for settings in variants(effect, orders)]
    lanes = [(effect, one) for effect, settings in tried for one in settings]
    if not lanes:
        return []
    switchable = off(effects[0]) is not None
    for attempt in range(_ATTEMPTS):
        change = _changes(data, found, lanes, switchable)
        if attempt == _ATTEMPTS - 1:
            break
        with np.errstate(over="ignore"):  # a loop that an effect makes unstable
            size = np.sqrt(np.mean(change**2, axis=1))
        gentle = [_gentler(effect, one, s, found.error()) for (effect, one), s in zip(lanes, size)]
        if all(new is None for new in gentle):
            break
        lanes = [(effect, new or one) for (effect, one), new in zip(lanes, gentle)]
    prints, lane = [], 0
    for effect, settings in tried:
        columns = change[lane : lane + len(settings)].T
        columns = np.where(np.abs(columns) < _DIVERGED, columns, 0.0)  # also NaN
        prints.append(Fingerprint(effect.name, dict(lanes[lane][1]), columns))
        lane += len(settings)
    return prints


def _changes(data: Data, found: Fit, lanes: list[Lane], switchable: bool) -> Array:
    """What each lane's effect changes, over the floor: (lanes, values)."""
    actuator: Actuator = found.calibration.actuator
    effects = {effect.name: effect for effect, _ in lanes}
    resting = {name: effect.settings({}) for name, effect in effects.items()}
    if switchable:
        resting = {**{name: _switched_off(effect) for name, effect in effects.items()}, **_library_off()}
    resting |= actuator.effects
    varied = {
        name: {parameter: np.full(len(lanes) + 1, value) for parameter, value in values.items()}
        for name, values in resting.items()
    }
    for lane, (effect, settings) in enumerate(lanes, 1):
        for parameter, value in effect.settings(settings).items():
            varied[effect.name][parameter][lane] = value
    plant = data.plant(replace(actuator, effects=resting))
    model = replace(actuator, effects=varied)
    k = np.tile(found.calibration.k, (len(lanes) + 1, 1))
    shown = [
        plant.signals(window, model, k, *found.calibration.start_of(i))  # pyright: ignore[reportArgumentType]
        for i, window in enumerate(plant.windows)
    ]
    signals = data.over_floor(plant, shown)
    return signals[1:] - (signals[0] if switchable else data.over_floor(found.plant, found.calibration.signals))


def _gentler(effect: Effect, settings: dict[str, float], size: float, error: float) -> dict[str, float] | None:
    """Settings that change about as much as there is to explain, where these change far more (another actuator's)."""
    first = effect.parameters[0]
    if size <= _FAR * max(1.0, error) or first.low > 0.0:
        return None
    share = 2.0 * max(1.0, error) / size if np.isfinite(size) else 1e-3
    return {**settings, first.name: max(share, 1e-4) * settings[first.name]}


def _switched_off(effect: Effect) -> dict[str, float]:
    neutral = off(effect)
    assert neutral is not None
    return {**effect.settings({}), effect.parameters[0].name: neutral}


def _library_off() -> dict[str, dict[str, float]]:
    """Every effect that can be switched off, switched off, the periodic ones twice: one stack serves all scores."""
    library = {name: effect for name, effect in CATALOGUE.items() if off(effect) is not None}
    library |= {f"{name}_2": find(f"{name}_2") for name, effect in library.items() if effect.is_periodic}
    return {name: _switched_off(effect) for name, effect in library.items()}
