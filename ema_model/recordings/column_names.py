"""What a column's name says: its quantity, whose it is, its unit; German words put into the English ones."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from ema_model.recordings.units import UNITS, find_unit

# What is measured.
QUANTITIES: dict[str, frozenset[str]] = {
    name: frozenset(words.split())
    for name, words in {
        "time": "t time times timestamp timestamps timestep clock elapsed stamp date datetime",
        "position": "pos position positions angle theta q phi encoder enc rotation displacement stroke x joint "
        "resolver",
        "speed": "speed velocity vel omega w rpm dq qd qdot dtheta thetadot dx xdot angularvelocity",
        "current": "current curr cur iq ieq amps amperage i im imot",
        "torque": "torque trq tau moment",
        "force": "force thrust",
        "voltage": "voltage volt volts v u vbus vdc vin vm vmot vq ubus udc vsupply vbat",
        "duty": "duty dutycycle pwm",
        "temperature": "temp temperature temps",
        "enabled": "enable enabled",
        "segment": "segment seg run trial episode repetition rep lap",
    }.items()
}
# Whose it is.
COMMAND = frozenset(
    "cmd command commanded setpoint sp set target goal ref reference desired des demand wanted action".split()
)
MEASURED = frozenset(
    "act actual meas measured fb feedback present raw value val estimate estimated est filtered".split()
)
MOTOR = frozenset("motor mot rotor drive m mech".split())
USER = frozenset("user u output out load joint link arm surface flap rudder aileron elevator actuator rod ram".split())
LOAD = frozenset("load ext external disturbance hinge aero".split())
BUS = frozenset("bus vbus vdc vin ubus udc vsupply vbat dc dclink supply battery bat input".split())
# What spoils a match: another axis of the same quantity.
OTHER = {
    "current": frozenset("id bus dc battery bat supply input limit max min".split()),
    "speed": frozenset("limit max min".split()),
    "voltage": frozenset("vd limit max min".split()),
    "torque": frozenset("limit max min enable enabled friction".split()),
    "position": frozenset("limit max min error err".split()),
    "temperature": frozenset("limit max".split()),
}
_MERGED = (
    (("time", "stamp"), "timestamp"),
    (("set", "point"), "setpoint"),
    (("duty", "cycle"), "dutycycle"),
    (("angular", "velocity"), "angularvelocity"),
    (("angular", "speed"), "angularvelocity"),
    (("angular", "position"), "angle"),
    (("i", "q"), "iq"),
    (("i", "d"), "id"),
    (("v", "bus"), "vbus"),
    (("v", "dc"), "vdc"),
    (("v", "in"), "vin"),
    (("u", "dc"), "udc"),
    (("v", "q"), "vq"),
    (("v", "d"), "vd"),
    (("q", "dot"), "qdot"),
    (("theta", "dot"), "thetadot"),
    (("d", "theta"), "dtheta"),
    (("d", "q"), "dq"),
)
_GREEK = str.maketrans({"θ": " theta ", "ω": " omega ", "φ": " phi ", "ϕ": " phi ", "τ": " tau ", "Δ": " d "})
# Single letters are words as often as units; they count as a unit where the quantity fits.
_MOST_WORDS_OF_A_UNIT = 3


@dataclass(frozen=True)
class Name:
    """A column's name, taken apart: small words, the unit's text or "", and whether brackets set the unit off."""

    words: tuple[str, ...]
    unit: str
    bracketed: bool = False

    def has(self, words: frozenset[str]) -> bool:
        """Whether any of these is among its words."""
        return not words.isdisjoint(self.words)


def readings(column: str) -> list[Name]:
    """The ways to read a name: with its last words as a unit, where they are one, longest first, then without."""
    bracketed = re.fullmatch(r"(.*?)[\s_,;:]*[\[({]([^\[\](){}]*)[\])}]\s*", column, re.S)
    if bracketed and _is_unit(bracketed[2]):
        return [Name(_words(bracketed[1]), bracketed[2].strip(), True)]
    spoken = re.fullmatch(r"(.*\S)\s+in\s+(\S+)\s*", column, re.S)
    if spoken and _is_unit(spoken[2]):
        return [Name(_words(spoken[1]), spoken[2], True)]
    parts = [part for part in re.split(r"[\s_.,;:()\[\]{}|-]+", re.sub(r"(?<=[a-z])(?=[A-Z])", "_", column)) if part]
    found = []
    counted = len(parts) - 1 if len(parts) > 2 and parts[-1].isdecimal() else 0  # one of several: q_rad_7
    for length in range(min(_MOST_WORDS_OF_A_UNIT, counted - 1), 0, -1):
        unit = "_".join(parts[counted - length : counted])
        if _is_unit(unit):
            found.append(Name(_words("_".join(parts[: counted - length])), unit))
    for length in range(min(_MOST_WORDS_OF_A_UNIT, len(parts) - 1), 0, -1):
        unit = "_".join(parts[-length:])
        if _is_unit(unit) and not unit.isdecimal():  # which counts columns
            found.append(Name(_words("_".join(parts[:-length])), unit))
    return [*found, Name(_words(column), "")]


def is_time(name: str) -> bool:
    """Whether a column's name says that it is time."""
    return any(not QUANTITIES["time"].isdisjoint(one.words) for one in readings(name))


def _is_unit(text: str) -> bool:
    return len(text) <= 24 and any(find_unit(text, dimension) for dimension in UNITS)


def _words(text: str) -> tuple[str, ...]:
    text = text[:200].translate(_GREEK).replace("Ω", " ")
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", text)
    spelt = (word.rstrip("0123456789") or word for word in re.split(r"[^a-z0-9]+", without_umlauts(text)) if word)
    merged: list[str] = []
    for word in itertools.chain.from_iterable(map(in_english, spelt)):
        merged.append(word)
        for pair, whole in _MERGED:
            if tuple(merged[-2:]) == pair:
                merged[-2:] = [whole]
                break
    return tuple(merged)


# --- german names of columns, put into the English words that guessing knows: Motordrehzahl is motor, speed -----------

_ENGLISH = {
    # what is measured
    "zeitstempel": "timestamp",
    "uhrzeit": "time",
    "zeit": "time",
    "datum": "date",
    "drehwinkel": "angle",
    "winkel": "angle",
    "lage": "position",
    "weg": "displacement",
    "hub": "stroke",
    "drehzahl": "speed",
    "winkelgeschwindigkeit": "angularvelocity",
    "geschwindigkeit": "speed",
    "strom": "current",
    "drehmoment": "torque",
    "moment": "torque",
    "kraft": "force",
    "spannung": "voltage",
    "temperatur": "temperature",
    "tastgrad": "duty",
    "freigabe": "enable",
    "abschnitt": "segment",
    "versuch": "trial",
    "position": "position",
    # whose, and whether it is wanted or measured
    "soll": "setpoint",
    "fuehrungs": "setpoint",
    "ist": "actual",
    "mess": "measured",
    "motor": "motor",
    "rotor": "rotor",
    "abtriebs": "output",
    "ausgangs": "output",
    "klappen": "flap",
    "last": "load",
    "stoer": "disturbance",
    "zwischenkreis": "bus",
    "versorgungs": "supply",
    "batterie": "battery",
    "wert": "value",
}
_PARTS = re.compile("|".join(sorted(_ENGLISH, key=len, reverse=True)))
_NOUNS = frozenset(_ENGLISH) - {"position", "motor", "rotor"}  # which English has too
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss"})


def without_umlauts(text: str) -> str:
    """Small letters with ä, ö, ü and ß spelt out."""
    return text.lower().translate(_UMLAUTS)


def in_english(word: str) -> list[str]:
    """The English words of one that is made up of German ones only; any other word as it is."""
    parts = _PARTS.findall(word)
    if "".join(parts) != word or _NOUNS.isdisjoint(parts):
        return [word]
    return [_ENGLISH[part] for part in parts]


@dataclass(frozen=True)
class Guess:
    """A signal that a column may be."""

    signal: str
    unit: str
    confidence: float
    reason: str


# --- logs of tools whose columns are known by their makers' code: what is in which column, in which unit --------------
# A tool is known by the names of its columns; one that writes numbers alone is no more than likely, and is only named.


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
