"""Quantities: units, numbers, titles, the signals on their axes, and the variables that residuals are held against.

Each fact stands in one row.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from ema_model.errors import InputError, quoted

# --- SI units: as people see them, as names of columns and parameters end in them, and on a linear axis ---------------
# On a linear axis an angle is a length, a torque a force, an inertia a mass: each unit says its counterpart there.


@dataclass(frozen=True)
class SiUnit:
    """One unit; `linear` is what is shown in its place on a linear axis, `prefixes` are those it is written with."""

    shown: str
    ending: str  # of a name, without the underscore
    linear: str = ""  # the unit itself where nothing changes
    prefixes: str = ""


_SMALL, _ALL_SIZES = "mµ", "mµk"
_SI_TABLE = (
    SiUnit("N·m·s²/rad", "Nms2_rad", "N·s²/m"),
    SiUnit("N·m·s/rad", "Nms_rad", "N·s/m"),
    SiUnit("N·m/rad³", "Nm_rad3", "N/m³"),
    SiUnit("N·m/rad", "Nm_rad", "N/m"),
    SiUnit("N·m/A", "Nm_A", "N/A"),
    SiUnit("kg·m²", "kgm2", "kg"),
    SiUnit("rad/s²", "rad_s2", "m/s²"),
    SiUnit("rad/s", "rad_s", "m/s", _SMALL),
    SiUnit("1/rad", "1_rad", "1/m"),
    SiUnit("rad", "rad", "m", _SMALL),
    SiUnit("N·m", "Nm", "N", _ALL_SIZES),
    # of linear axes
    SiUnit("N·s²/m", "Ns2_m"),
    SiUnit("N·s/m", "Ns_m"),
    SiUnit("N/m³", "N_m3"),
    SiUnit("N/m", "N_m"),
    SiUnit("N/A", "N_A"),
    SiUnit("kg", "kg"),
    SiUnit("m/s²", "m_s2"),
    SiUnit("m/s", "m_s", prefixes=_SMALL),
    SiUnit("1/m", "1_m"),
    SiUnit("m", "m", prefixes=_SMALL),
    SiUnit("N", "N", prefixes=_ALL_SIZES),
    # of both
    SiUnit("1/s", "1_s"),
    SiUnit("1/A", "1_A"),
    SiUnit("Ω", "Ohm"),
    SiUnit("Hz", "Hz"),
    SiUnit("H", "H"),
    SiUnit("V", "V", prefixes=_ALL_SIZES),
    SiUnit("A", "A", prefixes=_ALL_SIZES),
    SiUnit("s", "s", prefixes=_SMALL),
    SiUnit("°C", "C"),
)
BY_SHOWN: dict[str, SiUnit] = {unit.shown: unit for unit in _SI_TABLE}
# The longest first: a name that ends in _Nm_rad ends in _rad as well.
_BY_ENDING = {unit.ending: unit for unit in sorted(_SI_TABLE, key=lambda unit: -len(unit.ending))}


def of_name(name: str) -> SiUnit | None:
    """The unit that a name ends in: kg·m² of inertia_kgm2; None of a number without one."""
    return next((unit for ending, unit in _BY_ENDING.items() if name.endswith(f"_{ending}")), None)


def without_unit(name: str) -> str:
    """'inertia' of 'inertia_kgm2'."""
    unit = of_name(name)
    return name if unit is None else name.removesuffix(f"_{unit.ending}")


def linear_unit(shown: str) -> str:
    """The unit on a linear axis: N of N·m, A of A."""
    unit = BY_SHOWN.get(shown)
    return shown if unit is None else unit.linear or shown


def linear_name(name: str) -> str:
    """The linear counterpart of a rotary name: inertia_kgm2 → mass_kg, load_torque_Nm → load_force_N."""
    unit = of_name(name)
    if unit is None or not unit.linear:
        return name
    words = without_unit(name).replace("inertia", "mass").replace("torque", "force")
    return f"{words}_{BY_SHOWN[unit.linear].ending}"


# --- intervals as they are told: each holds 90 % ----------------------------------------------------------------------

HALF_90 = 1.645  # σ of a normal distribution, on either side


# --- round numbers in a range, for axes -------------------------------------------------------------------------------


def round_numbers(low: float, high: float, about: float, steps: Sequence[float] = ()) -> list[float]:
    """About so many from low to high: 1, 2 or 5 times a power of ten apart, or the first of the steps that suffices."""
    rough = ((high - low) or 1.0) / about
    size = 10.0 ** math.floor(math.log10(rough))
    step = next(one for one in steps or (size, 2.0 * size, 5.0 * size, 10.0 * size) if one >= 0.999 * rough)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [step * i for i in range(first, last + 1)]


# --- numbers as files and people write them: read, shown with so many digits, in a unit that suits their size ---------

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_SMALLEST = 0.09995  # reads as 0.1, and is shown as it is; what is smaller gets the next prefix
_FINE = 1e-3  # an error that takes the next prefix
_EXPONENT = 1e-4  # what is smaller is told by a power of ten
_LONGEST = 1e6  # likewise, from which on
_FINE_AT = 0.1  # from which on its value keeps three digits
_LARGEST = 9995.0  # likewise, from which on a kilo is taken
_PREFIXES = {-6: "µ", -3: "m", 3: "k", 6: "M"}  # by the power of ten
_WITHOUT_PREFIX = ("kg", "1/", "°")  # how units begin that take a power of ten in place of one


def as_number(value: Any) -> float:
    """The number, or NaN for what is none (or too large to be one)."""
    try:
        return math.nan if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def check_number(value: Any, what: str) -> None:
    """InputError for what is no number at all; NaN and infinity are left to the check of the range.

    what: the name in the error, "the sample rate".
    """
    if math.isnan(as_number(value)) and not isinstance(value, float | np.floating):
        raise InputError(f"{what} must be a number, not {quoted(repr(value), 40)}")


def check_seed(value: Any) -> None:
    """InputError for what cannot begin random numbers."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise InputError(f"the seed must be a whole number from 0 on, not {quoted(repr(value), 40)}")


def number(value: float, digits: int = 3) -> str:
    """So many digits, without an exponent where that is readable: 0.0352, 1.30·10⁻⁵; – for what is no number."""
    if not math.isfinite(value):
        return "–"
    size = abs(value)
    if size != 0.0 and not _EXPONENT <= size < _LONGEST:
        mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
        return f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}".replace("-", "−")
    decimals = max(0, digits - 1 - (math.floor(math.log10(size)) if size else 0))
    return f"{value:.{min(decimals, 8)}f}".replace("-", "−")


def prefixed(largest: float, unit: str) -> tuple[float, str]:
    """The factor to the prefix in which numbers up to `largest` read well, and the unit with it: 1000, 'mA'.

    A number as large as 0.1 needs none: 0.2 A, but 35 mA.
    """
    known = BY_SHOWN.get(unit)
    prefixes = known.prefixes if known is not None and largest > 0.0 else ""
    if "k" in prefixes and largest >= _LARGEST:
        return 1e-3, f"k{unit}"
    if "m" not in prefixes or largest >= _SMALLEST:
        return 1.0, unit
    return (1e3, f"m{unit}") if 1e3 * largest >= _SMALLEST else (1e6, f"µ{unit}")


@dataclass(frozen=True)
class Quantity:
    """shown = factor · value in SI units."""

    title: str
    unit: str
    factor: float = 1.0
    symbol: str = ""

    @property
    def short_label(self) -> str:
        """'I_eq [A]': for an axis that is too short for the title."""
        return f"{self.symbol or self.title} [{self.unit}]" if self.unit else self.symbol or self.title

    @property
    def label(self) -> str:
        """'Residual torque [mN·m]'."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def scaled(self, values: ArrayLike) -> Quantity:
        """With the prefix that the largest of the values (in SI units) asks for."""
        size = np.abs(np.asarray(values, dtype=float) * self.factor)
        factor, unit = prefixed(float(np.max(size[np.isfinite(size)], initial=0.0)), self.unit)
        return replace(self, unit=unit, factor=self.factor * factor)

    def powered(self, values: ArrayLike) -> Quantity:
        """As `scaled`, of any unit: 'kN·m/rad', and where none is said with a prefix, 13.8 '10⁻⁶ kg·m²'."""
        scaled = self.scaled(values)
        size = np.abs(np.asarray(values, dtype=float) * scaled.factor)
        largest = float(np.max(size[np.isfinite(size)], initial=0.0))
        if largest == 0.0 or _SMALLEST <= largest < _LARGEST:
            return scaled
        power = 3 * math.floor(math.log10(largest) / 3.0)
        bare = self.unit.startswith(_WITHOUT_PREFIX) or not self.unit or power not in _PREFIXES
        unit = f"10{str(power).translate(_RAISED)} {self.unit}".rstrip() if bare else f"{_PREFIXES[power]}{self.unit}"
        return replace(self, unit=unit, factor=self.factor * 10.0**-power)

    def text(self, value: float) -> str:
        """'35.2 mN·m', three digits."""
        return f"{number(value * self.factor)} {self.unit}".strip()


def with_uncertainty(value: float, half: float, unit: str) -> str:
    """'12.2 ± 0.70 mN·m', '(13.9 ± 0.32)·10⁻⁶ kg·m²': half the width of an interval with two digits."""
    shown = Quantity("", unit).scaled(value)
    if 0.0 < shown.factor * half < _FINE:  # 703.000 ± 0.087 µrad, not 0.703 ± 8.7·10⁻⁵ mrad
        shown = Quantity("", unit).scaled(1e-3 * value)
    if shown.factor * abs(value) >= _LONGEST or any(0.0 < shown.factor * abs(one) < _EXPONENT for one in (value, half)):
        shown = Quantity("", unit).powered([value])
        power, _, bare = shown.unit.partition(" ")
        if power.startswith("10"):
            return f"({with_uncertainty(shown.factor * value, shown.factor * half, '')})·{power} {bare}".rstrip()
    error = number(shown.factor * half, 2)
    decimals = len(error.partition(".")[2])
    digits = 3 if "·" in error or shown.factor * half >= _FINE_AT else decimals + _before(shown.factor * value)
    return f"{number(shown.factor * value, max(digits, 3))} ± {error} {shown.unit}".rstrip()


def _before(value: float) -> int:
    """Digits before the point; none or less for what is smaller than one."""
    return math.floor(math.log10(abs(value))) + 1 if value else 0


def amount(value: float, unit: str) -> str:
    """A size with its unit, prefixed so that it reads well: '35.2 mN·m', and where none is, '13.0·10⁻⁶ kg·m²'."""
    shown = Quantity("", unit).scaled(value)
    if 0.0 < shown.factor * abs(value) < _EXPONENT:  # the power that an uncertainty has
        shown = shown.powered([value])
        if shown.unit.startswith("10"):
            return f"{number(shown.factor * value)}·{shown.unit}"
    return shown.text(value)


# --- numbers as JSON has them -----------------------------------------------------------------------------------------

_Value = TypeVar("_Value")


def plain(value: _Value) -> _Value:
    """The value in types that JSON has; numbers that are not finite are None."""
    return cast(_Value, _plain(value))


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


# --- names of parameters and settings in words: title, unit, a title in a sentence ------------------------------------

_PROPER = frozenset(("Stribeck",))
_OWNERS = {"sensors": "sensor"}  # of a section with several, of which each has its own


def parameter_title(path: str) -> str:
    """'Motor inertia' of 'motor.inertia_kgm2', 'Amplitude' of 'amplitude_rad'."""
    section, _, name = path.rpartition(".")
    words = f"{_OWNERS.get(section, section).replace('.', ' ')} {without_unit(name)}".replace("_", " ").strip()
    return words[:1].upper() + words[1:]


def unit_of(name: str) -> str:
    """'kg·m²' of 'motor.inertia_kgm2'; a name without a unit is a number."""
    unit = of_name(name)
    return "" if unit is None else unit.shown


def labelled(name: str, unit: str | None = None) -> str:
    """'Amplitude [rad]' of 'amplitude_rad'; `unit`: where it is another than the name says."""
    unit = unit_of(name) if unit is None else unit
    return f"{parameter_title(name)} [{unit}]" if unit else parameter_title(name)


def in_sentence(title: str) -> str:
    """A title within a sentence: 'motor inertia', 'phase A current', but 'RMS current' and 'Stribeck friction'."""
    if title[1:2].isupper() or title.partition(" ")[0] in _PROPER:
        return title
    return title[:1].lower() + title[1:]


def all_of(names: Sequence[str]) -> str:
    """'a, b and c'."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


# --- where a quantity sits, which decides its name and unit where an actuator's axes are linear -----------------------
# The motor and the user's side of the transmission each have an axis. NEITHER is said of an angle that is of no axis,
# as a phase in a period, which stays an angle on every actuator.

Side = Literal["motor", "user", "neither"]

MOTOR: Side = "motor"
USER: Side = "user"
NEITHER: Side = "neither"


# --- the canonical signals of a measurement: their column names, titles, symbols and units ----------------------------

Kind = Literal["time", "position", "speed", "current", "torque", "force", "voltage", "ratio", "temperature", "state"]


@dataclass(frozen=True)
class Signal:
    """One canonical column; `unit` is as shown to people, `name` ends in its plain spelling.

    A `state` is a whole number that is held between samples; the other kinds are interpolated.  What moves or pushes
    says at which side: a linear axis gives it another name and unit.
    """

    name: str
    title: str
    symbol: str
    unit: str
    kind: Kind
    side: Side | None = None


_ALL = (
    Signal("time_s", "Time", "t", "s", "time"),
    Signal("command_rad", "Command", "θ_cmd", "rad", "position", USER),
    Signal("user_position_rad", "User position", "θ_u", "rad", "position", USER),
    Signal("user_speed_rad_s", "User speed", "ω_u", "rad/s", "speed", USER),
    Signal("motor_position_rad", "Motor position", "θ_m", "rad", "position", MOTOR),
    Signal("motor_speed_rad_s", "Motor speed", "ω_m", "rad/s", "speed", MOTOR),
    Signal("current_A", "Equivalent current", "I_eq", "A", "current"),
    Signal("phase_a_current_A", "Phase A current", "I_A", "A", "current"),
    Signal("phase_b_current_A", "Phase B current", "I_B", "A", "current"),
    Signal("phase_c_current_A", "Phase C current", "I_C", "A", "current"),
    Signal("motor_torque_Nm", "Motor torque", "T_m", "N·m", "torque", MOTOR),
    Signal("bus_voltage_V", "Bus voltage", "V_bus", "V", "voltage"),
    Signal("motor_voltage_V", "Motor voltage", "V_m", "V", "voltage"),
    Signal("duty", "Duty", "d", "", "ratio"),
    Signal("drive_enabled", "Drive enabled", "on", "", "state"),
    Signal("load_torque_Nm", "Load torque", "T_L", "N·m", "torque", USER),
    Signal("temperature_C", "Temperature", "ϑ", "°C", "temperature"),
    Signal("segment", "Segment", "seg", "", "state"),
    # linear axes
    Signal("command_m", "Command", "x_cmd", "m", "position", USER),
    Signal("user_position_m", "User position", "x_u", "m", "position", USER),
    Signal("user_speed_m_s", "User speed", "v_u", "m/s", "speed", USER),
    Signal("motor_position_m", "Motor position", "x_m", "m", "position", MOTOR),
    Signal("motor_speed_m_s", "Motor speed", "v_m", "m/s", "speed", MOTOR),
    Signal("motor_force_N", "Motor force", "F_m", "N", "force", MOTOR),
    Signal("load_force_N", "Load force", "F_L", "N", "force", USER),
)
SIGNALS: dict[str, Signal] = {signal.name: signal for signal in _ALL}

# Spellings of units at the end of a column's name, in small letters.
_UNITS = (
    *("rad_s", "rad_per_s", "deg_s", "deg_per_s", "rev_s", "rpm", "m_s", "mm_s", "m_per_s", "mm_per_s"),
    *("milliseconds", "seconds", "sec", "ms", "us", "s", "radians", "rad", "mrad", "degrees", "deg", "rev", "turns"),
    *("mm", "um", "m", "ma", "a", "mv", "v", "mnm", "ncm", "nm", "kn", "n", "degc", "c", "k", "f", "percent", "pct"),
)
_UNIT = re.compile("_(" + "|".join(sorted(_UNITS, key=len, reverse=True)) + ")$")
_TIMES = {"t", "time", "times", "timestamp", "seconds", "sec", "elapsed", "elapsed_time"}


def _stem(name: str) -> str:
    """The name in small letters and underscores, without its unit: "motorSpeed [rpm]" gives motor_speed."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])", "_", name)
    return _UNIT.sub("", re.sub(r"[^a-z0-9]+", "_", spaced.lower()).strip("_"))


_STEMS = {name: _stem(name) for name in SIGNALS}


def lookalikes(name: str) -> tuple[str, ...]:
    """Canonical names that a foreign name may stand for: `speed` or `motor_speed_rpm` for motor_speed_rad_s."""
    stem = _stem(name)
    same = tuple(known for known in SIGNALS if _STEMS[known] == stem)
    return same or tuple(known for known in SIGNALS if stem and _STEMS[known].endswith("_" + stem))


def looks_like_time(name: str) -> bool:
    """Whether a foreign name, such as `t`, `time` or `time_ms`, stands for time."""
    return _stem(name) in _TIMES


# --- rotary and linear axes: the equations are the same, the names and the units are not ------------------------------
# Inside, every quantity has its rotary name; an angle of a linear axis is a length in m, a torque a force in N, an
# inertia a mass in kg.  Files and people see the axis's own names.  Motor and user may differ: a ball screw turns
# in the motor's rad and moves in the user's m, and its gear ratio is in m/rad.

KINDS = ("rotary", "linear")


@dataclass(frozen=True)
class Axes:
    """The kind of the motor's and of the user's axis: "rotary" or "linear"."""

    motor: str = "rotary"
    user: str = "rotary"

    def is_linear(self, side: Side | None) -> bool:
        """Whether what sits at that side is a length and not an angle; what has no side never is."""
        return (side == MOTOR and self.motor == "linear") or (side == USER and self.user == "linear")

    def name(self, name: str, side: Side | None) -> str:
        """The name in files of what is `name` inside: inertia_kgm2 or mass_kg."""
        return linear_name(name) if self.is_linear(side) else name

    def unit(self, unit: str, side: Side | None, per: Side | None = None) -> str:
        """The unit, as shown, of what has `unit` on rotary axes.

        per: the side whose angle stands below the line of what rotary axes leave out as rad/rad: of a gear ratio, the
        user's angle per motor's; of an order, periods per turn.
        """
        if per is None:
            return linear_unit(unit) if self.is_linear(side) else unit
        above, below = ("m" if self.is_linear(one) else "rad" for one in (side, per))
        if above == below:
            return unit
        return f"{above}/{below}" if not unit else unit.replace("1/", f"{above}/({below}·") + ")"

    def signal(self, name: str) -> str:
        """The name in recordings of the signal that is `name` inside."""
        signal = SIGNALS.get(name)
        return name if signal is None else self.name(name, signal.side)

    def inside(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Signals by their names inside; those of the other kind of axis are left out."""
        names = {self.signal(name): name for name in ROTARY_SIGNALS}
        foreign = {linear_name(name) for name in ROTARY_SIGNALS} | ROTARY_SIGNALS
        return {
            names.get(name, name): values for name, values in signals.items() if name in names or name not in foreign
        }

    def of_other_axes(self, signals: Iterable[str]) -> tuple[str, ...]:
        """Those of recordings' signals that only axes of the other kind have: what `inside` leaves out."""
        return tuple(name for name in signals if not self.inside({name: None}))

    def mismatch(self, needed: str, signals: Iterable[str]) -> str:
        """What is wrong, where a recording has what is `needed` inside for the other kind of axis; else ""."""
        other = next((name for name in (needed, linear_name(needed)) if name != self.signal(needed)), "")
        if not other or other not in signals:
            return ""
        kind, own = KINDS if other == needed else KINDS[::-1]
        return (
            f"the recording's axis is {kind}, as {other} says, and the actuator's is {own}; "
            "take an actuator of that axis, or correct [axes] in the actuator's file"
        )

    def outside(self, signals: Mapping[str, Any]) -> dict[str, Any]:
        """Signals by the names that recordings have."""
        return {self.signal(name): values for name, values in signals.items()}


ROTARY_SIGNALS = {name for name, signal in SIGNALS.items() if signal.side and linear_name(name) != name}
ROTARY = Axes()


# --- signals and what is left of them, as figures, tables and sentences show them -------------------------------------


def of_signal(name: str, axes: Axes) -> Quantity:
    """A signal in its own unit, by its name inside or in files."""
    signal = SIGNALS.get(axes.signal(name))
    if signal is None:
        return Quantity(name.replace("_", " "), "")
    return Quantity(signal.title, signal.unit, symbol=signal.symbol)


def of_residual(name: str, axes: Axes, torque_constant: float | None = None) -> Quantity:
    """What is left of a signal; with a torque constant, N·m/A, the current's is told as the motor's torque."""
    if name == "current_A" and torque_constant is not None:
        torque = SIGNALS[axes.signal("motor_torque_Nm")]
        return Quantity(f"Residual {torque.kind}", torque.unit, torque_constant, f"Δ{torque.symbol}")
    whole = of_signal(name, axes)
    return Quantity(
        f"Residual {in_sentence(whole.title.removeprefix('Equivalent '))}", whole.unit, symbol=f"Δ{whole.symbol}"
    )


# --- the variables that a residual is held against, and what a curve of one may be multiplied by ----------------------


@dataclass(frozen=True)
class Variable:
    """One variable; `indirect` is 0 for what physical effects act through themselves.

    The others go along with those: the share by which one must explain more before it is believed to be the cause.
    """

    name: str
    title: str
    unit: str  # on rotary axes
    side: Side | None
    place: str = "at "  # before a value of it
    indirect: float = 0.0

    @property
    def noun(self) -> str:
        """In a sentence."""
        return self.title.lower()


_ROWS = (
    Variable("motor_angle", "Motor angle", "rad", MOTOR),
    Variable("user_position", "User position", "rad", USER, "at a user position of ", 0.01),
    Variable("motor_speed", "Motor speed", "rad/s", MOTOR),
    Variable("acceleration", "Motor acceleration", "rad/s²", MOTOR, "at an acceleration of ", 0.03),
    Variable("current", "Motor current", "A", None, indirect=0.005),
    Variable("load", "Load", "N·m", USER, "under a load of "),
    Variable("time", "Time", "s", None, indirect=0.15),
    Variable("temperature", "Temperature", "°C", None, indirect=0.05),
)
VARIABLES: dict[str, Variable] = {row.name: row for row in _ROWS}


@dataclass(frozen=True)
class Modulator:
    """What a curve of a variable is multiplied by."""

    name: str
    title: str
    noun: str  # after a variable's


_MODULATORS = (
    Modulator("1", "alone", ""),
    Modulator("sign_speed", "× direction", " and direction"),
    Modulator("current", "× current", " in proportion to the current"),
)
MODULATORS: dict[str, Modulator] = {row.name: row for row in _MODULATORS}


def variable_title(name: str) -> str:
    """'Motor angle' of 'motor_angle'."""
    return VARIABLES[name].title if name in VARIABLES else name.replace("_", " ")


NOTHING = "nothing"  # explains it


def explanation_title(variable: str | None, modulator: str | None) -> str:
    """'Motor speed × direction' of 'motor_speed' and 'sign_speed'; 'nothing' without a variable."""
    if not variable:
        return NOTHING
    by = MODULATORS.get(modulator or "1")
    more = "" if by is None or not by.noun else f" {by.title}"
    return variable_title(variable) + more


def is_turn(name: str, axes: Axes) -> bool:
    """Whether it is an angle that comes round again: of a rotary motor."""
    return name == "motor_angle" and not axes.is_linear(MOTOR)


def of_variable(name: str, axes: Axes) -> Quantity:
    """A variable as figures and sentences show it; the angle of a turn in degrees."""
    one = VARIABLES[name]
    if is_turn(name, axes):
        return Quantity(one.title, "°", 180.0 / math.pi)
    return Quantity(one.title, axes.unit(one.unit, one.side))
