"""Signals, and the axes that give them their names and units: rotary and linear ones."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from ema_model.quantities.numbers import Quantity
from ema_model.quantities.si import linear_name, linear_unit
from ema_model.quantities.sides import MOTOR, USER, Side
from ema_model.quantities.titles import in_sentence

# --- the canonical signals of a measurement: their column names, titles, symbols and units ----------------------------

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


# --- rotary and linear axes: the equations are the same, the names and the units are not ------------------------------
# Inside, every quantity has its rotary name; an angle of a linear axis is a length in m, a torque a force in N, an
# inertia a mass in kg.  Files and people see the axis's own names.  Motor and user may differ: a ball screw turns
# in the motor's rad and moves in the user's m, and its gear ratio is in m/rad.

KINDS = ("rotary", "linear")


@dataclass(frozen=True)
class Axes:
    """The kind of the motor's and of the user's axis: "rotary" or "linear"."""

    motor: str = "rotary"
    user: str = "rotary"

    def is_linear(self, side: Side | None) -> bool:
        """Whether what sits at that side is a length and not an angle; what has no side never is."""
        return (side == MOTOR and self.motor == "linear") or (side == USER and self.user == "linear")

    def name(self, name: str, side: Side | None) -> str:
        """The name in files of what is `name` inside: inertia_kgm2 or mass_kg."""
        return linear_name(name) if self.is_linear(side) else name

    def unit(self, unit: str, side: Side | None, per: Side | None = None) -> str:
        """The unit, as shown, of what has `unit` on rotary axes.

        per: the side whose angle stands below the line of what rotary axes leave out as rad/rad: of a gear ratio, the
        user's angle per motor's; of an order, periods per turn.
        """
        if per is None:
            return linear_unit(unit) if self.is_linear(side) else unit
        above, below = ("m" if self.is_linear(one) else "rad" for one in (side, per))
        if above == below:
            return unit
        return f"{above}/{below}" if not unit else unit.replace("1/", f"{above}/({below}·") + ")"

    def signal(self, name: str) -> str:
        """The name in recordings of the signal that is `name` inside."""
        signal = SIGNALS.get(name)
        return name if signal is None else self.name(name, signal.side)

    def inside(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Signals by their names inside; those of the other kind of axis are left out."""
        names = {self.signal(name): name for name in ROTARY_SIGNALS}
        foreign = {linear_name(name) for name in ROTARY_SIGNALS} | ROTARY_SIGNALS
        return {
            names.get(name, name): values for name, values in signals.items() if name in names or name not in foreign
        }

    def of_other_axes(self, signals: Iterable[str]) -> tuple[str, ...]:
        """Those of recordings' signals that only axes of the other kind have: what `inside` leaves out."""
        return tuple(name for name in signals if not self.inside({name: None}))

    def mismatch(self, needed: str, signals: Iterable[str]) -> str:
        """What is wrong, where a recording has what is `needed` inside for the other kind of axis; else ""."""
        other = next((name for name in (needed, linear_name(needed)) if name != self.signal(needed)), "")
        if not other or other not in signals:
            return ""
        kind, own = KINDS if other == needed else KINDS[::-1]
        return (
            f"the recording's axis is {kind}, as {other} says, and the actuator's is {own}; "
            "take an actuator of that axis, or correct [axes] in the actuator's file"
        )

    def outside(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Signals by the names that recordings have."""
        return {self.signal(name): values for name, values in signals.items()}


ROTARY_SIGNALS = {name for name, signal in SIGNALS.items() if signal.side and linear_name(name) != name}
ROTARY = Axes()


# --- signals and what is left of them, as figures, tables and sentences show them -------------------------------------


def of_signal(name: str, axes: Axes) -> Quantity:
    """A signal in its own unit, by its name inside or in files."""
    signal = SIGNALS.get(axes.signal(name))
    if signal is None:
        return Quantity(name.replace("_", " "), "")
    return Quantity(signal.title, signal.unit, symbol=signal.symbol)


def of_residual(name: str, axes: Axes, torque_constant: float | None = None) -> Quantity:
    """What is left of a signal; with a torque constant, N·m/A, the current's is told as the motor's torque."""
    if name == "current_A" and torque_constant is not None:
        torque = SIGNALS[axes.signal("motor_torque_Nm")]
        return Quantity(f"Residual {torque.kind}", torque.unit, torque_constant, f"Δ{torque.symbol}")
    whole = of_signal(name, axes)
    return Quantity(
        f"Residual {in_sentence(whole.title.removeprefix('Equivalent '))}", whole.unit, symbol=f"Δ{whole.symbol}"
    )
