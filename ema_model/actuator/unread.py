"""What an actuator's file may not say, because no model of its kind would read it: refused with the reason.

A number that nothing reads would look as if it had been taken into account.  At its neutral value, which is its
default, it says nothing and may stand.
"""

from __future__ import annotations

from dataclasses import fields

from ema_model.actuator.parameters import SECTIONS, Actuator
from ema_model.errors import InputError

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
    "unknown": {
        " ".join(f.name for f in fields(SECTIONS["controller"])): "a controller that is not known has no parameters",
    },
}
_NO_WINDING = "an ideal current source has no winding"
_DRIVES = {
    "hysteresis": {
        "inverter": {"current_limit_A": "a hysteresis inverter's limit is [controller] current_limit_A"},
    },
    "current": {
        "inverter": {"bus_voltage_V hysteresis_band_A": "an ideal current source has no voltage and no relays"},
        "motor": {"resistance_Ohm inductance_H emf_scale": _NO_WINDING},
    },
    "voltage": {
        "inverter": {
            "hysteresis_band_A": "a voltage drive has no relays",
            "current_limit_A": "a voltage drive does not limit its current",
        },
        "motor": {"emf_scale": "with a voltage drive the EMF's constant is the torque constant"},
    },
}
_INVERSE = "the controller is unknown, and inverse dynamics"
# Instead of the drive's, where a measured motion is put in and the current that it needs comes out.
_MOTION_IN = {
    "inverter": {"bus_voltage_V hysteresis_band_A current_limit_A": f"{_INVERSE} has no drive"},
    "motor": {
        "resistance_Ohm inductance_H emf_scale": f"{_INVERSE} has no winding",
        "pole_pairs rotor_offset_rad": f"{_INVERSE} has no phases",
        "torque_limit_Nm": f"{_INVERSE} asks for what a motion needs, without a limit",
    },
    "transmission": {
        "backlash_rad": f"{_INVERSE} does not follow the play",
        "stop_low_rad stop_high_rad": f"{_INVERSE} takes the motion as measured",
    },
    "sensors": {"delay_s": f"{_INVERSE} has no command that anything could lag behind"},
}
# In the Reference Model alone (MODEL: T 3.3): known well enough by their values, but no fit could learn of them.
_REFERENCE_ONLY = ("inverter.hysteresis_band_A", "transmission.viscous_friction_Nms_rad")

# The places of effects (`ema_model.stacks.PLACES`) that inverse dynamics has, and those that a winding alone has.
INVERSE_PLACES = ("current_reading", "electric_torque", "inverse_inertia", "moving_friction", "shaft_torque")
WINDING_PLACES = ("back_emf", "bus_voltage", "winding_resistance")


def unread(controller: str, inverter: str) -> dict[str, str]:
    """Why no model reads it, by "section.parameter", for an actuator of these kinds."""
    drive = _MOTION_IN if controller == "unknown" else _DRIVES[inverter]
    by_section = {**drive, "controller": _CONTROLLERS[controller]}
    return {
        f"{section}.{name}": reason
        for section, reasons in by_section.items()
        for names, reason in reasons.items()
        for name in names.split()
        if name != "kind"
    }


def check_value_is_read(actuator: Actuator, path: str, value: float, where: str) -> None:
    """Raises InputError with the reason for a value, other than the neutral one, that no model would read."""
    section, _, name = path.partition(".")
    reason = unread(actuator.controller.kind, actuator.inverter.kind).get(path)
    neutral = getattr(SECTIONS[section], name, None)  # a dataclass keeps its defaults on the class
    if reason is not None and value != neutral:
        raise InputError(f"{where}: {actuator.axes.path(path)}: {reason}; leave it out")


def check_all_is_read(actuator: Actuator, where: str) -> None:
    """The same for all that an actuator's file says: values, tolerances, recordings' values, effects, settings."""
    known = actuator.controller.kind != "unknown"
    for section in SECTIONS:
        for one in fields(SECTIONS[section]):
            if one.name != "kind":
                path = f"{section}.{one.name}"
                check_value_is_read(actuator, path, getattr(getattr(actuator, section), one.name), where)
    for rule in actuator.rules:
        for path, value in rule.values.items():
            check_value_is_read(actuator, path, value, f"{where}: recordings.where {rule.match}")
    for path in set(actuator.tolerances) & set(unread(actuator.controller.kind, actuator.inverter.kind)):
        raise InputError(f"{where}: {actuator.axes.path(path)}: no model reads it, so that it cannot have a tolerance")
    for name in actuator.effects:
        _check_effect_acts(actuator, name, where)
    if not known and actuator.step_s != Actuator.step_s:
        raise InputError(f"{where}: model.step_s: {_INVERSE} takes no steps; leave it out")
    if known and actuator.filter_s != Actuator.filter_s:
        raise InputError(f"{where}: model.filter_s: it is of inverse dynamics, for an unknown controller; leave it out")
    if actuator.has_reference_model:
        _check_reference_only(actuator, where)


def _check_reference_only(actuator: Actuator, where: str) -> None:
    for path in _REFERENCE_ONLY:
        if path in actuator.tolerances:
            shown = actuator.axes.path(path)
            raise InputError(f"{where}: {shown}: the fitted model leaves it out, so that it cannot have a tolerance")
    path = "transmission.viscous_friction_Nms_rad"
    if actuator.value(path) > max(actuator.motor.viscous_friction_Nms_rad, 0.0):
        motor = actuator.axes.path("motor.viscous_friction_Nms_rad")
        raise InputError(
            f"{where}: {actuator.axes.path(path)}: the fitted model leaves it out, as small beside the motor's own; "
            f"add it to {motor}"
        )


def _check_effect_acts(actuator: Actuator, name: str, where: str) -> None:
    from ema_model.effects import find  # the catalogue need not be loaded for an actuator without effects

    effect = find(name)
    places = {function.__name__ for function in effect.places}
    if actuator.controller.kind == "unknown" and (effect.states or not places & set(INVERSE_PLACES)):
        raise InputError(f"{where}: effects.{name}: {_INVERSE} does not simulate what it acts on; leave it out")
    if actuator.inverter.kind == "current" and places <= set(WINDING_PLACES):
        raise InputError(f"{where}: effects.{name}: {_NO_WINDING} for it to act on; leave it out")
