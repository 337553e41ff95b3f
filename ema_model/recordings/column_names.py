"""What a column's name says: its quantity, whose it is, its unit, and how that converts to SI."""

from __future__ import annotations

import itertools
import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import pi

import numpy as np
from numpy.typing import ArrayLike, NDArray

# --- units that recordings come in, their spellings, and their exact factors to SI ------------------------------------

_G = 9.80665  # m/s², standard gravity
_POUND = 0.45359237  # kg
_INCH = 0.0254  # m


@dataclass(frozen=True)
class UnitOfMeasure:
    """SI = (value + offset)·numerator/denominator; `dimension` is the SI unit, as in `Signal.unit`.

    Two numbers, since dividing by 1000 rounds once and multiplying by 0.001 twice.
    """

    name: str
    dimension: str
    numerator: float = 1.0
    denominator: float = 1.0
    offset: float = 0.0

    def to_si(self, values: ArrayLike) -> NDArray[np.float64]:
        """Values in this unit, converted; the same shape."""
        si = np.array(values, np.float64)
        for number, operation in ((self.offset, np.add), (self.numerator, np.multiply)):
            if number != (0.0 if operation is np.add else 1.0):
                operation(si, number, out=si)
        return si if self.denominator == 1.0 else np.divide(si, self.denominator, out=si)

    @property
    def is_si(self) -> bool:
        """Whether nothing has to be converted."""
        return (self.numerator, self.denominator, self.offset) == (1.0, 1.0, 0.0)


# dimension: (name and other spellings in small letters, numerator, denominator, offset)
_TABLE: dict[str, tuple[tuple[str, float, float, float], ...]] = {
    "s": (
        ("s sec secs second seconds", 1, 1, 0),
        ("ms msec millis millisecond milliseconds", 1, 1000, 0),
        ("us usec micros microsecond microseconds", 1, 1_000_000, 0),
        ("ns nsec nanos nanosecond nanoseconds", 1, 1_000_000_000, 0),
        ("min minute minutes", 60, 1, 0),
        ("h hour hours", 3600, 1, 0),
    ),
    "rad": (
        ("rad rads radian radians", 1, 1, 0),
        ("mrad", 1, 1000, 0),
        ("urad", 1, 1_000_000, 0),
        ("deg degs degree degrees °", pi, 180, 0),
        ("turn turns rev revs revolution revolutions rotation rotations", 2 * pi, 1, 0),
        ("arcmin", pi, 10_800, 0),
        ("arcsec", pi, 648_000, 0),
    ),
    "m": (
        ("m meter meters metre metres", 1, 1, 0),
        ("cm", 1, 100, 0),
        ("mm millimeter millimeters", 1, 1000, 0),
        ("um micron microns", 1, 1_000_000, 0),
        ("in inch inches", _INCH, 1, 0),
    ),
    "rad/s": (
        ("rad/s", 1, 1, 0),
        ("mrad/s", 1, 1000, 0),
        ("deg/s degree/s degrees/s °/s dps", pi, 180, 0),
        ("rpm rev/min revs/min r/min turn/min turns/min 1/min u/min min-1", pi, 30, 0),
        ("krpm", 1000 * pi, 30, 0),
        ("rev/s revs/s turn/s turns/s r/s rps", 2 * pi, 1, 0),
    ),
    "m/s": (
        ("m/s mps", 1, 1, 0),
        ("cm/s", 1, 100, 0),
        ("mm/s", 1, 1000, 0),
        ("um/s", 1, 1_000_000, 0),
        ("m/min", 1, 60, 0),
        ("mm/min", 1, 60_000, 0),
    ),
    "A": (
        ("A amp amps ampere amperes", 1, 1, 0),
        ("mA milliamp milliamps", 1, 1000, 0),
        ("uA", 1, 1_000_000, 0),
        ("kA", 1000, 1, 0),
    ),
    "N·m": (
        ("Nm newtonmeter", 1, 1, 0),
        ("mNm", 1, 1000, 0),
        ("uNm", 1, 1_000_000, 0),
        ("kNm", 1000, 1, 0),
        ("Ncm", 1, 100, 0),
        ("Nmm", 1, 1000, 0),
        ("kgcm kgfcm", _G, 100, 0),
        ("kgm kgfm", _G, 1, 0),
        ("gcm gfcm", _G, 100_000, 0),
        ("ozin ozfin inoz", _POUND * _G * _INCH, 16, 0),
        ("lbin lbfin inlb", _POUND * _G * _INCH, 1, 0),
        ("lbft lbfft ftlb", _POUND * _G * _INCH * 12, 1, 0),
    ),
    "N": (
        ("N newton newtons", 1, 1, 0),
        ("mN", 1, 1000, 0),
        ("kN", 1000, 1, 0),
        ("kgf", _G, 1, 0),
        ("gf", _G, 1000, 0),
        ("lbf", _POUND * _G, 1, 0),
    ),
    "V": (("V volt volts", 1, 1, 0), ("mV millivolt millivolts", 1, 1000, 0), ("kV", 1000, 1, 0)),
    "°C": (
        ("degC °C C celsius degree_c", 1, 1, 0),
        ("K kelvin", 1, 1, -273.15),
        ("degF °F F fahrenheit", 5, 9, -32),
    ),
    "": (("1 - ratio pu", 1, 1, 0), ("% percent pct", 1, 100, 0)),
}
_COUNTS = re.compile(
    r"(counts?|cnts?|ticks?|cts?|inc|increments?|lsb|steps?|pulses?)(/s)?(?:[/@:]([0-9]+(?:\.[0-9]+)?))?(/s)?"
)


_SHARE = re.compile(r"(?:of|1?/)([1-9][0-9]{1,6})")


def plain(text: str) -> str:
    """A unit's text as the table spells it: "N·m" is nm, "rad_per_s" and "rad s⁻¹" are rad/s."""
    text = unicodedata.normalize("NFKC", text.replace("º", "°")).strip().lower()
    text = text.replace("μ", "u").replace("−", "-").replace("^", "").replace("_per_", "/").replace(" per ", "/")
    text = re.sub(r"[\s·⋅*._]+(s-1|sec-1)$|(?<=[a-z°])(s-1)$", "/s", text)
    text = re.sub(r"(?<=.)[_/]\s*(s|sec|secs|second|seconds)$", "/s", text)
    text = re.sub(r"(?<=.)[_/]\s*(min|minute)$", "/min", text)
    text = re.sub(r"^cps\b", "counts/s", text)
    return re.sub(r"[\s·⋅*_]+|\.(?![0-9])|(?<![0-9])\.|(?<=[a-z])-(?=[a-z])", "", text)


def _tabled() -> dict[str, dict[str, UnitOfMeasure]]:
    units: dict[str, dict[str, UnitOfMeasure]] = {}
    for dimension, rows in _TABLE.items():
        units[dimension] = {}
        for spellings, numerator, denominator, offset in rows:
            unit = UnitOfMeasure(spellings.split()[0], dimension, float(numerator), float(denominator), float(offset))
            units[dimension] |= {plain(spelling): unit for spelling in spellings.split()}
    return units


UNITS: dict[str, dict[str, UnitOfMeasure]] = _tabled()


def find_unit(text: str, dimension: str) -> UnitOfMeasure | None:
    """The unit of this dimension that the text names, or None.

    `counts/4096` is an encoder's counts of 4096 per turn, `counts/4096/s` its rate; without the number the
    unit is known but cannot be converted: its numerator is NaN.  `/255` is a share in counts of 255.
    """
    return _spelt(plain(text), dimension)


def dimensions_of(text: str) -> list[str]:
    """The dimensions in which the text names a unit."""
    spelling = plain(text)
    return [dimension for dimension in UNITS if _spelt(spelling, dimension)]


def _spelt(spelling: str, dimension: str) -> UnitOfMeasure | None:
    if spelling in UNITS.get(dimension, {}):
        return UNITS[dimension][spelling]
    if not dimension and (share := _SHARE.fullmatch(spelling)):
        return UnitOfMeasure(f"/{share[1]}", dimension, 1.0, float(share[1]))
    counts = _COUNTS.fullmatch(spelling)
    if counts and dimension == ("rad/s" if counts[2] or counts[4] else "rad"):
        per_turn = float(counts[3] or 0)
        rate = "/s" if dimension == "rad/s" else ""
        if not per_turn:
            return UnitOfMeasure(f"counts{rate}", dimension, float("nan"))
        return UnitOfMeasure(f"counts/{per_turn:.12g}{rate}", dimension, 2.0 * pi, per_turn)
    return None


def known_units(dimension: str) -> list[str]:
    """The names of the units of a dimension."""
    names = list(dict.fromkeys(unit.name for unit in UNITS.get(dimension, {}).values()))
    return [*names, *({"rad": ["counts/4096"], "rad/s": ["counts/4096/s"], "": ["/255"]}.get(dimension, []))]


# --- what a column's name says: its quantity, whose it is, its unit ---------------------------------------------------

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
