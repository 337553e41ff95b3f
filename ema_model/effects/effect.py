"""What an effect's file declares."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ema_model.errors import InputError

# Where effects can act: the arguments of each place.  The first is the value that the base model, or the
# effect before, has found there; an effect's function returns it changed.
PLACES = {
    "moving_friction": ("level", "static", "omega", "motor_torque", "load", "gear"),
    "friction": ("torque", "omega", "active", "static", "dynamic"),
    "electric_torque": ("torque", "theta", "omega", "current"),
    "shaft_torque": ("torque", "theta", "omega", "current", "user", "gear", "load"),
    "back_emf": ("emf", "omega", "current"),
    "winding_resistance": ("resistance",),
    "bus_voltage": ("volts", "current"),
    "inverse_inertia": ("inverse",),
    "user_position": ("user", "theta", "gear"),
    "position_reading": ("user",),
    "current_reading": ("current",),
}
# The arguments of an effect's `advance_states`, which returns its new states as a tuple: the step, s; angle and
# speed at its start; the rigid transmission's output before and after; how far the user moved; what acts.
ADVANCE = (
    *("dt", "theta", "omega", "rigid", "rigid_next", "user_step", "gear", "load", "active", "static", "dynamic"),
)


@dataclass(frozen=True)
class Parameter:
    """One number of an effect; the unit ends its name (a ratio or an order has none)."""

    name: str
    meaning: str
    default: float
    low: float
    high: float
    integer: bool = False


@dataclass(frozen=True)
class Effect:
    """A physical effect that the base models leave out.

    `places` are scalar functions named after the place where they act (`PLACES` lists
    the places and their arguments); each takes the effect's parameters, in order, as its last arguments.
    """

    title: str
    equation: str
    source: str
    explanation: str
    parameters: tuple[Parameter, ...]
    severities: tuple[float, float, float]  # of the first parameter: slight, clear, strong
    places: tuple[Callable[..., Any], ...]
    shows: str
    mistaken_for: str
    states: tuple[str, ...] = ()  # of its own, 0 at the start; `advance_states` takes their next values
    advance_states: Callable[..., Any] | None = None  # (*ema_model.stacks.ADVANCE, parameters, states) → new states
    duplicates: str = ""  # path of the base parameter that does the same, e.g. "motor.inertia_kgm2"
    is_load: bool = False  # pulls at the user from outside, so that its torque counts as the load
    nothing: float = 0.0  # the first parameter, the others at their defaults, with which kernels go on as without it
    name: str = ""  # of the file; the catalogue fills it in

    @property
    def is_periodic(self) -> bool:
        """Whether it has an order and a phase, so that a model may hold it several times."""
        return {"order", "phase_rad"} <= {parameter.name for parameter in self.parameters}

    @property
    def neutral(self) -> dict[str, float]:
        """Settings with which it does nothing, all parameters in order; they may lie outside what a user may set."""
        return {p.name: p.default for p in self.parameters} | {self.parameters[0].name: self.nothing}

    def settings(self, given: dict[str, float]) -> dict[str, float]:
        """All parameters, in order, those not given at their default; InputError for names and values."""
        known = {parameter.name: parameter for parameter in self.parameters}
        for name, value in given.items():
            if name not in known:
                raise InputError(f"effect {self.name} has no parameter {name!r}; it has {', '.join(known)}")
            p = known[name]
            if not (math.isfinite(value) and p.low <= value <= p.high):
                raise InputError(f"effect {self.name}: {name} = {value:g} is outside {p.low:g} … {p.high:g}")
            if p.integer and value != round(value):
                raise InputError(f"effect {self.name}: {name} must be a whole number, not {value:g}")
        return {name: float(given.get(name, p.default)) for name, p in known.items()}
