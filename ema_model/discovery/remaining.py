"""What a fitted model leaves in the recordings: whether it is anything, what explains it, its strongest orders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.comparison.criteria import BAND
from ema_model.comparison.explain import (
    Explanation,
    Order,
    advance_of,
    explain,
    orders_in,
    pitches,
    used_blocks,
)
from ema_model.comparison.explain import orders as orders_of
from ema_model.comparison.regions import Event, events
from ema_model.comparison.residuals import Residuals, residuals_of
from ema_model.comparison.verdict import ORDER_OF_PRIMARY, lasting, most_of_floor
from ema_model.estimation.floor import silent
from ema_model.estimation.model_fit import Data, Fit, floor_ratio
from ema_model.remembered import remembered

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
