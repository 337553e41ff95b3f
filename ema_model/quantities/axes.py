"""Rotary and linear axes: the equations are the same, the names and the units are not.

Inside, every quantity has its rotary name; an angle of a linear axis is a length in m, a torque a force in N, an
inertia a mass in kg.  Files and people see the axis's own names.  Motor and user may differ: a ball screw turns
in the motor's rad and moves in the user's m, and its gear ratio is in m/rad.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

KINDS = ("rotary", "linear")
_UNITS = {
    "_Nms2_rad": "_Ns2_m",
    "_Nms_rad": "_Ns_m",
    "_Nm_rad": "_N_m",
    "_Nm_A": "_N_A",
    "_kgm2": "_kg",
    "_rad_s": "_m_s",
    "_1_rad": "_1_m",
    "_rad": "_m",
    "_Nm": "_N",
}
_SHOWN = {
    "N·m·s²/rad": "N·s²/m",
    "N·m·s/rad": "N·s/m",
    "N·m/rad": "N/m",
    "N·m/A": "N/A",
    "kg·m²": "kg",
    "rad/s²": "m/s²",
    "rad/s": "m/s",
    "1/rad": "1/m",
    "rad": "m",
    "N·m": "N",
}
# Parameters at the user; what else is mechanical belongs to the motor.
_USER_PARAMETERS = frozenset(
    "integrator_window_rad gain_1_rad backlash_rad stop_low_rad stop_high_rad stiffness_Nm_rad offset_Nm torque_Nm "
    "moment_Nm angle_rad".split()
)
_USER_SIGNALS = frozenset("command_rad user_position_rad load_torque_Nm".split())


@dataclass(frozen=True)
class Axes:
    """The kind of the motor's and of the user's axis: "rotary" or "linear"."""

    motor: str = "rotary"
    user: str = "rotary"

    def parameter(self, name: str) -> str:
        """The name in files of the parameter that is `name` inside."""
        return linear_name(name) if self._is_linear(name in _USER_PARAMETERS) else name

    def path(self, path: str) -> str:
        """The same for "section.parameter"; names without a section stay."""
        section, dot, name = path.rpartition(".")
        return f"{section}{dot}{self.parameter(name)}" if dot else path

    def signal(self, name: str) -> str:
        """The name in recordings of the signal that is `name` inside."""
        return linear_name(name) if self._is_linear(name in _USER_SIGNALS) else name

    def variable_unit(self, variable: str) -> str:
        """The unit, as shown, of a variable that residuals are held against."""
        rotary = _VARIABLE_UNITS[variable]
        user = variable in ("user_position", "load")
        return _SHOWN.get(rotary, rotary) if self._is_linear(user) else rotary

    def inside(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Signals by their names inside; those of the other kind of axis are left out."""
        names = {self.signal(name): name for name in ROTARY_SIGNALS}
        foreign = {linear_name(name) for name in ROTARY_SIGNALS} | ROTARY_SIGNALS
        return {
            names.get(name, name): values for name, values in signals.items() if name in names or name not in foreign
        }

    def outside(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Signals by the names that recordings have."""
        return {self.signal(name): values for name, values in signals.items()}

    def _is_linear(self, of_user: bool) -> bool:
        return (self.user if of_user else self.motor) == "linear"


ROTARY_SIGNALS = _USER_SIGNALS | {"motor_position_rad", "motor_speed_rad_s", "motor_torque_Nm"}
_VARIABLE_UNITS = {
    "motor_angle": "rad",
    "user_position": "rad",
    "motor_speed": "rad/s",
    "acceleration": "rad/s²",
    "current": "A",
    "load": "N·m",
    "time": "s",
    "temperature": "°C",
}


def linear_name(name: str) -> str:
    """The linear counterpart of a rotary name: inertia_kgm2 → mass_kg, load_torque_Nm → load_force_N."""
    for rotary, linear in _UNITS.items():
        if name.endswith(rotary):
            name = name.removesuffix(rotary) + linear
            break
    return name.replace("inertia", "mass").replace("torque", "force")
