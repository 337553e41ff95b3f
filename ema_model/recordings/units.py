"""Units that recordings come in, and how each converts to SI."""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
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
