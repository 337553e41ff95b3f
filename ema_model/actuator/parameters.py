"""An actuator's parameters and other keys: names on its axes, which it has, and which no model of its kind reads."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any

from ema_model.errors import InputError, quoted
from ema_model.faults import FAULTS
from ema_model.quantities import MOTOR, USER, Axes, Side, as_number, in_sentence, parameter_title, unit_of

# --- the keys of an actuator file besides its parameters, with what they mean: the reader knows no others -------------
# The parameters themselves, with their facts, stand below; effects in their own files.

HEAD = {
    "schema": "1, the version of this format",
    "name": "what the actuator is called; without it, the file's name",
    "description": "a sentence about it",
}
TABLES: dict[str, dict[str, str]] = {
    "axes": {
        "motor": "rotary or linear: whether the motor turns or is a linear motor",
        "user": "rotary or linear: whether what it moves turns or slides",
    },
    "model": {
        "step_s": "step of the simulation; without it 1e-5 s, with an ideal current 5e-5 s",
        "filter_s": "half width over which a measured motion is differentiated (unknown controller only)",
        "leaves_out_reversals": "true where only what slides steadily is compared (unknown controller only)",
        "torque_known": "false where the torque constant is a guess: findings are then told in amperes",
    },
    "faults": {fault.name: f"{fault.title.lower()} that this unit has, 0 … 1" for fault in FAULTS},
    "recordings": {
        "mapping": 'list of "signal=column[unit]", for recordings with other names, as for --map',
        "where": "tables of what differs by the recordings' names",
    },
    "recordings.where": {
        "match": 'pattern of file names without their ending, such as "*kp100*"',
        "set": 'table of "section.parameter" = value that hold for these recordings',
        "kind": "run, or map for a static map, without time: current or torque against angle, speed or load",
    },
}
KINDS = {
    "controller": {
        "cascade": "position and speed loop",
        "position": "a position loop alone, as servos have it",
        "open": "left out: the recorded current or torque, or with a voltage drive the voltage or duty, is put in",
        "unknown": "not described: the recorded motion is put in and the current that it needs comes out",
    },
    "inverter": {
        "hysteresis": "current relays that chop the bus voltage, with three phases (cascade only)",
        "current": "the current that is asked for, at once",
        "voltage": "PWM voltage at the winding (not of a cascade)",
    },
}
ENTRY = {
    "value": "in SI, the unit that the name ends in",
    "tolerance": "1 σ of what is not known of it, relative to the value",
    "sigma": "the same as an absolute number, where the value is 0",
    "free": "whether a calibration may move it, within 3 σ; true unless it says false",
}


# --- an actuator's parameters and their tolerances --------------------------------------------------------------------

Sits = dict[str, Side]
_FAR = 1e9  # rad, where an end stop is out of reach


@dataclass(frozen=True)
class Facts:
    """What a parameter means and how large it is, of a rotary axis; `on` has a linear one's.

    The plausible range is of actuators from a watch's to a ship's: what lies outside was likely meant in other units.
    """

    meaning: str
    low: float
    high: float
    guess: float  # where nobody knows it
    tolerance: float = 0.0  # 1 σ of what data sheets leave open, relative to the value; 0 where it counts as known
    sigma: float = 0.0  # the same as an absolute number, where the value is 0
    linear: tuple[float, float, float] | None = None  # low, high and guess where its side is linear
    follows: str = ""  # the parameter whose value it most likely has

    def on(self, axes: Axes, side: Side | None, per: Side | None = None) -> Facts:
        """The facts as these axes have them."""
        is_linear = axes.is_linear(side) != (per is not None and axes.is_linear(per))
        if self.linear is None or not is_linear:
            return self
        low, high, guess = self.linear
        return replace(self, low=low, high=high, guess=guess)


# Where a parameter sits: the side whose axis it is of, and for what is rad/rad, the side that it is counted by.
_MOTOR: Sits = {"side": MOTOR}
_USER: Sits = {"side": USER}
_MOTOR_PER_USER: Sits = {"side": MOTOR, "per": USER}
_USER_PER_MOTOR: Sits = {"side": USER, "per": MOTOR}
_ANYWHERE: Sits = {}
_KT = "motor.torque_constant_Nm_A"


def _of(facts: Facts, sits: Sits, default: Any = MISSING) -> Any:
    """A field with its facts."""
    return field(default=default, metadata={**sits, "facts": facts})


@dataclass(frozen=True)
class Controller:
    """Control electronics.

    cascade: position and PID speed loop (T 3.2.3; `ema_model.physics.equations`).  With a hysteresis inverter it is
    the thesis's, whose integral is held at standstill.  position: a position loop alone, whose output is a share of
    what the drive can give.  unknown: recordings are held against inverse dynamics.
    """

    kind: str = "cascade"
    position_gain_1_s: float = _of(
        Facts("motor speed asked for per position error at the user", 1e-2, 1e8, 100.0, 0.01, linear=(1e-2, 1e10, 1e2)),
        _MOTOR_PER_USER,
        0.0,
    )
    speed_limit_rad_s: float = _of(
        Facts("the most motor speed that the position loop asks for", 0.05, 2e4, 300.0, linear=(1e-4, 50.0, 1.0)),
        _MOTOR,
        0.0,
    )
    speed_gain_Nms_rad: float = _of(
        Facts("proportional gain of the speed loop", 1e-8, 1e4, 0.02, 0.01, linear=(1e-3, 1e8, 1e3)), _MOTOR, 0.0
    )
    integral_gain_Nm_rad: float = _of(
        Facts("integral gain of the speed loop", 0.0, 1e6, 0.0, linear=(0.0, 1e10, 0.0)), _MOTOR, 0.0
    )
    derivative_gain_Nms2_rad: float = _of(
        Facts("derivative gain of the speed loop", 0.0, 10.0, 0.0, linear=(0.0, 1e5, 0.0)), _MOTOR, 0.0
    )
    integrator_window_rad: float = _of(
        Facts("position error at the user beyond which the integrator is frozen", 1e-9, 100.0, 1.0), _USER, 1.0
    )
    torque_constant_Nm_A: float = _of(
        Facts(
            "what the controller takes the motor's torque constant to be",
            1e-5,
            100.0,
            0.05,
            linear=(0.01, 1e4, 50),
            follows=_KT,
        ),
        _MOTOR,
        1.0,
    )
    current_limit_A: float = _of(
        Facts("the most equivalent current that the controller asks for", 1e-3, 5e3, 10.0), _ANYWHERE, math.inf
    )
    gain_1_rad: float = _of(
        Facts(
            "share of the drive's full output per position error at the user", 1e-4, 1e7, 10.0, linear=(1e-2, 1e8, 1e3)
        ),
        _USER,
        0.0,
    )
    output_limit: float = _of(Facts("the most of the drive's full output that is used", 0.01, 1.0, 1.0), _ANYWHERE, 1.0)


@dataclass(frozen=True)
class Inverter:
    """Power electronics: a hysteresis current loop (T 3.2.5), an ideal current source, or PWM voltage."""

    kind: str = "hysteresis"
    bus_voltage_V: float = _of(
        Facts("supply; a recording's own counts where it has one", 1.0, 2e3, 24.0, 0.02), _ANYWHERE, 0.0
    )
    hysteresis_band_A: float = _of(Facts("whole width of the current relays' band", 1e-3, 100.0, 0.4), _ANYWHERE, 0.0)
    current_limit_A: float = _of(
        Facts("the most current that the drive gives", 1e-3, 5e3, 10.0, follows="controller.current_limit_A"),
        _ANYWHERE,
        math.inf,
    )


@dataclass(frozen=True)
class Motor:
    """Electric motor and rotor (T 3.2.5, Table 3.3)."""

    torque_constant_Nm_A: float = _of(
        Facts("torque per ampere of the equivalent current", 1e-5, 100.0, 0.05, 0.01, linear=(0.01, 1e4, 50.0)), _MOTOR
    )
    inertia_kgm2: float = _of(
        Facts("of all that moves, as the motor feels it", 1e-10, 100.0, 1e-4, 0.05, linear=(1e-4, 1e5, 5.0)), _MOTOR
    )
    viscous_friction_Nms_rad: float = _of(
        Facts("friction that grows with speed, as the motor feels it", 0.0, 10.0, 1e-5, 0.15, linear=(0.0, 1e5, 10.0)),
        _MOTOR,
    )
    static_friction_Nm: float = _of(
        Facts(
            *("holds the standing motor; no less than in motion", 0.0, 1e3, 0.01, 0.05),
            linear=(0.0, 1e5, 5.0),
            follows="motor.dynamic_friction_Nm",
        ),
        _MOTOR,
    )
    dynamic_friction_Nm: float = _of(
        Facts("dry friction in motion, as the motor feels it", 0.0, 1e3, 0.01, 0.05, linear=(0.0, 1e5, 5.0)), _MOTOR
    )
    resistance_Ohm: float = _of(
        Facts("of the winding, phase to phase; with a voltage drive, terminal to terminal", 1e-3, 1e3, 2.0, 0.05),
        _ANYWHERE,
        1.0,
    )
    inductance_H: float = _of(Facts("of the winding, phase to phase", 1e-7, 1.0, 1e-3, 0.1), _ANYWHERE, 1e-6)
    emf_scale: float = _of(
        Facts("of the three phases' back-EMF; 2 closes the energy balance", 0.5, 4.0, 2.0), _ANYWHERE, 1.0
    )
    pole_pairs: float = _of(Facts("of the rotor", 1.0, 100.0, 4.0), _ANYWHERE, 1.0)
    torque_limit_Nm: float = _of(
        Facts("at which the motor saturates; 1e9 is never", 1e-6, 1e5, 1e9, linear=(1e-3, 1e7, 1e9)), _MOTOR, 1e9
    )
    rotor_offset_rad: float = _of(
        Facts("from the motor angle's zero to phase A", -6.3, 6.3, 0.0, sigma=0.02, linear=(-10.0, 10.0, 0.0)),
        _MOTOR,
        0.0,
    )


@dataclass(frozen=True)
class Transmission:
    """Gear, screw and user (T 3.2.6)."""

    gear_ratio: float = _of(
        Facts(
            "how far the user moves per motor angle: 1/500, or a screw's lead/2π",
            1e-5,
            2.0,
            1.0,
            linear=(1e-6, 0.1, 1.6e-3),
        ),
        _USER_PER_MOTOR,
        1.0,
    )
    backlash_rad: float = _of(
        Facts("whole width of the play, at the user", 0.0, 0.2, 0.0, 0.15, linear=(0.0, 5e-3, 0.0)), _USER, 0.0
    )
    viscous_friction_Nms_rad: float = _of(
        Facts("of the user, as the motor feels it", 0.0, 10.0, 0.0, linear=(0.0, 1e5, 0.0)), _MOTOR, 0.0
    )
    stop_low_rad: float = _of(
        Facts("lower end stop, at the user", -1e3, 1e3, -_FAR, linear=(-100.0, 100.0, -_FAR)), _USER, -_FAR
    )
    stop_high_rad: float = _of(
        Facts("upper end stop, at the user", -1e3, 1e3, _FAR, linear=(-100.0, 100.0, _FAR)), _USER, _FAR
    )


@dataclass(frozen=True)
class Sensors:
    """What the recording adds to the true signals."""

    current_gain: float = _of(Facts("recorded current per true one", 0.5, 2.0, 1.0, 0.005), _ANYWHERE, 1.0)
    current_bias_A: float = _of(Facts("added to the recorded current", -20.0, 20.0, 0.0, sigma=0.02), _ANYWHERE, 0.0)
    delay_s: float = _of(Facts("by which recorded signals come late", -0.05, 0.05, 0.0, sigma=20e-6), _ANYWHERE, 0.0)
    apparent_inertia: float = _of(
        Facts(
            "share of the inertia that a current loop adds to its command, k_t²/(R ω_c J); 0 of a measured current",
            *(-0.2, 0.5, 0.0),
        ),
        _ANYWHERE,
        0.0,
    )


@dataclass(frozen=True)
class Tolerance:
    """What is not known of a parameter: 1 σ in its own unit, and whether a calibration may move it."""

    sigma: float
    free: bool


@dataclass(frozen=True)
class Rule:
    """What differs for recordings whose file name matches a pattern."""

    match: str  # of the file's name, with * and ?
    values: dict[str, float] = field(default_factory=dict)  # by "section.parameter"
    kind: str = "run"  # or "map", a static map


SECTIONS: dict[str, type[Any]] = {
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
    "output_limit",
}  # fmt: skip
_BEHIND = "sensors.delay_s"
_ANY_SIGN = {"rotor_offset_rad", "current_bias_A", "stop_low_rad", "stop_high_rad", "apparent_inertia"}


def numbers(section: str) -> tuple[str, ...]:
    """Names of a section's numeric parameters."""
    return tuple(f.name for f in fields(SECTIONS[section]) if f.name != "kind")


def facts_of(path: str, axes: Axes) -> Facts:
    """What is known beforehand of "section.parameter" on these axes."""
    section, _, name = path.partition(".")
    about = next(one.metadata for one in fields(SECTIONS[section]) if one.name == name)
    return about["facts"].on(axes, about.get("side"), about.get("per"))


def default_of(path: str) -> float | None:
    """What "section.parameter" is where a file leaves it out; None where none may."""
    section, _, name = path.partition(".")
    return getattr(SECTIONS[section], name, None)  # a dataclass keeps its defaults on the class


def low_limit(path: str, one_clock: bool = True) -> float:
    """The least value that a parameter may take; 0 where it must only be above.

    one_clock: what is put in and what the sensors show stand at the moments that the log says, so that these can only
    be late.  Else the sensors' delay is that of one signal behind another, of any sign.
    """
    name = path.split(".")[-1]
    any_sign = name in _ANY_SIGN or (path == _BEHIND and not one_clock)
    return -math.inf if path.startswith("effects.") or any_sign else 0.0


def is_said(path: str, value: float) -> bool:
    """Whether a value of "section.parameter" says anything: its default may stand for none at all."""
    return math.isfinite(value) and not (value == 0.0 and path.split(".")[-1] in _POSITIVE)


def check_value(section: str, name: str, value: Any, where: str, shown: str = "") -> None:
    """Raises InputError for what is no number, or not one that this parameter can have; shown: its name in files."""
    shown = shown or name
    if not math.isfinite(as_number(value)):
        raise InputError(f"{where}: [{section}] {shown} must be a number, not {quoted(value, 40)!r}")
    if name in _POSITIVE and value <= 0.0:
        raise InputError(f"{where}: [{section}] {shown} must be above 0, not {quoted(value)}")
    if name not in _ANY_SIGN and f"{section}.{name}" != _BEHIND and value < 0.0:
        raise InputError(f"{where}: [{section}] {shown} must not be negative, not {quoted(value)}")


def check_stops(transmission: Transmission, axes: Axes, where: str) -> None:
    """Raises InputError for end stops in the wrong order."""
    if not transmission.stop_low_rad < transmission.stop_high_rad:
        low, high = (axes.name(name, USER) for name in ("stop_low_rad", "stop_high_rad"))
        raise InputError(f"{where}: [transmission] {low} must be below {high}")


# --- what parameters are called and measured in on an actuator's axes: the owner of each says where it sits -----------

# Where the windows of recordings start ("play 0"), and what load a recording bears.
_OF_WINDOWS: dict[str, tuple[str, Side | None]] = {
    "turned": ("rad", MOTOR),
    "play": ("rad", MOTOR),
    "faster": ("rad/s", MOTOR),
    "load": ("N·m", USER),
    "lag": ("s", None),
}


@dataclass(frozen=True)
class Named:
    """A parameter as files and people have it."""

    path: str  # "motor.mass_kg"
    title: str  # "Motor mass"
    unit: str  # "kg"

    @property
    def name(self) -> str:
        """The last part of its path, as it stands in its section."""
        return self.path.rpartition(".")[2]


def on_axes(path: str, axes: Axes) -> Named:
    """How "section.parameter", "effects.name.parameter" or the start of a window is shown on these axes.

    What is none of these, as k1, stays as it is.
    """
    section, _, name = path.partition(".")
    if section == "effects":
        return _of_effect(path, axes)
    known = {one.name: one for one in fields(SECTIONS[section])} if section in SECTIONS else {}
    if name in known:
        side, per = (known[name].metadata.get(key) for key in ("side", "per"))
        shown = f"{section}.{axes.name(name, side)}"
        return Named(shown, parameter_title(shown), axes.unit(unit_of(name), side, per))
    kind, window, _ = path.partition(" ")
    unit, side = _OF_WINDOWS.get(kind, ("", None)) if window else ("", None)
    return Named(path, parameter_title(path), axes.unit(unit, side))


def path_inside(path: str, among: Iterable[str], axes: Axes) -> str:
    """The path inside of one that files and people have, among these; what is none of them stays."""
    return next((one for one in among if on_axes(one, axes).path == path), path)


def _of_effect(path: str, axes: Axes) -> Named:
    from ema_model.effects import find  # the catalogue need not be loaded for an actuator without effects

    section, effect, name = path.split(".")
    try:
        found = find(effect, axes)
        parameter = next(one for one in found.parameters if one.name == name)
    except (InputError, StopIteration):  # of a user, and not known here
        return Named(path, f"{effect}: {in_sentence(parameter_title(name))}", unit_of(name))
    title = f"{found.title}: {in_sentence(parameter.title)}"
    return Named(f"{section}.{effect}.{parameter.shown}", title, parameter.unit)


# --- what an actuator's file may not say, because no model of its kind would read it: refused with the reason ---------
# A number that nothing reads would look as if it had been taken into account.  At its neutral value, which is its
# default, it says nothing and may stand.

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
_OF_SENSORS = {"unknown": {}, "open": {"current_gain current_bias_A": _CURRENT_IN, **_LOOP}}
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
    sensors = _LOOP if inverter == "voltage" and controller == "open" else _OF_SENSORS.get(controller, _LOOP)
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


# --- which parameters an actuator file has, by the kind of its controller and drive -----------------------------------

CONTROLLER_KINDS, INVERTER_KINDS = tuple(KINDS["controller"]), tuple(KINDS["inverter"])
CHOICES = {"controller": CONTROLLER_KINDS, "inverter": INVERTER_KINDS}
USUAL = {"controller": "cascade", "inverter": "hysteresis"}

WITHOUT_LOOP = ("open", "unknown")  # controllers that close none: no command can be simulated

_CASCADE = (
    *("position_gain_1_s", "speed_limit_rad_s", "speed_gain_Nms_rad", "integral_gain_Nm_rad"),
    *("derivative_gain_Nms2_rad", "integrator_window_rad", "torque_constant_Nm_A", "current_limit_A"),
)
_MOTION = (
    *("torque_constant_Nm_A", "inertia_kgm2", "viscous_friction_Nms_rad", "static_friction_Nm", "dynamic_friction_Nm"),
)
_DRIVES_WITH = {
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
        needed = _DRIVES_WITH[inverter]
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
