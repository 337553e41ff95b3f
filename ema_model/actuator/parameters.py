"""An actuator's parameters and their tolerances."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

from ema_model.errors import InputError, quoted
from ema_model.quantities.axes import Axes
from ema_model.quantities.numbers import as_number
from ema_model.quantities.sides import MOTOR, USER

_FAR = 1e9  # rad, where an end stop is out of reach


# Where a parameter sits: the side whose axis it is of, and for what is rad/rad, the side that it is counted by.
_MOTOR = {"side": MOTOR}
_USER = {"side": USER}
_MOTOR_PER_USER = {"side": MOTOR, "per": USER}
_USER_PER_MOTOR = {"side": USER, "per": MOTOR}


@dataclass(frozen=True)
class Controller:
    """Control electronics.

    cascade: position and PID speed loop (T 3.2.3; `ema_model.physics.controller`).  With a hysteresis inverter it is
    the thesis's, whose integral is held at standstill.  position: a position loop alone, whose output is a share of
    what the drive can give.  unknown: recordings are held against inverse dynamics.
    """

    kind: str = "cascade"
    position_gain_1_s: float = field(default=0.0, metadata=_MOTOR_PER_USER)
    speed_limit_rad_s: float = field(default=0.0, metadata=_MOTOR)
    speed_gain_Nms_rad: float = field(default=0.0, metadata=_MOTOR)
    integral_gain_Nm_rad: float = field(default=0.0, metadata=_MOTOR)
    derivative_gain_Nms2_rad: float = field(default=0.0, metadata=_MOTOR)
    integrator_window_rad: float = field(default=1.0, metadata=_USER)
    torque_constant_Nm_A: float = field(default=1.0, metadata=_MOTOR)
    current_limit_A: float = math.inf
    gain_1_rad: float = field(default=0.0, metadata=_USER)
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

    torque_constant_Nm_A: float = field(metadata=_MOTOR)
    inertia_kgm2: float = field(metadata=_MOTOR)
    viscous_friction_Nms_rad: float = field(metadata=_MOTOR)
    static_friction_Nm: float = field(metadata=_MOTOR)
    dynamic_friction_Nm: float = field(metadata=_MOTOR)
    resistance_Ohm: float = 1.0
    inductance_H: float = 1e-6
    emf_scale: float = 1.0
    pole_pairs: float = 1.0
    torque_limit_Nm: float = field(default=1e9, metadata=_MOTOR)
    rotor_offset_rad: float = field(default=0.0, metadata=_MOTOR)


@dataclass(frozen=True)
class Transmission:
    """Gear, screw and user (T 3.2.6)."""

    gear_ratio: float = field(default=1.0, metadata=_USER_PER_MOTOR)
    backlash_rad: float = field(default=0.0, metadata=_USER)
    viscous_friction_Nms_rad: float = field(default=0.0, metadata=_MOTOR)
    stop_low_rad: float = field(default=-_FAR, metadata=_USER)
    stop_high_rad: float = field(default=_FAR, metadata=_USER)


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
_BEHIND = "sensors.delay_s"
_ANY_SIGN = {"rotor_offset_rad", "current_bias_A", "stop_low_rad", "stop_high_rad"}


def numbers(section: str) -> tuple[str, ...]:
    """Names of a section's numeric parameters."""
    return tuple(f.name for f in fields(SECTIONS[section]) if f.name != "kind")


def low_limit(path: str, controller: str = "") -> float:
    """The least value that a parameter may take; 0 where it must only be above.

    controller: its kind; without a known one, the sensors' delay is that of one signal behind another, of any sign.
    """
    name = path.split(".")[-1]
    any_sign = name in _ANY_SIGN or (controller == "unknown" and path == _BEHIND)
    return -math.inf if path.startswith("effects.") or any_sign else 0.0


def check_value(section: str, name: str, value: Any, where: str, shown: str = "") -> None:
    """Raises InputError for what is no number, or not one that this parameter can have; shown: its name in files."""
    shown = shown or name
    if not math.isfinite(as_number(value)):
        raise InputError(f"{where}: [{section}] {shown} must be a number, not {quoted(value, 40)!r}")
    if name in _POSITIVE and value <= 0.0:
        raise InputError(f"{where}: [{section}] {shown} must be above 0, not {quoted(value)}")
    if name not in _ANY_SIGN and f"{section}.{name}" != _BEHIND and value < 0.0:
        raise InputError(f"{where}: [{section}] {shown} must not be negative, not {quoted(value)}")


def check_stops(transmission: Transmission, axes: Axes, where: str) -> None:
    """Raises InputError for end stops in the wrong order."""
    if not transmission.stop_low_rad < transmission.stop_high_rad:
        low, high = (axes.name(name, USER) for name in ("stop_low_rad", "stop_high_rad"))
        raise InputError(f"{where}: [transmission] {low} must be below {high}")
