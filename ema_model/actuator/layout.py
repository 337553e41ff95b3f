"""Which parameters an actuator file has, by the kind of its controller and drive."""

from __future__ import annotations

from ema_model.actuator import keys
from ema_model.actuator.parameters import SECTIONS, numbers
from ema_model.actuator.unread import unread

CONTROLLER_KINDS, INVERTER_KINDS = tuple(keys.KINDS["controller"]), tuple(keys.KINDS["inverter"])
KINDS = {"controller": CONTROLLER_KINDS, "inverter": INVERTER_KINDS}
USUAL = {"controller": "cascade", "inverter": "hysteresis"}

WITHOUT_LOOP = ("open", "unknown")  # controllers that close none: no command can be simulated

_CASCADE = (
    *("position_gain_1_s", "speed_limit_rad_s", "speed_gain_Nms_rad", "integral_gain_Nm_rad"),
    *("derivative_gain_Nms2_rad", "integrator_window_rad", "torque_constant_Nm_A", "current_limit_A"),
)
_MOTION = (
    *("torque_constant_Nm_A", "inertia_kgm2", "viscous_friction_Nms_rad", "static_friction_Nm", "dynamic_friction_Nm"),
)
_DRIVES = {
    "hysteresis": ("bus_voltage_V", "hysteresis_band_A"),
    "current": ("current_limit_A",),
    "voltage": ("bus_voltage_V",),
}
_OF_CONTROLLER = {  # the drives that each controller may act through, the usual one first
    "cascade": ("current", "hysteresis"),
    "position": ("voltage", "current"),
    "open": ("current", "voltage"),  # in which the recorded current is put in, or the voltage or duty
    "unknown": ("current",),
}


def drives_of(controller: str) -> tuple[str, ...]:
    """The drives that a controller may act through, the usual one first."""
    return _OF_CONTROLLER[controller]


def says_drive(controller: str, drive: str) -> bool:
    """Whether a file of these kinds says its drive: one whose current is the recorded one has none to speak of."""
    return controller not in WITHOUT_LOOP or (controller, drive) == ("open", "voltage")


def layout(section: str, kinds: dict[str, str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names that a section must have, and those that it may have besides.

    kinds: the actuator's "controller" and "inverter".  Only an actuator of the thesis's kind must say all.
    """
    controller, inverter = kinds["controller"], kinds["inverter"]
    full = controller == "cascade" and inverter == "hysteresis"
    every = numbers(section)
    if section == "controller":
        needed = {"cascade": _CASCADE, "position": ("gain_1_rad",), "open": (), "unknown": ()}[controller]
        return needed, ("output_limit",) if controller == "position" else ()
    if section == "inverter":
        needed = _DRIVES[inverter]
        return ((), needed) if controller in WITHOUT_LOOP else (needed, ())
    if full:
        needed = tuple(name for name in every if f"{section}.{name}" not in unread(controller, inverter))
        return needed, tuple(name for name in every if name not in needed)
    needed = _MOTION if section == "motor" else ()
    if section == "motor" and inverter == "voltage" and controller != "unknown":
        needed = ("resistance_Ohm", *needed)
    return needed, tuple(name for name in every if name not in needed)


def paths() -> tuple[str, ...]:
    """Every "section.parameter" of an actuator with a cascade and a hysteresis current loop."""
    return tuple(f"{section}.{name}" for section in SECTIONS for name in layout(section, USUAL)[0])
