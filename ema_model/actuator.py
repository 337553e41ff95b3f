"""The actuator's parameters, their tolerances, and the TOML file that holds them."""

from __future__ import annotations

import math
import tomllib
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any

from ema_model.errors import InputError


@dataclass(frozen=True)
class Controller:
    """Control electronics (T 3.2.3)."""

    position_gain_1_s: float
    speed_limit_rad_s: float
    speed_gain_Nms_rad: float
    integral_gain_Nm_rad: float
    derivative_gain_Nms2_rad: float
    integrator_window_rad: float
    torque_constant_Nm_A: float
    current_limit_A: float


@dataclass(frozen=True)
class Inverter:
    """Power electronics (T 3.2.5)."""

    bus_voltage_V: float
    hysteresis_band_A: float


@dataclass(frozen=True)
class Motor:
    """Electric motor and rotor (T 3.2.5, Table 3.3)."""

    resistance_Ohm: float
    inductance_H: float
    torque_constant_Nm_A: float
    emf_scale: float
    pole_pairs: float
    torque_limit_Nm: float
    inertia_kgm2: float
    viscous_friction_Nms_rad: float
    static_friction_Nm: float
    dynamic_friction_Nm: float
    rotor_offset_rad: float


@dataclass(frozen=True)
class Transmission:
    """Gear, screw and user (T 3.2.6)."""

    gear_ratio: float
    backlash_rad: float
    viscous_friction_Nms_rad: float
    stop_low_rad: float
    stop_high_rad: float


@dataclass(frozen=True)
class Sensors:
    """What the recording adds to the true signals."""

    current_gain: float
    current_bias_A: float
    delay_s: float


@dataclass(frozen=True)
class Tolerance:
    """What is not known of a parameter: 1 σ in its own unit, and whether a calibration may move it."""

    sigma: float
    free: bool


_SECTIONS = {
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
}  # fmt: skip
_ANY_SIGN = {"rotor_offset_rad", "current_bias_A", "stop_low_rad", "stop_high_rad"}


@dataclass(frozen=True)
class Actuator:
    """All parameters of one actuator; SI units, which the names say."""

    name: str
    controller: Controller
    inverter: Inverter
    motor: Motor
    transmission: Transmission
    sensors: Sensors
    tolerances: dict[str, Tolerance] = field(default_factory=dict)  # by "section.parameter"
    description: str = ""

    def value(self, path: str) -> float:
        """The value of "section.parameter"."""
        section, name = path.split(".")
        return float(getattr(getattr(self, section), name))

    def with_values(self, values: dict[str, float]) -> Actuator:
        """A copy with some "section.parameter" changed; InputError for an impossible value."""
        changed: dict[str, Any] = {}
        for path, value in values.items():
            section, _, name = path.partition(".")
            if section not in _SECTIONS or name not in {f.name for f in fields(_SECTIONS[section])}:
                raise InputError(f"no actuator parameter {path!r}; write it as section.name, e.g. motor.inertia_kgm2")
            _check(section, name, value, "actuator")
            changed[section] = replace(changed.get(section, getattr(self, section)), **{name: float(value)})
        _check_stops(changed.get("transmission", self.transmission), "actuator")
        return replace(self, **changed)


def paths() -> tuple[str, ...]:
    """Every "section.parameter"."""
    return tuple(f"{section}.{f.name}" for section, cls in _SECTIONS.items() for f in fields(cls))


def load_actuator(path: str | Path | None = None) -> Actuator:
    """The actuator of a TOML file, or the thesis's own without one; InputError tells what is wrong in it."""
    if path is None:
        return _parse(shipped("thesis.toml"), "thesis.toml")
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such actuator file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; an actuator file (.toml) is expected") from None
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "not UTF-8"
        raise InputError(f"{path}: cannot be read as text ({why})") from None
    return _parse(text, str(path))


def shipped(name: str) -> str:
    """Text of an actuator file that comes with the package (assets/actuators)."""
    inside = resources.files("ema_model") / "assets" / "actuators" / name
    if inside.is_file():
        return inside.read_text(encoding="utf-8")
    return (Path(__file__).parents[1] / "assets" / "actuators" / name).read_text(encoding="utf-8")


def _parse(text: str, where: str) -> Actuator:
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not valid TOML: {error}") from None
    if document.get("schema", 1) != 1:
        raise InputError(f"{where}: schema {document['schema']!r} is not known; this version reads schema 1")
    unknown = set(document) - set(_SECTIONS) - {"schema", "name", "description"}
    if unknown:
        raise InputError(f"{where}: unknown entry {sorted(unknown)[0]!r}; sections are {', '.join(_SECTIONS)}")
    tolerances: dict[str, Tolerance] = {}
    sections: dict[str, Any] = {}
    for section, cls in _SECTIONS.items():
        given = document.get(section, {})
        if not isinstance(given, dict):
            raise InputError(f"{where}: [{section}] must be a table")
        names = [f.name for f in fields(cls)]
        for extra in set(given) - set(names):
            raise InputError(f"{where}: [{section}] has no parameter {extra!r}; it has {', '.join(names)}")
        values = {}
        for name in names:
            if name not in given:
                raise InputError(f"{where}: [{section}] lacks {name}")
            values[name], tolerance = _entry(section, name, given[name], where)
            if tolerance is not None:
                tolerances[f"{section}.{name}"] = tolerance
        sections[section] = cls(**values)
    _check_stops(sections["transmission"], where)
    return Actuator(
        name=str(document.get("name", Path(where).stem)),
        description=str(document.get("description", "")),
        tolerances=tolerances,
        **sections,
    )


def _entry(section: str, name: str, entry: Any, where: str) -> tuple[float, Tolerance | None]:
    tolerance = None
    value = entry
    if isinstance(entry, dict):
        extra = set(entry) - {"value", "tolerance", "sigma", "free"}
        if extra or "value" not in entry:
            raise InputError(f"{where}: [{section}] {name} takes value, tolerance or sigma, free")
        value = entry["value"]
    _check(section, name, value, where)
    if isinstance(entry, dict) and ("tolerance" in entry or "sigma" in entry):
        given, scale = (entry["sigma"], 1.0) if "sigma" in entry else (entry["tolerance"], abs(value))
        sigma = _number(given) * scale
        if not 0.0 < sigma < math.inf:
            raise InputError(f"{where}: [{section}] {name}: the tolerance must be above 0 (sigma where value is 0)")
        free = entry.get("free", True)
        if not isinstance(free, bool):
            raise InputError(f"{where}: [{section}] {name}: free must be true or false, not {free!r}")
        tolerance = Tolerance(sigma, free)
    return float(value), tolerance


def _check(section: str, name: str, value: Any, where: str) -> None:
    if not math.isfinite(_number(value)):
        raise InputError(f"{where}: [{section}] {name} must be a number, not {str(value)[:40]!r}")
    if name in _POSITIVE and value <= 0.0:
        raise InputError(f"{where}: [{section}] {name} must be above 0, not {value!r}")
    if name not in _ANY_SIGN and value < 0.0:
        raise InputError(f"{where}: [{section}] {name} must not be negative, not {value!r}")


def _check_stops(transmission: Transmission, where: str) -> None:
    if not transmission.stop_low_rad < transmission.stop_high_rad:
        raise InputError(f"{where}: [transmission] stop_low_rad must be below stop_high_rad")


def _number(value: Any) -> float:
    """The number, or NaN for what is none (or too large to be one)."""
    try:
        return math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
