"""A fitted model looked at again: what it leaves in the recordings, and how it runs freely, as its saved file too."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator, load_actuator
from ema_model.comparison.explain import Explanation, Order, advance_of, explain, orders_in, pitches, used_blocks
from ema_model.comparison.explain import orders as orders_of
from ema_model.comparison.free_simulation import Simulated, in_open_loop, is_by_motion, pairs, scored
from ema_model.comparison.regions import Event, events
from ema_model.comparison.residuals import Residuals, residuals_of
from ema_model.comparison.thresholds import BAND
from ema_model.comparison.verdict import ORDER_OF_PRIMARY, lasting, most_of_floor
from ema_model.discovery.result import Discovery, Rung
from ema_model.estimation.model_fit import Data, Fit, floor_ratio, holdout_signals, resimulated
from ema_model.estimation.noise import silent
from ema_model.models import Window, model_for
from ema_model.models.measured_motion import evaluation_stretches
from ema_model.models.model import Signals
from ema_model.remembered import remembered

# --- what it leaves: whether that is anything, what explains it, its strongest orders ---------------------------------

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LeftParts:
    """What stands for `Left` where it is stored: with what was asked for."""

    data: Data
    found: Fit
    explained: list[Explanation] | None
    orders: list[float] | None
    events: list[Event] | None

    def made(self) -> Left:
        """With what is known of it."""
        made = Left(self.data, self.found)
        known = {"explained": self.explained, "orders": self.orders, "events": self.events}
        vars(made).update({name: one for name, one in known.items() if one is not None})  # as cached properties do
        return made


@dataclass(frozen=True, eq=False)
class Left:
    """Of the residual that `comparison` would explain, the current's where it is measured: each part when asked for."""

    data: Data
    found: Fit

    def made_of(self) -> LeftParts:
        """As `ema_model.result` stores it."""
        known = vars(self)
        return LeftParts(self.data, self.found, known.get("explained"), known.get("orders"), known.get("events"))

    @cached_property
    def explained(self) -> list[Explanation]:
        """All that was tried, the most significant first."""
        residuals = residuals_left(self.data, self.found)
        return explain(residuals, _primary(residuals), self.found.actuator.axes)

    @cached_property
    def orders(self) -> list[float]:
        """Those that the recordings can show, the strongest first."""
        residuals = _residuals(self.data, self.found, [{} for _ in self.found.plant.windows])
        return [one.order for one in _orders(residuals, _primary(residuals), self.found.actuator)]

    @cached_property
    def events(self) -> list[Event]:
        """What happened at one moment of a recording."""
        if at_floor(self.data, self.found):
            return []
        residuals = residuals_left(self.data, self.found)
        fitted = list(self.data.fitted(residuals.values))
        names = [one.name for one in self.data.measurements]
        return events(residuals, fitted, names, self.found.calibration.actuator)

    @property
    def explanation(self) -> Explanation | None:
        """The most significant."""
        return next((one for one in self.explained if one.significant), None)


def ratio(data: Data, found: Fit) -> float:
    """The error of a fit in the floors that it was weighed by."""
    return floor_ratio(data.before_fit, found.plant, found.calibration.signals)


def told_ratio(data: Data, found: Fit) -> float:
    """The error of a fit in the floors that it is told in."""
    return floor_ratio(data, found.plant, found.calibration.signals)


def at_floor(data: Data, found: Fit) -> bool:
    """Whether a fit leaves so little that the search takes it for the floor, before a fit takes from that."""
    return ratio(data, found) <= BAND


def within_band(data: Data, found: Fit) -> bool:
    """Whether a fit leaves no more than a true model does, as `compare` has it."""
    return told_ratio(data, found) <= most_of_floor(data.floor_spread)


def silence(data: Data, found: Fit) -> str:
    """Why the recordings tell nothing of the model, as of `tells_nothing`: of the signal that is explained."""
    return silent(found.plant.windows, data.told_in)[1]


@remembered(of=1)  # the fit
def lasts(data: Data, found: Fit) -> bool:
    """Whether what is left of a signal lasts longer than noise does, as `compare` has it."""
    fitted = found.calibration.signals
    known: list[dict[str, Array]] = [{} for _ in fitted]
    residuals = residuals_of(found.plant, data.told_in, fitted, known, found.calibration.actuator)
    return bool(lasting(residuals, list(data.fitted(residuals.values))))


@lru_cache(maxsize=4)  # a search asks before and after it has looked for the next effect
def left_by(data: Data, found: Fit) -> Left:
    """What a fit leaves."""
    return Left(data, found)


@lru_cache(maxsize=4)  # of a fit and of the one before it
def residuals_left(data: Data, found: Fit) -> Residuals:
    """The residuals of a fit beside the variables that may explain them."""
    return _residuals(data, found, found.twins)


def _residuals(data: Data, found: Fit, known: Sequence[dict[str, Array]]) -> Residuals:
    """The same; known: the error that is known beforehand, by window."""
    fitted = found.calibration
    return residuals_of(found.plant, data.floors, fitted.signals, known, fitted.actuator, fitted)


def _primary(residuals: Residuals) -> str:
    return next(name for name in ORDER_OF_PRIMARY if name in residuals.values)


def _orders(residuals: Residuals, primary: str, actuator: Actuator) -> list[Order]:
    """Of the motor's position, the most significant first."""
    used = used_blocks(residuals, primary)
    if used is None:
        return []
    advance = advance_of(residuals, used)
    if actuator.axes.motor == "linear":
        position = residuals.variables["user_position"][used.chosen] / actuator.transmission.gear_ratio
        return pitches(position, used.values, advance)
    angle = residuals.variables.get("motor_angle")
    if angle is None or not len(orders_in(residuals.turns, advance)):
        return []
    found = orders_of(angle[used.chosen], used.values, residuals.turns, advance)
    return sorted(found, key=lambda one: -one.significance)


# --- simulated again: freely over whole recordings, and as its saved file has it --------------------------------------

_WORSE = 1.03  # times the last rung's error, up to which a saved model counts as the one that was found


@dataclass(frozen=True)
class Verified:
    """The error of a saved model in units of the floor, pooled over signals: 1 is the floor."""

    rmse: float
    holdout_rmse: float | None  # of the recordings that were held out
    is_worse: bool  # than the last rung of the ladder


def verified(found: Discovery, path: str | os.PathLike[str]) -> Verified:
    """The error of a model that was saved to an actuator file, as of `emaviz compare --no-calibrate` with it.

    Only where the recordings start is fitted; they are counted in the floors of the ladder.
    Raises InputError for a file that cannot be read back.
    """
    actuator = load_actuator(os.fspath(path))
    rmse, *_ = resimulated(found.data, actuator)
    held = None if found.held is None else resimulated(found.held, actuator)[0]
    last: Rung = found.ladder[-1]
    pairs = [(rmse, last.rmse), (held, last.holdout_rmse)]
    worse = any(now is not None and then is not None and not now <= _WORSE * then for now, then in pairs)
    return Verified(rmse, held, worse)


@remembered(of=2)  # the fit: a page asks at every look
def free_simulation(data: Data, held: Data | None, found: Fit) -> dict[str, Simulated]:
    """How far a fit is from each signal when it runs freely over whole recordings, by the signals' names in files."""
    actuator = found.calibration.actuator
    if is_by_motion(found.plant):
        errors = in_open_loop(data.measurements, () if held is None else held.measurements, actuator)
    else:
        unseen = {} if held is None else pairs(*_whole(held, actuator, holdout_signals(held, found)))
        errors = scored(pairs(*_whole(data, actuator, found.calibration.signals)), unseen)
    return {actuator.axes.signal(name): one for name, one in errors.items()}


def _whole(
    data: Data, actuator: Actuator, signals: Sequence[Signals]
) -> tuple[Sequence[Window], Sequence[Mapping[str, Array]]]:
    """The windows of whole recordings, and the model's signals there; signals: those of the parts that were fitted."""
    if data.stretches is None:
        return data.plant(actuator).windows, signals
    whole = model_for(data.measurements, actuator, stretches=evaluation_stretches(data.measurements, actuator))
    shown = [whole.signals(place) for place in range(len(whole.windows))]
    return whole.windows, [{name: values[0] for name, values in one.items()} for one in shown]
