"""Whether all that an actuator's file says is read by a model of its kind."""

from __future__ import annotations

from dataclasses import fields

from ema_model.actuator.actuator import Actuator
from ema_model.actuator.naming import on_axes
from ema_model.actuator.parameters import SECTIONS
from ema_model.actuator.unread import INVERSE, check_value_is_read, idle, settings_read, unread
from ema_model.errors import InputError

# In the Reference Model alone (MODEL: T 3.3): known well enough by their values, but no fit could learn of them.
_REFERENCE_ONLY = ("inverter.hysteresis_band_A", "transmission.viscous_friction_Nms_rad")

_OF_INVERSE = "it is of inverse dynamics, for an unknown controller"
_OF_SETTINGS = {
    "step_s": f"{INVERSE} takes no steps",
    "filter_s": _OF_INVERSE,
    "leaves_out_reversals": _OF_INVERSE,
}


def check_all_is_read(actuator: Actuator, where: str) -> None:
    """Raises InputError with the reason for whatever an actuator's file says that no model of its kind would read.

    That is of values, tolerances, recordings' values, effects and settings.
    """
    for section in SECTIONS:
        for one in fields(SECTIONS[section]):
            if one.name != "kind":
                path = f"{section}.{one.name}"
                _check_value(actuator, path, getattr(getattr(actuator, section), one.name), where)
    for rule in actuator.rules:
        for path, value in rule.values.items():
            _check_value(actuator, path, value, f"{where}: recordings.where {rule.match}")
    for path in set(actuator.tolerances) & set(unread(actuator.controller.kind, actuator.inverter.kind)):
        raise InputError(
            f"{where}: {on_axes(path, actuator.axes).path}: no model reads it, so that it cannot have a tolerance"
        )
    for name in actuator.effects:
        _check_effect_acts(actuator, name, where)
    read = settings_read(actuator.controller.kind)
    for name, reason in _OF_SETTINGS.items():
        if name not in read and getattr(actuator, name) != getattr(Actuator, name):
            raise InputError(f"{where}: model.{name}: {reason}; leave it out")
    if actuator.has_reference_model:
        _check_reference_only(actuator, where)


def _check_reference_only(actuator: Actuator, where: str) -> None:
    for path in _REFERENCE_ONLY:
        if path in actuator.tolerances:
            shown = on_axes(path, actuator.axes).path
            raise InputError(f"{where}: {shown}: the fitted model leaves it out, so that it cannot have a tolerance")
    path = "transmission.viscous_friction_Nms_rad"
    if actuator.value(path) > max(actuator.motor.viscous_friction_Nms_rad, 0.0):
        shown, motor = (on_axes(one, actuator.axes).path for one in (path, "motor.viscous_friction_Nms_rad"))
        raise InputError(
            f"{where}: {shown}: the fitted model leaves it out, as small beside the motor's own; add it to {motor}"
        )


def cannot_represent(actuator: Actuator, name: str) -> str:
    """Why a model of this actuator has no place for an effect, whatever is recorded; "" where it has one."""
    from ema_model.effects import find  # the catalogue need not be loaded for an actuator without effects

    effect = find(name)
    if not effect.has_part(actuator.axes):
        return "on a linear axis nothing turns that it could be of"
    places = {function.__name__ for function in effect.places}
    return idle(places, bool(effect.states), actuator.controller.kind, actuator.inverter.kind)


def check_represents(actuator: Actuator, name: str) -> None:
    """Raises InputError with the reason where an effect would do nothing, and with what could hold it."""
    if not (reason := cannot_represent(actuator, name)):
        return
    raise InputError(f"effect {name}: this model cannot represent it: {reason}; {_what_could(actuator, name)}")


def _what_could(actuator: Actuator, name: str) -> str:
    """What holds an effect that this model does not: another loop, or nothing."""
    if actuator.controller.kind == "unknown" and not cannot_represent(actuator.in_open_loop(), name):
        return "an open loop can (--open-loop), or a closed one: write the controller into the actuator's file"
    if actuator.controller.kind in ("unknown", "open"):
        return "a closed loop can: write the controller into the actuator's file"
    return "leave it out"


def _check_effect_acts(actuator: Actuator, name: str, where: str) -> None:
    if reason := cannot_represent(actuator, name):
        raise InputError(f"{where}: effects.{name}: {reason}; leave it out")


def _check_value(actuator: Actuator, path: str, value: float, where: str) -> None:
    check_value_is_read(actuator.controller.kind, actuator.inverter.kind, actuator.axes, path, value, where)
