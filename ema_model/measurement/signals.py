"""The canonical signals of a recording: names that carry their SI unit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Signal:
    """One column of a recording."""

    name: str
    title: str
    unit: str


_ROWS = (
    ("time_s", "Time", "s"),
    ("command_rad", "Command", "rad"),
    ("user_position_rad", "User position", "rad"),
    ("motor_position_rad", "Motor position", "rad"),
    ("motor_speed_rad_s", "Motor speed", "rad/s"),
    ("current_A", "Equivalent current", "A"),
    ("phase_a_current_A", "Phase A current", "A"),
    ("phase_b_current_A", "Phase B current", "A"),
    ("phase_c_current_A", "Phase C current", "A"),
    ("motor_torque_Nm", "Motor torque", "N·m"),
    ("bus_voltage_V", "Bus voltage", "V"),
    ("motor_voltage_V", "Motor voltage", "V"),
    ("duty", "Duty", ""),
    ("drive_enabled", "Drive enabled", ""),
    ("load_torque_Nm", "Load torque", "N·m"),
    ("temperature_C", "Temperature", "°C"),
    ("segment", "Segment", ""),
)
SIGNALS: dict[str, Signal] = {row[0]: Signal(*row) for row in _ROWS}
