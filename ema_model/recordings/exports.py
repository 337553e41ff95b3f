"""Logs of tools whose columns are known by their makers' code: what is in which column, in which unit.

A tool is known by the names of its columns; one that writes numbers alone is no more than likely, and is only named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ema_model.recordings.column_names import Guess


@dataclass(frozen=True)
class Export:
    """What is known of a tool's log."""

    title: str  # "this is …"
    names: frozenset[str] = frozenset()  # that it has among its columns
    columns: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # by name: the signal and its unit
    hint: str = ""  # what else a person needs
    unnamed: int = 0  # columns, where it writes numbers alone

    def guess(self, column: str) -> Guess | str:
        """The signal of a column, or why it is none."""
        if column not in self.columns:
            return f"no signal of {self.title}"
        return Guess(*self.columns[column], 0.95, f"{self.title} has it so")

    @property
    def sentence(self) -> str:
        """In a line: "this is a VESC Tool log; …"."""
        return f"this is {self.title}; {self.hint}" if self.names else f"{self.hint}, if this is {self.title}"


_EXPORTS = (
    # vedderb/vesc_tool, vescinterface.cpp: openRtLogFile writes the names, valuesReceived the numbers.
    Export(
        "a VESC Tool log",
        frozenset({"ms_today", "input_voltage", "current_motor", "q_axis_current", "erpm", "duty_cycle"}),
        {
            "ms_today": ("time_s", "ms"),
            "q_axis_current": ("current_A", "A"),
            "input_voltage": ("bus_voltage_V", "V"),
            "duty_cycle": ("duty", "1"),
            "temp_motor": ("temperature_C", "degC"),
        },
        "its erpm is the speed times the pole pairs, for 7 of them --map 'motor_speed_rad_s=erpm[rpm, scale=0.1429]', "
        "and encoder_position is in degrees of the position controller",
    ),
    # simplefoc/Arduino-FOC, FOCMotor.cpp, FOCMotor::monitor: all of monitor_variables, between tabs
    Export(
        "all that SimpleFOC's monitor prints",
        hint="the columns are target, voltage q and d [V], current q and d [mA], speed [rad/s] and angle [rad]",
        unnamed=7,
    ),
)


def known_export(header: Sequence[str]) -> Export | None:
    """The tool that writes such columns, where one is known."""
    is_bare = bool(header) and all(name == f"#{i}" for i, name in enumerate(header, 1))
    for one in _EXPORTS:
        if one.names <= set(header) if one.names else (is_bare and len(header) == one.unnamed):
            return one
    return None
