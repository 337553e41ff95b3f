"""What an actuator's file may not say, because no model of its kind would read it: refused with the reason.

A number that nothing reads would look as if it had been taken into account.  At its neutral value, which is its
default, it says nothing and may stand.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields

from ema_model.actuator.naming import on_axes
from ema_model.actuator.parameters import SECTIONS
from ema_model.errors import InputError
from ema_model.quantities.axes import Axes

_CONTROLLERS = {
    "cascade": {
        "gain_1_rad output_limit": "a cascade's gains are of speed, its limit is current_limit_A",
    },
    "position": {
        "speed_limit_rad_s speed_gain_Nms_rad integral_gain_Nm_rad derivative_gain_Nms2_rad integrator_window_rad "
        "torque_constant_Nm_A": "a position controller has no speed loop",
        "position_gain_1_s": "a position controller's gain is gain_1_rad",
        "current_limit_A": "a position controller's limit is output_limit",
    },
    "open": {
        " ".join(f.name for f in fields(SECTIONS["controller"])): "an open loop has no controller",
    },
    "unknown": {
        " ".join(f.name for f in fields(SECTIONS["controller"])): "a controller that is not known has no parameters",
    },
}
NO_WINDING = "an ideal current source has no winding"
_DRIVES = {
    "hysteresis": {
        "inverter": {"current_limit_A": "a hysteresis inverter's limit is [controller] current_limit_A"},
    },
    "current": {
        "inverter": {"bus_voltage_V hysteresis_band_A": "an ideal current source has no voltage and no relays"},
        "motor": {"resistance_Ohm inductance_H emf_scale": NO_WINDING},
    },
    "voltage": {
        "inverter": {
            "hysteresis_band_A": "a voltage drive has no relays",
            "current_limit_A": "a voltage drive does not limit its current",
        },
        "motor": {"emf_scale": "with a voltage drive the EMF's constant is the torque constant"},
    },
}
INVERSE = "the controller is unknown, and inverse dynamics"
_CURRENT_IN = "the recorded current or torque is put in as it is"
_LOOP = {"apparent_inertia": "it is of inverse dynamics, for an unknown controller"}
_VOLTAGE_IN = "the recorded voltage or duty is put in, and nothing is controlled"
_SENSORS = {"unknown": {}, "open": {"current_gain current_bias_A": _CURRENT_IN, **_LOOP}}
# Instead of the drive's, where a measured motion is put in and the current that it needs comes out.
_MOTION_IN = {
    "inverter": {"bus_voltage_V hysteresis_band_A current_limit_A": f"{INVERSE} has no drive"},
    "motor": {
        "resistance_Ohm inductance_H emf_scale": f"{INVERSE} has no winding",
        "rotor_offset_rad": f"{INVERSE} has no phases",
        "torque_limit_Nm": f"{INVERSE} asks for what a motion needs, without a limit",
    },
    "transmission": {
        "backlash_rad": f"{INVERSE} does not follow the play",
        "stop_low_rad stop_high_rad": f"{INVERSE} takes the motion as measured",
    },
}
# The places of effects (`PLACES`) that inverse dynamics has, and those that a winding alone has.
INVERSE_PLACES = ("current_reading", "electric_torque", "inverse_inertia", "moving_friction", "shaft_torque")
WINDING_PLACES = ("back_emf", "bus_voltage", "winding_resistance")
# Those of the drive's controller that a position controller has not, and that a voltage drive has not.
SPEED_LOOP_PLACES = ("speed_reading", "speed_sample", "speed_command", "speed_gain", "integral_gain", "loop_torque")
# The command, which an open loop has none of; what is only remembered of it there changes nothing.
GOAL_PLACES = ("goal", "position_error")
CURRENT_LOOP_PLACES = ("current_reference",)
# All stages of a drive, and what the reading of a current changes, where the current is put in.
CURRENT_IN_PLACES = (*GOAL_PLACES, *SPEED_LOOP_PLACES, "drive_output", *CURRENT_LOOP_PLACES, "current_reading")
# The same where a voltage is put in: what the drive computes may take effect late, and the current is measured.
VOLTAGE_IN_PLACES = (*GOAL_PLACES, *SPEED_LOOP_PLACES, *CURRENT_LOOP_PLACES)


def idle(places: Collection[str], has_states: bool, controller: str, inverter: str) -> str:
    """Why an effect with these places does nothing to an actuator of these kinds; "" where it may act."""
    at = set(places)
    if controller == "unknown" and (has_states or not at & set(INVERSE_PLACES)):
        return f"{INVERSE} does not simulate what it acts on"
    if controller == "open" and inverter != "voltage" and at <= set(CURRENT_IN_PLACES):
        return f"in an open loop {_CURRENT_IN}"
    if controller == "open" and at <= set(VOLTAGE_IN_PLACES):
        return f"in an open loop {_VOLTAGE_IN}"
    if inverter == "current" and at <= set(WINDING_PLACES):
        return f"{NO_WINDING} for it to act on"
    if controller == "position" and at & set(SPEED_LOOP_PLACES) and at <= {"goal", *SPEED_LOOP_PLACES}:
        return "a position controller has no speed loop for it to act on"
    if inverter == "voltage" and at <= set(CURRENT_LOOP_PLACES):
        return "a voltage drive has no current loop for it to act on"
    return ""


def unread(controller: str, inverter: str) -> dict[str, str]:
    """Why no model reads it, by "section.parameter", for an actuator of these kinds."""
    drive = _MOTION_IN if controller == "unknown" else _DRIVES[inverter]
    sensors = _LOOP if inverter == "voltage" and controller == "open" else _SENSORS.get(controller, _LOOP)
    by_section = {**drive, "sensors": sensors, "controller": _CONTROLLERS[controller]}
    return {
        f"{section}.{name}": reason
        for section, reasons in by_section.items()
        for names, reason in reasons.items()
        for name in names.split()
        if name != "kind"
    }


def settings_read(controller: str) -> tuple[str, ...]:
    """The keys of [model] that a model of this kind of controller reads."""
    return (
        ("filter_s", "leaves_out_reversals", "torque_known") if controller == "unknown" else ("step_s", "torque_known")
    )


def check_value_is_read(controller: str, inverter: str, axes: Axes, path: str, value: float, where: str) -> None:
    """Raises InputError with the reason for a value, other than the neutral one, that no model would read."""
    section, _, name = path.partition(".")
    reason = unread(controller, inverter).get(path)
    neutral = getattr(SECTIONS[section], name, None)  # a dataclass keeps its defaults on the class
    if reason is not None and value != neutral:
        raise InputError(f"{where}: {on_axes(path, axes).path}: {reason}; leave it out")
