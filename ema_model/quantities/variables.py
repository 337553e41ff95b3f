"""The variables that a residual is held against, and what a curve of one may be multiplied by: one row each."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import Quantity
from ema_model.quantities.sides import MOTOR, USER, Side


@dataclass(frozen=True)
class Variable:
    """One variable; `indirect` is 0 for what physical effects act through themselves.

    The others go along with those: the share by which one must explain more before it is believed to be the cause.
    """

    name: str
    title: str
    unit: str  # on rotary axes
    side: Side | None
    place: str = "at "  # before a value of it
    indirect: float = 0.0

    @property
    def noun(self) -> str:
        """In a sentence."""
        return self.title.lower()


_ROWS = (
    Variable("motor_angle", "Motor angle", "rad", MOTOR),
    Variable("user_position", "User position", "rad", USER, "at a user position of ", 0.01),
    Variable("motor_speed", "Motor speed", "rad/s", MOTOR),
    Variable("acceleration", "Motor acceleration", "rad/s²", MOTOR, "at an acceleration of ", 0.03),
    Variable("current", "Motor current", "A", None, indirect=0.005),
    Variable("load", "Load", "N·m", USER, "under a load of "),
    Variable("time", "Time", "s", None, indirect=0.15),
    Variable("temperature", "Temperature", "°C", None, indirect=0.05),
)
VARIABLES: dict[str, Variable] = {row.name: row for row in _ROWS}


@dataclass(frozen=True)
class Modulator:
    """What a curve of a variable is multiplied by."""

    name: str
    title: str
    noun: str  # after a variable's


_MODULATORS = (
    Modulator("1", "alone", ""),
    Modulator("sign_speed", "× direction", " and direction"),
    Modulator("current", "× current", " in proportion to the current"),
)
MODULATORS: dict[str, Modulator] = {row.name: row for row in _MODULATORS}


def variable_title(name: str) -> str:
    """'Motor angle' of 'motor_angle'."""
    return VARIABLES[name].title if name in VARIABLES else name.replace("_", " ")


NOTHING = "nothing"  # explains it


def explanation_title(variable: str | None, modulator: str | None) -> str:
    """'Motor speed × direction' of 'motor_speed' and 'sign_speed'; 'nothing' without a variable."""
    if not variable:
        return NOTHING
    by = MODULATORS.get(modulator or "1")
    more = "" if by is None or not by.noun else f" {by.title}"
    return variable_title(variable) + more


def is_turn(name: str, axes: Axes) -> bool:
    """Whether it is an angle that comes round again: of a rotary motor."""
    return name == "motor_angle" and not axes.is_linear(MOTOR)


def of_variable(name: str, axes: Axes) -> Quantity:
    """A variable as figures and sentences show it; the angle of a turn in degrees."""
    one = VARIABLES[name]
    if is_turn(name, axes):
        return Quantity(one.title, "°", 180.0 / math.pi)
    return Quantity(one.title, axes.unit(one.unit, one.side))
