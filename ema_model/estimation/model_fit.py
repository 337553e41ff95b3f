"""A model with some effects, fitted to the recordings; the floors are measured once."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Container, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, Tolerance
from ema_model.effects import find
from ema_model.effects.effect import ANGLES
from ema_model.estimation import Calibration, Floor, after_fit, calibrate, default_free, floor, of_unseen, taken_up
from ema_model.estimation.noise import as_it_is, band, least, spread, twin_errors
from ema_model.estimation.problem import fitted_signals
from ema_model.models import Model, model_for
from ema_model.models.model import Signals
from ema_model.recordings import Measurement
from ema_model.remembered import remembered

Array = NDArray[np.float64]

_SHARE = 0.5  # 1 σ of an effect's parameter, of the value that its fingerprint suggests
_ORDER_SHARE = 1e-3  # of an order along a linear axis: it was found as exactly as the travel tells it
_ANGLE_SIGMA = 0.7  # rad
_ALIKE = 0.02  # of a floor, that two may differ by


@dataclass(frozen=True, eq=False)
class Data:
    """Recordings, the floors of their windows, and the signals to fit with their weights."""

    measurements: Sequence[Measurement]
    stretches: Sequence[list[slice] | None] | None
    floors: Sequence[Floor]
    signals: Mapping[str, float]
    after_fit: Sequence[Floor] = ()  # what a true model leaves once it is fitted; () before the first fit

    @property
    def told_in(self) -> Sequence[Floor]:
        """The floors in which errors are told; fits, and what is decided of them, are weighed by `floors`."""
        return self.after_fit or self.floors

    @cached_property
    def before_fit(self) -> Data:
        """The same with all errors in the floors that fits are weighed by."""
        return replace(self, after_fit=())

    @cached_property
    def floor_spread(self) -> float:
        """Standard deviation of a true model's error in floors."""
        return spread(self.told_in, self._pooled)

    @property
    def floor_band(self) -> tuple[float, float]:
        """Between which multiples of the floor nine of ten true models end."""
        return band(self.floor_spread, least(self.told_in, self._pooled))

    @property
    def _pooled(self) -> Sequence[Collection[str]]:
        """Signals of which the error is pooled, by window."""
        return [self.fitted(one.noise) for one in self.told_in]

    def fitted(self, measured: Container[str]) -> dict[str, float]:
        """The signals to fit of those that a window has, with their weights; a speed where no position was logged."""
        return fitted_signals(self.signals, measured)

    def plant(self, actuator: Actuator) -> Model:
        """The recordings beside this actuator's model."""
        return model_for(self.measurements, actuator, stretches=self.stretches)

    def over_floor(self, plant: Model, shown: Sequence[Mapping[str, Array]]) -> Array:
        """Signals of each window of the plant, (…, blocks), over the floor, in a residual's order: (…, values)."""
        parts = [
            (signals[name], weight / one.fit_sigma(name))
            for window, one, signals in zip(plant.windows, self.floors, shown)
            for name, weight in self.fitted(window.measured).items()
        ]
        ends = np.cumsum([0, *(signal.shape[-1] for signal, _ in parts)])
        told = np.empty((*parts[0][0].shape[:-1], ends[-1]))  # of many lanes it is large, and is written once
        for (signal, weights), first, last in zip(parts, ends, ends[1:]):
            np.multiply(signal, weights, out=told[..., first:last])
        return told

    def has_recordings_of(self, other: Data | None) -> bool:
        """Whether they are the same, whatever the floors."""
        mine, its = self.measurements, [] if other is None else other.measurements
        return len(mine) == len(its) and all(one is another for one, another in zip(mine, its))

    def weighs_as(self, other: Data) -> bool:
        """Whether floors of the same windows hardly differ, so that a fit to one is a fit to the other."""
        return all(
            np.max(np.abs(mine.fit_sigma(name) / its.fit_sigma(name) - 1.0)) < _ALIKE
            for mine, its in zip(self.floors, other.floors)
            for name in mine.noise
        )

    def beside(self, found: Fit) -> Data:
        """The data with the model's floor at a calibrated model as well, where that is greater."""
        plant = self.plant(found.calibration.actuator)
        again = [floor(plant, place) for place in range(len(plant.windows))]
        return replace(self, floors=[one.beside(other) for one, other in zip(self.floors, again)])


@dataclass(frozen=True, eq=False)
class FitParts:
    """What stands for a fit where it is stored: with its twins, if they were simulated."""

    actuator: Actuator
    plant: Model
    calibration: Calibration
    starts: dict[str, float]
    faults: tuple[str, ...]
    held: tuple[str, ...]
    twins: Sequence[Signals] | None

    def made(self) -> Fit:
        """The fit."""
        made = Fit(self.actuator, self.plant, self.calibration, self.starts, self.faults, self.held)
        if self.twins is not None:
            vars(made)["twins"] = self.twins  # as the cached property does
        return made


@dataclass(frozen=True, eq=False)
class Fit:
    """A calibrated model."""

    actuator: Actuator  # as it went in: with effects, their suggested settings and tolerances
    plant: Model
    calibration: Calibration
    starts: dict[str, float]  # x by name
    faults: tuple[str, ...] = ()  # k1 … k8 that move beside the parameters
    held: tuple[str, ...] = ()  # parameters that stay as the file says, though it leaves them free

    def made_of(self) -> FitParts:
        """As `ema_model.result` stores it."""
        own = {one.name: getattr(self, one.name) for one in fields(self)}
        return FitParts(**own, twins=vars(self).get("twins"))

    @cached_property
    def twins(self) -> Sequence[Signals]:
        """Of `draws`, that of the actuator as it is, by window."""
        return [as_it_is(one) for one in self.draws()]

    def draws(self) -> Sequence[Signals]:
        """As of `twin_error`, by window; all of them are too large to be kept."""
        found = twin_errors(self.plant, self.calibration.actuator, self.calibration.k)
        vars(self).setdefault("twins", [as_it_is(one) for one in found])
        return found

    @property
    def residual(self) -> Array:
        """Model − measurement over the floor, (values,)."""
        return self.calibration.residual

    @property
    def chi2(self) -> float:
        """Of the signals over their floor, and the prior."""
        return float(self.residual @ self.residual + self.calibration.x @ self.calibration.x)

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects in the model."""
        return tuple(self.actuator.effects)

    def error(self) -> float:
        """rms of the residual in units of the floor that fits are weighted by."""
        return float(np.sqrt(np.mean(self.residual**2)))


def gather(
    measurements: Sequence[Measurement],
    actuator: Actuator,
    signals: Mapping[str, float],
    stretches: Sequence[list[slice] | None] | None,
) -> Data:
    """The data with the floors of the bare model."""
    plant = model_for(measurements, actuator, stretches=stretches)
    floors = [floor(plant, place) for place in range(len(plant.windows))]
    return Data(measurements, stretches, floors, signals)


def in_floors_of(found: Fit, data: Data, held: Data | None) -> tuple[Data, Data | None]:
    """Data, and held-out ones, whose errors are told in what a true model leaves that was fitted as this one."""
    calibration, twins = found.calibration, found.draws()
    taken = taken_up(data.floors, calibration, twins)
    data = replace(data, after_fit=after_fit(data.floors, calibration, twins, taken))
    if held is None:
        return data, None
    plant = held.plant(calibration.actuator)
    there = twin_errors(plant)
    unseen = of_unseen(plant, held.floors, calibration, taken, there, held.signals)
    return data, replace(held, after_fit=unseen)


def with_effect(actuator: Actuator, name: str, settings: Mapping[str, float]) -> Actuator:
    """The actuator with an effect, its parameters free around these settings; whole numbers stay."""
    effect = find(name, actuator.axes)
    tolerances = dict(actuator.tolerances)
    full = effect.settings(dict(settings))
    first = effect.parameters[0]
    strength = abs(full[first.name] / first.default) or 1.0  # a small machine's offsets are small as well
    for parameter in effect.parameters:
        if not parameter.integer:
            value = full[parameter.name]
            share = _ORDER_SHARE if parameter.name == "order" else _SHARE
            # beside a part of another kind, the first one's may have gone to a parameter that does the same
            least = parameter.plausible[1] or 0.0 if effect.beside and parameter is first else 0.0
            sigma = _ANGLE_SIGMA if parameter.name in ANGLES else share * max(abs(value), least)
            sigma = sigma or _SHARE * abs(parameter.default) or 0.01 * (parameter.high - parameter.low) * strength
            tolerances[f"effects.{name}.{parameter.name}"] = Tolerance(sigma, True)
    return replace(actuator, effects={**actuator.effects, name: full}, tolerances=tolerances)


def without_effect(actuator: Actuator, name: str) -> Actuator:
    """The actuator without one of its effects."""
    kept = {path: one for path, one in actuator.tolerances.items() if not path.startswith(f"effects.{name}.")}
    return replace(
        actuator, effects={other: given for other, given in actuator.effects.items() if other != name}, tolerances=kept
    )


def as_in(file: Actuator, name: str, actuator: Actuator) -> Actuator:
    """An actuator with an effect as another one, the file, has it."""
    given = {path: one for path, one in file.tolerances.items() if path.startswith(f"effects.{name}.")}
    effects = {**actuator.effects, name: file.effects[name]}
    return replace(actuator, effects=effects, tolerances={**actuator.tolerances, **given})


def fit(
    data: Data,
    actuator: Actuator,
    start: Mapping[str, float] | None = None,
    tell: Callable[[str], None] | None = None,
    faults: tuple[str, ...] = (),
    held: tuple[str, ...] = (),
    rough: bool = False,
) -> Fit:
    """Calibrates the base parameters but those held, those of the actuator's effects, and these faults together.

    A base parameter that a free effect multiplies is held, too: how far it is off, that effect says, and only their
    product is seen.  rough: as `calibrate` has it.
    """
    plant = data.plant(actuator)
    fixed = {*held, *multiplied(actuator)}
    calibration = calibrate(
        plant,
        data.floors,
        free=(*(path for path in default_free(actuator) if path not in fixed), *faults),
        signals=data.signals,
        start=start,
        on_progress=None if tell is None else lambda evaluations: tell(f"fitting (simulations: {evaluations})"),
        rough=rough,
    )
    names = [*calibration.parameters, *calibration.starts]
    starts = {name: float(x) for name, x in zip(names, calibration.x)}
    return Fit(actuator, plant, calibration, starts, faults, held)


def multiplied(actuator: Actuator) -> set[str]:
    """Paths of base parameters that effects multiply whose first parameter is free."""
    found: set[str] = set()
    for key in actuator.effects:
        effect = find(key, actuator.axes)
        own = actuator.tolerances.get(f"effects.{key}.{effect.parameters[0].name}")
        if effect.scale and own is not None and own.free:
            found.add(effect.duplicates)
    return found


def holdout_error(data: Data, found: Fit) -> float:
    """The same as `floor_ratio` on recordings that were not fitted; only their starts are."""
    return holdout_fit(data, found)[0]


@remembered(of=1)  # the fit: a trial is judged by it, and its step of the ladder shows it
def holdout_fit(data: Data, found: Fit) -> tuple[float, dict[str, float], dict[str, float]]:
    """`floor_ratio` of recordings that were not fitted, `rms_by_signal` and `ratio_by_recording`."""
    return resimulated(data, found.calibration.actuator)


@lru_cache(maxsize=2)  # of the current fit and a trial
def holdout_signals(data: Data, found: Fit) -> Sequence[Signals]:
    """The signals of recordings that were not fitted, by window."""
    return _with_starts(data, data.plant(found.calibration.actuator))


def holdout_change(data: Data, one: Fit, other: Fit) -> float:
    """rms of what two fits differ by on recordings that were not fitted, in floors."""
    shown = [holdout_signals(data, found) for found in (one, other)]
    return floor_ratio(data, data.plant(one.calibration.actuator), shown[0], beside=shown[1])


def _with_starts(data: Data, plant: Model) -> Sequence[Signals]:
    return calibrate(plant, data.floors, free=(), signals=data.signals, start={}, final=False).signals


def resimulated(data: Data, actuator: Actuator) -> tuple[float, dict[str, float], dict[str, float]]:
    """`floor_ratio`, `rms_by_signal` and `ratio_by_recording` where only the recordings' starts are fitted."""
    plant = data.plant(actuator)
    shown = _with_starts(data, plant)
    ratio = floor_ratio(data, plant, shown)
    ratio = ratio if math.isfinite(ratio) else math.inf
    return ratio, rms_by_signal(data, plant, shown), ratio_by_recording(data, plant, shown)


def rms_by_signal(data: Data, plant: Model, shown: Sequence[Mapping[str, Array]]) -> dict[str, float]:
    """rms of model − measurement, in the signals' units."""
    parts: dict[str, list[Array]] = {}
    for window, signals in zip(plant.windows, shown):
        for name in data.fitted(window.measured):
            parts.setdefault(name, []).append(signals[name] - window.measured[name])
    return {name: float(np.sqrt(np.mean(np.concatenate(part) ** 2))) for name, part in parts.items()}


def ratio_by_recording(data: Data, plant: Model, shown: Sequence[Mapping[str, Array]]) -> dict[str, float]:
    """`floor_ratio` of each recording, by its name; of a name that stands twice, the second is NAME (2)."""
    found: dict[str, float] = {}
    for i, measurement in enumerate(data.measurements):
        name = measurement.name or "recording"
        name = f"{name} ({i + 1})" if name in found else name
        if any(window.recording == i for window in plant.windows):
            found[name] = floor_ratio(data, plant, shown, i)
    return found


def floor_ratio(
    data: Data,
    plant: Model,
    shown: Sequence[Mapping[str, Array]],
    recording: int | None = None,
    beside: Sequence[Mapping[str, Array]] | None = None,
) -> float:
    """rms of measurement − model in units of the floor after the fit, pooled over windows and signals: 1 is the floor.

    A standstill counts as 25 ms of motion do.  recording: the one, from 0, whose windows count; all without it.
    beside: what stands in the place of the measurement, by window.
    """
    others = beside or [window.measured for window in plant.windows]
    each = [
        (((signals[name] - other[name]) / one.sigma(name)) ** 2, one.counts)
        for window, one, signals, other in zip(plant.windows, data.told_in, shown, others)
        for name in data.fitted(window.measured)
        if recording in (None, window.recording)
    ]
    squared, counts = (np.concatenate(parts) for parts in zip(*each))
    return float(np.sqrt(np.average(squared, weights=counts)))
