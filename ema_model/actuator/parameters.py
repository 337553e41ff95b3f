"""An actuator's parameters and their tolerances."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.faults import vector
from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import as_number

_FAR = 1e9  # rad, where an end stop is out of reach


@dataclass(frozen=True)
class Controller:
    """Control electronics.

    cascade: position and PID speed loop (T 3.2.3; `ema_model.physics.controller`).  With a hysteresis inverter it is
    the thesis's, whose integral is held at standstill.  position: a position loop alone, whose output is a share of
    what the drive can give.  unknown: recordings are held against inverse dynamics.
    """

    kind: str = "cascade"
    position_gain_1_s: float = 0.0
    speed_limit_rad_s: float = 0.0
    speed_gain_Nms_rad: float = 0.0
    integral_gain_Nm_rad: float = 0.0
    derivative_gain_Nms2_rad: float = 0.0
    integrator_window_rad: float = 1.0
    torque_constant_Nm_A: float = 1.0
    current_limit_A: float = math.inf
    gain_1_rad: float = 0.0
    output_limit: float = 1.0


@dataclass(frozen=True)
class Inverter:
    """Power electronics: a hysteresis current loop (T 3.2.5), an ideal current source, or PWM voltage."""

    kind: str = "hysteresis"
    bus_voltage_V: float = 0.0
    hysteresis_band_A: float = 0.0
    current_limit_A: float = math.inf


@dataclass(frozen=True)
class Motor:
    """Electric motor and rotor (T 3.2.5, Table 3.3)."""

    torque_constant_Nm_A: float
    inertia_kgm2: float
    viscous_friction_Nms_rad: float
    static_friction_Nm: float
    dynamic_friction_Nm: float
    resistance_Ohm: float = 1.0
    inductance_H: float = 1e-6
    emf_scale: float = 1.0
    pole_pairs: float = 1.0
    torque_limit_Nm: float = 1e9
    rotor_offset_rad: float = 0.0


@dataclass(frozen=True)
class Transmission:
    """Gear, screw and user (T 3.2.6)."""

    gear_ratio: float = 1.0
    backlash_rad: float = 0.0
    viscous_friction_Nms_rad: float = 0.0
    stop_low_rad: float = -_FAR
    stop_high_rad: float = _FAR


@dataclass(frozen=True)
class Sensors:
    """What the recording adds to the true signals."""

    current_gain: float = 1.0
    current_bias_A: float = 0.0
    delay_s: float = 0.0


@dataclass(frozen=True)
class Tolerance:
    """What is not known of a parameter: 1 σ in its own unit, and whether a calibration may move it."""

    sigma: float
    free: bool


@dataclass(frozen=True)
class Rule:
    """What differs for recordings whose file name matches a pattern."""

    match: str  # of the file's name, with * and ?
    values: dict[str, float] = field(default_factory=dict)  # by "section.parameter"
    kind: str = "run"  # or "map", a static map


SECTIONS: dict[str, type[Any]] = {
    "controller": Controller,
    "inverter": Inverter,
    "motor": Motor,
    "transmission": Transmission,
    "sensors": Sensors,
}
# Zero or negative makes no sense for these; the rest may be zero, and angles and bias negative.
_POSITIVE = {
    "speed_limit_rad_s", "torque_constant_Nm_A", "current_limit_A", "bus_voltage_V", "resistance_Ohm", "inductance_H",
    "torque_limit_Nm", "inertia_kgm2", "gear_ratio", "pole_pairs", "current_gain", "emf_scale", "integrator_window_rad",
    "output_limit",
}  # fmt: skip
_ANY_SIGN = {"rotor_offset_rad", "current_bias_A", "stop_low_rad", "stop_high_rad"}


@dataclass(frozen=True)
class Actuator:
    """All parameters of one actuator; SI units, which the names say (for linear axes see `quantities.axes`).

    Its faults are the known state of this unit: what simulates it (a run, a comparison, a discovery) starts from
    them unless it is told another k.  An identification does not: its k counts from the healthy actuator, so that a
    worn unit is found worn, whatever its file says.
    """

    name: str
    controller: Controller
    inverter: Inverter
    motor: Motor
    transmission: Transmission
    sensors: Sensors
    tolerances: dict[str, Tolerance] = field(default_factory=dict)  # by "section.parameter"
    description: str = ""
    effects: dict[str, dict[str, float]] = field(default_factory=dict)  # that belong to its model
    faults: dict[str, float] = field(default_factory=dict)  # k1 … k8 that are known; the others are healthy
    axes: Axes = field(default_factory=Axes)
    step_s: float = 1e-5  # of the Monitor Model
    filter_s: float = 12e-3  # half width over which a measured motion is differentiated, for inverse dynamics
    torque_known: bool = True  # whether the torque constant is known, so that currents can be told as torques
    mapping: tuple[str, ...] = ()  # of its recordings' columns, as for --map
    rules: tuple[Rule, ...] = ()

    @property
    def has_reference_model(self) -> bool:
        """Whether it is the kind that the three-phase Reference Model describes."""
        return self.controller.kind == "cascade" and self.inverter.kind == "hysteresis"

    @property
    def k(self) -> NDArray[np.float64]:
        """The known faults with the healthy ones, (8,)."""
        return vector(self.faults)

    @property
    def current_limit_A(self) -> Any:
        """The most current, A, that controller and drive allow; (n,) where one of them is."""
        return np.minimum(self.controller.current_limit_A, self.inverter.current_limit_A)

    def circuit(self, preferred: str = "reduced") -> str:
        """The Monitor Model's drive; `preferred` is the circuit for the hysteresis current loop."""
        return preferred if self.inverter.kind == "hysteresis" else self.inverter.kind

    def value(self, path: str) -> float:
        """The value of "section.parameter", or of "effects.name.parameter"."""
        section, *names = path.split(".")
        if section == "effects":
            return float(self.effects[names[0]][names[1]])
        return float(getattr(getattr(self, section), names[0]))

    def with_values(self, values: dict[str, float]) -> Actuator:
        """A copy with some "section.parameter" changed; InputError for an impossible value."""
        from ema_model.actuator.unread import check_value_is_read  # which needs what stands here

        changed = self
        for path, value in values.items():
            section, _, name = path.partition(".")
            if section == "effects":
                changed = changed.varied({path: float(value)})
                continue
            if section not in SECTIONS or name not in numbers(section):
                raise InputError(f"no actuator parameter {path!r}; write it as section.name, e.g. motor.inertia_kgm2")
            check_value(section, name, value, "actuator")
            check_value_is_read(changed, path, value, "actuator")
            changed = changed.varied({path: float(value)})
        check_stops(changed.transmission, "actuator")
        return changed

    def varied(self, values: dict[str, Any]) -> Actuator:
        """A copy with values set unchecked; they may be arrays (n,), one value for each run of a population."""
        sections: dict[str, Any] = {}
        for path, value in values.items():
            section, *names = path.split(".")
            if section == "effects":
                effects = sections.setdefault("effects", {name: dict(given) for name, given in self.effects.items()})
                effects[names[0]][names[1]] = value
            else:
                sections[section] = replace(sections.get(section, getattr(self, section)), **{names[0]: value})
        return replace(self, **sections)

    def for_recording(self, name: str) -> Actuator:
        """The actuator as it was in the recording of that name (`rules`)."""
        values = {path: value for rule in self.rules_for(name) for path, value in rule.values.items()}
        return self.with_values(values) if values else self

    def rules_for(self, name: str) -> tuple[Rule, ...]:
        """The rules that hold for a recording of that name."""
        return tuple(rule for rule in self.rules if fnmatchcase(name, rule.match))


def numbers(section: str) -> tuple[str, ...]:
    """Names of a section's numeric parameters."""
    return tuple(f.name for f in fields(SECTIONS[section]) if f.name != "kind")


def low_limit(path: str) -> float:
    """The least value that a parameter may take; 0 where it must only be above."""
    name = path.split(".")[-1]
    return -math.inf if path.startswith("effects.") or name in _ANY_SIGN else 0.0


def check_value(section: str, name: str, value: Any, where: str) -> None:
    """Raises InputError for what is no number, or not one that this parameter can have."""
    if not math.isfinite(as_number(value)):
        raise InputError(f"{where}: [{section}] {name} must be a number, not {str(value)[:40]!r}")
    if name in _POSITIVE and value <= 0.0:
        raise InputError(f"{where}: [{section}] {name} must be above 0, not {value!r}")
    if name not in _ANY_SIGN and value < 0.0:
        raise InputError(f"{where}: [{section}] {name} must not be negative, not {value!r}")


def check_stops(transmission: Transmission, where: str) -> None:
    """Raises InputError for end stops in the wrong order."""
    if not transmission.stop_low_rad < transmission.stop_high_rad:
        raise InputError(f"{where}: [transmission] stop_low_rad must be below stop_high_rad")
