"""The canonical signals of a measurement: their column names, titles, symbols and units."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from ema_model.quantities.sides import MOTOR, USER, Side

Kind = Literal["time", "position", "speed", "current", "torque", "force", "voltage", "ratio", "temperature", "state"]


@dataclass(frozen=True)
class Signal:
    """One canonical column; `unit` is as shown to people, `name` ends in its plain spelling.

    A `state` is a whole number that is held between samples; the other kinds are interpolated.  What moves or pushes
    says at which side: a linear axis gives it another name and unit.
    """

    name: str
    title: str
    symbol: str
    unit: str
    kind: Kind
    side: Side | None = None


_ALL = (
    Signal("time_s", "Time", "t", "s", "time"),
    Signal("command_rad", "Command", "θ_cmd", "rad", "position", USER),
    Signal("user_position_rad", "User position", "θ_u", "rad", "position", USER),
    Signal("user_speed_rad_s", "User speed", "ω_u", "rad/s", "speed", USER),
    Signal("motor_position_rad", "Motor position", "θ_m", "rad", "position", MOTOR),
    Signal("motor_speed_rad_s", "Motor speed", "ω_m", "rad/s", "speed", MOTOR),
    Signal("current_A", "Equivalent current", "I_eq", "A", "current"),
    Signal("phase_a_current_A", "Phase A current", "I_A", "A", "current"),
    Signal("phase_b_current_A", "Phase B current", "I_B", "A", "current"),
    Signal("phase_c_current_A", "Phase C current", "I_C", "A", "current"),
    Signal("motor_torque_Nm", "Motor torque", "T_m", "N·m", "torque", MOTOR),
    Signal("bus_voltage_V", "Bus voltage", "V_bus", "V", "voltage"),
    Signal("motor_voltage_V", "Motor voltage", "V_m", "V", "voltage"),
    Signal("duty", "Duty", "d", "", "ratio"),
    Signal("drive_enabled", "Drive enabled", "on", "", "state"),
    Signal("load_torque_Nm", "Load torque", "T_L", "N·m", "torque", USER),
    Signal("temperature_C", "Temperature", "ϑ", "°C", "temperature"),
    Signal("segment", "Segment", "seg", "", "state"),
    # linear axes
    Signal("command_m", "Command", "x_cmd", "m", "position", USER),
    Signal("user_position_m", "User position", "x_u", "m", "position", USER),
    Signal("user_speed_m_s", "User speed", "v_u", "m/s", "speed", USER),
    Signal("motor_position_m", "Motor position", "x_m", "m", "position", MOTOR),
    Signal("motor_speed_m_s", "Motor speed", "v_m", "m/s", "speed", MOTOR),
    Signal("motor_force_N", "Motor force", "F_m", "N", "force", MOTOR),
    Signal("load_force_N", "Load force", "F_L", "N", "force", USER),
)
SIGNALS: dict[str, Signal] = {signal.name: signal for signal in _ALL}

# Spellings of units at the end of a column's name, in small letters.
_UNITS = (
    *("rad_s", "rad_per_s", "deg_s", "deg_per_s", "rev_s", "rpm", "m_s", "mm_s", "m_per_s", "mm_per_s"),
    *("milliseconds", "seconds", "sec", "ms", "us", "s", "radians", "rad", "mrad", "degrees", "deg", "rev", "turns"),
    *("mm", "um", "m", "ma", "a", "mv", "v", "mnm", "ncm", "nm", "kn", "n", "degc", "c", "k", "f", "percent", "pct"),
)
_UNIT = re.compile("_(" + "|".join(sorted(_UNITS, key=len, reverse=True)) + ")$")
_TIMES = {"t", "time", "times", "timestamp", "seconds", "sec", "elapsed", "elapsed_time"}


def _stem(name: str) -> str:
    """The name in small letters and underscores, without its unit: "motorSpeed [rpm]" gives motor_speed."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", "_", name)
    return _UNIT.sub("", re.sub(r"[^a-z0-9]+", "_", spaced.lower()).strip("_"))


_STEMS = {name: _stem(name) for name in SIGNALS}


def lookalikes(name: str) -> tuple[str, ...]:
    """Canonical names that a foreign name may stand for: `speed` or `motor_speed_rpm` for motor_speed_rad_s."""
    stem = _stem(name)
    same = tuple(known for known in SIGNALS if _STEMS[known] == stem)
    return same or tuple(known for known in SIGNALS if stem and _STEMS[known].endswith("_" + stem))


def looks_like_time(name: str) -> bool:
    """Whether a foreign name, such as `t`, `time` or `time_ms`, stands for time."""
    return _stem(name) in _TIMES
