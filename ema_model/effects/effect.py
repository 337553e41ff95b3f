"""What an effect's file declares."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.quantities import (
    MOTOR,
    NEITHER,
    ROTARY,
    USER,
    VARIABLES,
    Axes,
    Side,
    check_number,
    labelled,
    linear_unit,
    parameter_title,
    unit_of,
)

__all__ = ["ADVANCE", "ANGLES", "MOTOR", "NEITHER", "PLACES", "USER", "Effect", "Parameter"]  # what effects' files need

# Where effects can act: the arguments of each place.  The first is the value that the base model, or the
# effect before, has found there; an effect's function returns it changed.  time, s, counts from the recording's start.
PLACES = {
    "moving_friction": (
        "level",
        "static",
        "omega",
        "motor_torque",
        "drag",
        "active",
        "load",
        "gear",
        "theta",
        "user",
        "time",
    ),
    "friction": ("torque", "omega", "active", "static", "dynamic"),
    "electric_torque": ("torque", "theta", "omega", "current"),
    "shaft_torque": ("torque", "theta", "omega", "current", "user", "gear", "load", "time"),
    # current: as it would flow with this EMF alone; gain: the A by which a volt changes it within the step (a phase's
    # is the last step's, and its gain 0); most: A that the supply drives at standstill
    "back_emf": ("emf", "omega", "current", "gain", "most"),
    "winding_resistance": ("resistance", "time"),
    "bus_voltage": ("volts", "current"),
    "inverse_inertia": ("inverse",),
    "user_position": ("user", "theta", "gear"),
    "position_reading": ("user",),
    "current_reading": ("current",),
    "motor_angle_reading": ("theta",),
    "motor_speed_reading": ("omega", "theta"),
    # the drive's controller, in the order in which it works (`ema_model.kernels.drive_step`)
    "goal": ("goal", "gear", "begins", "dt"),
    "position_error": ("error", "begins", "dt"),
    "speed_reading": ("speed", "begins", "dt"),
    "speed_sample": ("speed", "begins", "dt"),
    "speed_command": ("wanted", "limit", "begins", "dt"),
    "speed_gain": ("gain",),
    "integral_gain": ("gain", "speed_gain"),
    "loop_torque": ("torque", "begins", "dt"),
    "drive_output": ("output", "begins", "dt"),
    "current_reference": ("reference", "begins", "dt"),
}
# Places of the drive, each passed once a step.  An effect with states returns there its changed value and all of its
# new states, as a tuple; begins: whether this is the first step, before which its states say nothing.
STAGES = (
    *("goal", "position_error", "speed_reading", "speed_sample", "speed_command", "speed_gain", "integral_gain"),
    *("loop_torque", "drive_output", "current_reference"),
)
ANGLES = ("phase_rad", "angle_rad")  # parameters of which any value is as likely as another
# What an effect is of: a part of the actuator, or of what drives and measures it.
FAMILIES = {
    "mechanics": "the actuator's mechanics",
    "electrics": "the motor, the inverter and their supply",
    "sensor": "a sensor",
    "drive": "the drive's controller, not the actuator",
}
# The arguments of an effect's `advance_states`, which returns its new states as a tuple: the step, s; angle and
# speed at its start; the rigid transmission's output before and after; how far the user moved; what acts.
ADVANCE = (
    *("dt", "theta", "omega", "rigid", "rigid_next", "user_step", "gear", "load", "active", "static", "dynamic"),
)


@dataclass(frozen=True)
class Parameter:
    """One number of an effect; the unit ends its name (a ratio or an order has none).

    What a linear axis measures in other units says where it sits; ValueError where that is left open.
    A fitted value outside of `plausible` is no such part's: something else is bent into its place.  Where the value
    counts by how far a signal goes, it is the product of the two that must be plausible; where it is a part of a base
    parameter, its share.
    """

    name: str
    meaning: str
    default: float
    low: float
    high: float
    integer: bool = False  # tried, not fitted; where its axis is linear, periods in 2π m are any number, and fitted
    side: Side | None = None  # of the transmission, or NEITHER for an angle that is of no axis
    per: Side | None = None  # of a number without a unit that is rad/rad: the side whose angle it is counted by
    linear: tuple[float, float, float] | None = None  # default, low and high where the side's axis is linear
    unit: str = ""  # as shown; the name tells it where it ends in one
    shown: str = ""  # the name in files; `on` fills it in
    plausible: tuple[float | None, float | None] = (None, None)  # low and high, None where there is no end
    plausible_at: str = ""  # the signal by whose greatest size the value counts
    plausible_of: str = ""  # path of the base parameter of which the value is a part

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", self.unit or unit_of(self.name))
        object.__setattr__(self, "shown", self.shown or self.name)
        if self.side is None and linear_unit(self.unit) != self.unit:
            raise ValueError(f"parameter {self.name}: say where it sits, side=MOTOR, USER or NEITHER")

    def on(self, axes: Axes) -> Parameter:
        """The parameter as these axes show it: its name, unit, default and range."""
        range_ = (self.default, self.low, self.high)
        if self.linear is not None and (axes.is_linear(self.side) or axes.is_linear(self.per)):
            range_ = self.linear
        default, low, high = range_
        return replace(
            self,
            default=default,
            low=low,
            high=high,
            integer=self.integer and not axes.is_linear(self.per),
            unit=axes.unit(self.unit, self.side, self.per),
            shown=axes.name(self.name, self.side),
        )

    @property
    def title(self) -> str:
        """'Amplitude'."""
        return parameter_title(self.shown)

    @property
    def label(self) -> str:
        """'Amplitude [N·m]'."""
        return labelled(self.shown, self.unit)

    def nearest(self, value: float) -> float:
        """The value within its range that is nearest."""
        return min(max(float(value), self.low), self.high)

    def check(self, value: float, where: str) -> None:
        """Raises InputError for a value out of its range, or one that is not whole where it must be."""
        check_number(value, f"{where}: {self.shown}")
        if not (math.isfinite(value) and self.low <= value <= self.high):
            raise InputError(f"{where}: {self.shown} = {value:g} is outside {self.low:g} … {self.high:g}")
        if self.integer and value != round(value):
            raise InputError(f"{where}: {self.shown} must be a whole number, not {value:g}")


@dataclass(frozen=True)
class Effect:
    """A physical effect that the base models leave out.

    `places` are scalar functions named after the place where they act (`PLACES` lists
    the places and their arguments); each takes the effect's parameters, in order, as its last arguments.
    `placed`: parameters that are places along `against`, each with the shares of its range in the recordings at which
    one begins to look for it; all have as many.
    `terms`: effects that are terms of its series about a point, the simplest first: what a short travel, or a narrow
    range of what it acts by, shows of it.
    `beside`: linear parameters that do nothing by default, each with the share of its range at which one looks at what
    it does beside the first.
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
    family: str  # of `FAMILIES`
    states: tuple[str, ...] = ()  # of its own, 0 at the start; a stage of the drive, or `advance_states`, renews them
    advance_states: Callable[..., Any] | None = None  # (*ema_model.stacks.ADVANCE, parameters, states) → new states
    duplicates: str = ""  # path of the base parameter that does the same, e.g. "motor.inertia_kgm2"
    scale: float = 0.0  # s of the factor 1 + s·p by which its first parameter p multiplies that; 0: it does not
    fault: str = ""  # the k that is the same of an actuator with a reference model, which has no such effect beside it
    is_load: bool = False  # pulls at the user from outside, so that its torque counts as the load
    at_speeds: tuple[float, ...] = ()  # of a first parameter that is a speed: shares of the top speed to look for it at
    placed: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    beside: Mapping[str, float] = field(default_factory=dict)
    terms: tuple[str, ...] = ()
    by_direction: bool = False  # told from what does not turn over with the direction: needs motion both ways
    turns: Side | None = None  # of a part that turns on that side: there is none on a linear axis
    against: str = "time"  # of `quantities.VARIABLES`: what its residual follows; time where it follows nothing else
    nothing: float = 0.0  # the first parameter, the others at their defaults, with which kernels go on as without it
    name: str = ""  # of the file; the catalogue fills it in

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise ValueError(f"effect {self.title}: family must be one of {', '.join(FAMILIES)}")
        if self.against not in VARIABLES:
            raise ValueError(f"effect {self.title}: against must be one of {', '.join(VARIABLES)}")

    def has_part(self, axes: Axes) -> bool:
        """Whether an actuator with these axes has the part that it is of."""
        return self.turns is None or not axes.is_linear(self.turns)

    @property
    def acts_in_drive(self) -> bool:
        """Whether it changes what the drive's controller does."""
        return any(place.__name__ in STAGES for place in self.places)

    @property
    def is_periodic(self) -> bool:
        """Whether it has an order and a phase, so that a model may hold it several times."""
        return {"order", "phase_rad"} <= {parameter.name for parameter in self.parameters}

    @property
    def phase(self) -> str:
        """The angle of which the effect is as its sine, the first parameter being the amplitude; "" where none is."""
        return next((one.name for one in self.parameters if one.name in ANGLES), "")

    @property
    def neutral(self) -> dict[str, float]:
        """Settings with which it does nothing, all parameters in order; they may lie outside what a user may set."""
        return {p.name: p.default for p in self.parameters} | {self.parameters[0].name: self.nothing}

    def at_severity(self, severity: int) -> dict[str, float]:
        """All settings when it is slight (0), clear (1) or strong (2)."""
        return self.settings({self.parameters[0].name: self.severities[severity]})

    def on(self, axes: Axes) -> Effect:
        """The effect as these axes show it: its parameters' names, units and ranges, and how strong it usually is."""
        if axes == ROTARY:
            return self
        parameters = tuple(parameter.on(axes) for parameter in self.parameters)
        usual = self.severities
        if parameters and parameters[0].default != self.parameters[0].default:
            usual = tuple(one * parameters[0].default / usual[1] for one in usual)
        return replace(self, parameters=parameters, severities=usual)

    def inside(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Entries of files and people by the parameters' names inside; InputError for a name that it does not have."""
        names = {parameter.shown: parameter.name for parameter in self.parameters}
        for name in given:
            if name not in names:
                raise InputError(self._no_parameter(name))
        return {names[name]: value for name, value in given.items()}

    def _no_parameter(self, name: str) -> str:
        names = [parameter.shown for parameter in self.parameters]
        like = did_you_mean(name, names)
        return f"effect {self.name} has no parameter {quoted(name)!r}; it has {', '.join(names)}{like}"

    def settings(self, given: dict[str, float]) -> dict[str, float]:
        """All parameters, in order, those not given at their default; InputError for names and values."""
        known = {parameter.name: parameter for parameter in self.parameters}
        for name, value in given.items():
            if name not in known:
                raise InputError(self._no_parameter(name))
            known[name].check(value, f"effect {self.name}")
        return {name: float(given.get(name, p.default)) for name, p in known.items()}
