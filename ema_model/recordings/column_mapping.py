"""Which column of a file is which signal, its unit and sign: stated by a person, guessed, applied, put into words."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.errors import InputError, did_you_mean
from ema_model.files.opened import listed, shown
from ema_model.quantities import SIGNALS, in_sentence
from ema_model.recordings.column_names import (
    BUS,
    COMMAND,
    LOAD,
    MEASURED,
    MOTOR,
    OTHER,
    QUANTITIES,
    USER,
    Guess,
    Name,
    UnitOfMeasure,
    dimensions_of,
    find_unit,
    known_export,
    known_units,
    readings,
)
from ema_model.recordings.formats.format import Clocks

# --- which column of a file is which signal, in which unit and with which sign; its text form and its use -------------

Array = NDArray[np.float64]

_LATE_START_S = 1e5  # clocks of a computer start later than any recording lasts
_MOST = 1e30  # so that no product overflows
MOST_DUTY = 1.5  # a share of the bus voltage is within ±1, but for offsets
WITHOUT_DELAY = ("time_s", "segment")  # which say when all others are
_FORM = "write signal=column[unit], e.g. motor_speed_rad_s=speed[rpm]"
NUMBERS = {"sign": 1, "scale": 1.0, "offset": 0.0, "delay_s": 0.0}  # of a column, and what they are where left out
_OPTION = re.compile(rf"({'|'.join(NUMBERS)})\s*=\s*(\S+)")


@dataclass(frozen=True)
class MappedColumn:
    """One column as one signal: signal = sign·scale·(column in SI) + offset; the offset in the signal's SI unit.

    The column comes delay_s later than its time says; reading moves it back.  Raises InputError for an unknown signal
    or unit, a sign other than ±1 and numbers that are too large.
    """

    signal: str
    column: str
    unit: str = ""  # "" is the signal's own SI unit
    sign: int = 1
    scale: float = 1.0
    offset: float = 0.0
    delay_s: float = 0.0
    confidence: float = 1.0  # of a guess, 0 to 1
    reason: str = ""  # of a guess, in plain words
    rivals: tuple[str, ...] = ()  # columns that a guess finds as likely

    def __post_init__(self) -> None:
        if self.signal not in SIGNALS:
            raise InputError(f"mapping: {_no_signal(self.signal)}")
        if not self.column:
            raise InputError(f"mapping of {self.signal}: the column's name is missing; {_FORM}")
        if self.sign not in (1, -1):
            raise InputError(f"mapping of {self.signal}: the sign must be 1 or -1, not {shown(self.sign)}")
        if not 0.0 < abs(self.scale) <= _MOST or not abs(self.offset) <= _MOST:
            raise InputError(f"mapping of {self.signal}: scale and offset must be numbers up to 1e30, the scale not 0")
        if not abs(self.delay_s) <= _MOST or (self.delay_s and self.signal in WITHOUT_DELAY):
            raise InputError(
                f"mapping of {self.signal}: delay_s must be a number of seconds, and 0 for time_s and segment"
            )
        _unit(self.signal, self.unit)

    @property
    def converter(self) -> UnitOfMeasure:
        """The unit, with its factor to SI."""
        return _unit(self.signal, self.unit)

    @property
    def numbers(self) -> dict[str, float]:
        """Those of `NUMBERS` that are other than where they are left out."""
        return {name: value for name, usual in NUMBERS.items() if (value := getattr(self, name)) != usual}

    @property
    def text(self) -> str:
        """As on the command line: `signal=column[unit, sign=-1, scale=2.0, offset=0.1, delay_s=0.005]`."""
        options = [
            *([self.unit] if self.unit else []),
            # Said where the column's name would say otherwise.
            *([SIGNALS[self.signal].unit] if self._must_say_si else []),
            *(f"{name}={value!r}" for name, value in self.numbers.items()),
        ]
        return f"{self.signal}={self.column}" + (
            f"[{', '.join(options)}]" if options or self.column.endswith("]") else ""
        )

    @property
    def _must_say_si(self) -> bool:
        return not self.unit and self.column != self.signal and unit_in_name(self.column, self.signal) != ""

    def values(self, raw: ArrayLike) -> Array:
        """The signal, from the column's numbers as they stand in the file; the same shape."""
        si = self.converter.to_si(raw)
        if self.sign * self.scale != 1.0:
            si *= self.sign * self.scale
        if self.offset:
            si += self.offset
        return si


@dataclass(frozen=True)
class ColumnMapping:
    """The columns in use, one per signal, and those left aside, with the reason.

    Raises InputError if a signal stands twice.
    """

    entries: tuple[MappedColumn, ...] = ()
    unmapped: tuple[tuple[str, str], ...] = ()  # column, why

    def __post_init__(self) -> None:
        seen: dict[str, MappedColumn] = {}
        for entry in self.entries:
            if entry.signal in seen:
                both = f"{shown(seen[entry.signal].column)!r} and {shown(entry.column)!r}"
                raise InputError(f"mapping: {entry.signal} is given two columns, {both}; keep one")
            seen[entry.signal] = entry

    def get(self, signal: str) -> MappedColumn | None:
        """The column of a signal, if it has one."""
        return next((entry for entry in self.entries if entry.signal == signal), None)

    @property
    def texts(self) -> tuple[str, ...]:
        """One `signal=column[unit]` per entry, as for `--map`."""
        return tuple(entry.text for entry in self.entries)

    def with_entry(self, entry: MappedColumn) -> ColumnMapping:
        """A copy in which the entry takes the place of its signal's old one."""
        kept = (other for other in self.entries if other.signal != entry.signal)
        unmapped = tuple(pair for pair in self.unmapped if pair[0] != entry.column)
        return ColumnMapping((*kept, entry), unmapped)


# A column by its place: the seventh of all, or of a matrix as NumPy (from 0) and MATLAB (from 1) write it.
_BY_NUMBER = re.compile(r"#\s*(\d{1,9})")
_BY_SLICE = re.compile(r"(.+?)\s*(?:\[\s*(?::\s*,\s*)?(\d{1,9})\s*\]|\(\s*:\s*,\s*(\d{1,9})\s*\))")


def column_at(name: str, header: Sequence[str]) -> str:
    """The column that a name or a place means: `#7`, `q[:,6]`, `q[6]` and `q(:,7)`; the name itself where it is none.

    A matrix's columns are called q_1, q_2, … in a file, or q.0, q.1, … where its rows are lists.
    """
    if name in header:
        return name
    if number := _BY_NUMBER.fullmatch(name):
        at = int(number[1])
        return header[at - 1] if 0 < at <= len(header) else name
    matrix, at = _of_matrix(name)
    if not matrix:
        return name
    called = f"{matrix}_{at + 1}", f"{matrix}.{at}"
    return next((one for one in header if one in called or one.partition(" [")[0] in called), name)


def _of_matrix(name: str) -> tuple[str, int]:
    """The matrix and which of its columns, from 0, that a name means; "" where it means none."""
    if found := _BY_SLICE.fullmatch(name):
        return found[1], int(found[2]) if found[2] else int(found[3]) - 1
    counted = re.fullmatch(r"(.+)_(\d{1,9})", name)
    return (counted[1], int(counted[2]) - 1) if counted else ("", 0)


def with_places(mapping: ColumnMapping, header: Sequence[str]) -> ColumnMapping:
    """The mapping with the names of the file's columns where it says their places."""
    entries = []
    for entry in mapping.entries:
        column = column_at(entry.column, header)
        unit = entry.unit or (unit_in_name(column, entry.signal) if column != entry.column else "")
        entries.append(replace(entry, column=column, unit=unit) if column != entry.column else entry)
    return replace(mapping, entries=tuple(entries))


def parse_mapping(texts: Iterable[str], columns: Sequence[str] = ()) -> ColumnMapping:
    """The mapping that `signal=column[unit]` texts give.

    With the file's `columns`, one whose own name ends in brackets is found too: `speed [rpm]` is then a
    column with its unit in the name, and a column may be given by its place, see `column_at`.  Raises InputError for a
    text of another form.
    """
    return with_places(ColumnMapping(tuple(_parsed(text, columns) for text in texts)), columns)


def _parsed(text: str, columns: Sequence[str]) -> MappedColumn:
    signal, equals, right = (part.strip() for part in text.partition("="))
    if not equals or not signal or not right:
        raise InputError(f"mapping {shown(text)!r} is not understood; {_FORM}")
    if signal not in SIGNALS:
        raise InputError(f"mapping {shown(text)!r}: {_no_signal(signal)}")
    inside = re.fullmatch(r"(.+?)\s*\[([^\[\]]*)\]", right)
    is_place = _BY_SLICE.fullmatch(right) and not (inside and find_unit(inside[2], SIGNALS[signal].unit))
    if right in columns or not inside or is_place:
        return MappedColumn(signal, right, unit_in_name(right, signal))
    column = inside[1]
    given: dict[str, str] = {}
    for part in inside[2].split(","):
        option = _OPTION.fullmatch(part.strip())
        name, value = (option[1], option[2]) if option else ("unit", part.strip())
        if name in given:
            raise InputError(f"mapping {shown(text)!r}: {name} stands twice; {_FORM}")
        given[name] = value
    numbers = {name: _number(text, name, given[name]) for name in NUMBERS if name in given}
    if numbers.get("sign", 1.0) not in (1.0, -1.0):
        raise InputError(f"mapping {shown(text)!r}: the sign must be 1 or -1, not {shown(given['sign'])}")
    return MappedColumn(
        signal,
        column,
        given.get("unit", unit_in_name(column, signal)),
        int(numbers.get("sign", 1.0)),
        numbers.get("scale", 1.0),
        numbers.get("offset", 0.0),
        numbers.get("delay_s", 0.0),
    )


def unit_in_name(column: str, signal: str) -> str:
    """The unit of the signal's kind that a column's name ends in, or "": `speed [rpm]`, `speed_rpm`."""
    units = (find_unit(name.unit, SIGNALS[signal].unit) for name in readings(column) if name.unit)
    return next((unit.name for unit in units if unit), "")


def _no_signal(name: str) -> str:
    return f"no signal {shown(name)!r}; there are {', '.join(SIGNALS)}{did_you_mean(name, SIGNALS)}"


def _number(text: str, name: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise InputError(f"mapping {shown(text)!r}: {name} must be a number, not {shown(value)!r}") from None


def _unit(signal: str, text: str) -> UnitOfMeasure:
    dimension = SIGNALS[signal].unit
    if not text:
        return UnitOfMeasure(dimension, dimension)
    unit = find_unit(text, dimension)
    if unit is None:
        other = dimensions_of(text)
        what = f"{shown(text)!r} is a unit of another kind" if other else f"the unit {shown(text)!r} is not known"
        raise InputError(f"mapping of {signal}: {what}; it takes {', '.join(known_units(dimension)) or 'no unit'}")
    if math.isnan(unit.numerator):
        raise InputError(f"mapping of {signal}: counts need the counts per turn; write [counts/4096] for 4096 per turn")
    return unit


def apply_mapping(table: Mapping[str, ArrayLike], mapping: ColumnMapping) -> tuple[dict[str, Array], tuple[str, ...]]:
    """The mapped signals in SI units, and notes on what was done to them.

    `table` holds the columns by their own names, (n,) each; columns that already have a signal's name and
    are not mapped stay as they are.  Raises InputError if a mapped column is missing.
    """
    missing = [entry.column for entry in mapping.entries if entry.column not in table]
    if missing:
        raise InputError(
            f"mapping: no column {shown(missing[0])!r}; present: {listed(table)}{did_you_mean(missing[0], table)}"
        )
    used = {entry.column for entry in mapping.entries}
    taken = {entry.signal for entry in mapping.entries}
    signals, notes = {}, []
    for name, values in table.items():
        if name in SIGNALS and name not in used and name not in taken:
            signals[name] = np.array(values, np.float64)
    for entry in mapping.entries:
        raw = np.asarray(table[entry.column], np.float64)
        start = 0.0
        if entry.signal == "time_s" and raw.size and abs(entry.values(raw[:1])[0]) > _LATE_START_S:
            # Taken off before the conversion, while its digits are all there.
            start = raw[0]
            first = float(entry.values(start))
            notes.append(f"time counts from the first sample, which the file puts at {first:.6f} s")
        signals[entry.signal] = entry.values(raw - start if start else raw)
        if entry.text != f"{entry.signal}={entry.signal}":
            notes.append(f"{entry.signal} is {_told(entry)}")
    ordered = {name: signals[name] for name in SIGNALS if name in signals}
    return ordered, tuple(notes)


def _told(entry: MappedColumn) -> str:
    unit = "" if entry.converter.is_si else f", converted from {entry.unit}"
    turned = ", its sign turned" if entry.sign < 0 else ""
    scale = f", times {entry.scale:g}" if entry.scale != 1.0 else ""
    offset = f", plus {entry.offset:g}" if entry.offset else ""
    return f"column {shown(entry.column)!r}{unit}{turned}{scale}{offset}"


# --- how a file was read ----------------------------------------------------------------------------------------------
# How a file was read: which columns are which signals, what of it was guessed, and what was made from others.


@dataclass(frozen=True)
class Reading:
    """The page, the command line and side files tell and keep the same of it."""

    mapping: ColumnMapping = field(default_factory=ColumnMapping)  # in use; canonical names need no entry
    guessed: tuple[MappedColumn, ...] = ()  # those of the mapping that nobody has said
    doubts: tuple[tuple[MappedColumn, str], ...] = ()  # guesses that are not used, and why
    made: tuple[str, ...] = ()  # signals made from others
    clocks: Clocks | None = None  # of the signals, by their names in files, where they had several
    layout: str = ""  # what was found out of how the file is laid out: "header in line 4, units in line 5"
    remarks: tuple[str, ...] = ()  # what was done to the signals beyond what was asked for, a line each

    @property
    def is_guess(self) -> bool:
        """Whether there were columns of which nobody has said what they are."""
        return bool(self.guessed or self.doubts or self.mapping.unmapped)

    @property
    def assumed(self) -> str:
        """'motor_speed_rad_s from Motordrehzahl [rpm], current_A from iq [mA]'; "" where nothing was guessed."""
        used = ", ".join(f"{entry.signal} from {_reading_with_unit(entry)}" for entry in self.guessed)
        aside = ", ".join(f"{shown(entry.column)} ({why})" for entry, why in self.doubts)
        return "; left aside: ".join(filter(None, (used, aside))) if used else aside and f"left aside: {aside}"

    @property
    def told(self) -> str:
        """What was found out and done unasked, in one line; "" where there was no question."""
        return "; ".join(filter(None, (self.layout, self.assumed, *self.remarks)))

    def proposed(self, columns: Iterable[str]) -> ColumnMapping:
        """Everything that somebody should look at: what is used, canonical names too, and what is in doubt."""
        entries = {entry.signal: entry for entry, _ in self.doubts}
        entries |= {name: MappedColumn(name, name) for name in columns if name in SIGNALS}
        entries |= {entry.signal: entry for entry in self.mapping.entries}
        return ColumnMapping(tuple(entries[name] for name in SIGNALS if name in entries), self.mapping.unmapped)


def without_unit(columns: Collection[str]) -> list[str]:
    """The columns as a message lists them: those in whose names no unit is found say so."""
    return [
        name if name in SIGNALS or any(unit_in_name(name, signal) for signal in SIGNALS) else f"{name} (no unit)"
        for name in columns
    ]


def _reading_with_unit(entry: MappedColumn) -> str:
    unit = f" [{entry.unit}]" if entry.unit and not unit_in_name(entry.column, entry.signal) else ""
    why = f" ({entry.reason.rpartition('; ')[2]})" if unit and entry.signal == "duty" else ""
    return f"{shown(entry.column)}{unit}{why}"


# --- which signals a column may be by its name alone, and in which unit -----------------------------------------------

_CURRENT_WORDS = frozenset("i im iph phase ph cur curr current".split())
_ROTARY = frozenset("angle theta q phi rotation encoder enc resolver".split())
_PHASE_OF = dict(zip("abcuvw", "abcabc"))


class Context:
    """What the other columns tell about one."""

    def __init__(self, names: list[str], known: Iterable[str]) -> None:
        """names: of the file's columns; known: signals that others of them are already."""
        every = [readings(name)[0] for name in names]
        self.lowered = {name.lower() for name in names}
        self.has_position_command = any(signal.startswith("command") for signal in known) or any(
            _is_commanded(name, what) for name in every if (what := _quantity(name)) in ("position", "")
        )
        positions = {signal.rpartition("_")[0] for signal in known if "_position_" in signal}
        self.is_at_user = positions == {"user_position"}  # the only place where motion was recorded
        self.has_duty = any(_quantity(name) == "duty" for name in every)

    def phase_letter(self, name: str) -> tuple[str, str, int] | None:
        """The letter that tells two or three columns apart, the name without it, and how many there are: i_a, i_b."""
        lowered = name.lower()
        for least in (3, 2):
            for match in re.finditer(r"[a-cu-w]", lowered):
                at = match.start()
                for letters in ("abc", "uvw"):
                    alike = {lowered[:at] + x + lowered[at + 1 :] for x in letters} & self.lowered
                    if match[0] in letters and len(alike) >= least:
                        return match[0], name[:at] + name[at + 1 :], len(alike)
        return None


def _quantity(name: Name) -> str:
    """What is measured, or "".  `current` before another quantity means present: `current_position`."""
    found = [(at, what) for at, word in enumerate(name.words) for what, words in QUANTITIES.items() if word in words]
    if not found:
        return ""
    whats = [what for _, what in found]
    if whats == ["time"] and "t" in name.words:
        if name.has(LOAD | MOTOR) or find_unit(name.unit, "N·m"):
            return "torque"  # T_load, T_m
        if find_unit(name.unit, "°C"):
            return "temperature"
    if whats[-1] == "voltage" and name.words[found[-1][0]] in ("v", "u"):
        if "position" in whats:
            return "position"  # theta_u
        if find_unit(name.unit, "m/s") or find_unit(name.unit, "rad/s"):
            return "speed"
    if "enabled" in whats:
        return "enabled"
    for what in ("speed", "temperature", "duty"):
        if what in whats and not (what == "speed" and "time" in whats):
            return what
    if whats[0] == "current" and name.words[found[0][0]] == "current" and len(set(whats)) > 1:
        return next(what for what in whats if what != "current")
    # The last is the noun: `motor angle time` is a time; `joint torque` a torque.
    return whats[-1]


def _is_commanded(name: Name, quantity: str) -> bool:
    return name.has(COMMAND) or (quantity == "position" and "input" in name.words)


def guesses(column: str, context: Context, counts_per_turn: int | None) -> list[Guess] | str:
    """The signals that a column may be, or why it is none."""
    if column in SIGNALS:
        return [Guess(column, "", 1.0, "the name is the signal's own")]
    told = context.phase_letter(column)
    phase = _phase(*told) if told else None
    if phase:
        return [phase]
    problem = ""
    for name in readings(column):
        quantity = _quantity(name)
        found = _by_quantity(name, quantity, context)
        if isinstance(found, str):
            problem = problem or found
            continue
        fitting = [guess for guess in found if not name.unit or find_unit(name.unit, SIGNALS[guess.signal].unit)]
        if fitting:
            return [g for guess in fitting if (g := _by_name_with_unit(guess, name, counts_per_turn))] or (
                "it is in counts; the counts per turn are needed"
            )
    return problem or "its name says nothing known"


def _by_name_with_unit(guess: Guess, name: Name, counts_per_turn: int | None) -> Guess | None:
    dimension = SIGNALS[guess.signal].unit
    if not name.unit:
        unit = "counts" if not {"counts", "ticks", "count"}.isdisjoint(name.words) and dimension == "rad" else ""
        if not unit:
            return replace(guess, confidence=guess.confidence - (0.1 if dimension else 0.0))
    else:
        found = find_unit(name.unit, dimension)
        unit = found.name if found else ""
    if unit in ("counts", "counts/s"):
        if not counts_per_turn:
            return None
        unit = unit.replace("counts", f"counts/{counts_per_turn}")
    return replace(guess, unit=unit, reason=f"{guess.reason}; unit {unit}" if unit else guess.reason)


def _phase(letter: str, rest: str, count: int) -> Guess | None:
    """One of so many columns, whose name without the phase's letter is `rest`; two may as well be two motors'."""
    for name in readings(rest):
        unit = find_unit(name.unit, "A") if name.unit else None
        if name.has(COMMAND) or (name.unit and not unit):
            continue
        if unit or (name.has(_CURRENT_WORDS) and not name.has(QUANTITIES["voltage"])):
            signal = f"phase_{_PHASE_OF[letter]}_current_A"
            of = {2: "two", 3: "three"}[count]
            sure = 0.9 if count == 3 else 0.55
            return Guess(signal, unit.name if unit else "", sure, f"one of {of} columns, phase {letter.upper()}")
    return None


def _by_quantity(name: Name, quantity: str, context: Context) -> list[Guess] | str:
    """Candidates from what is measured, whose it is, and whether it is wanted or measured."""
    said = " ".join(name.words)
    if quantity in OTHER and name.has(OTHER[quantity]) and not (quantity == "voltage" and name.has(BUS)):
        other = next(word for word in name.words if word in OTHER[quantity])
        return f"{other!r} makes it another quantity"
    commanded = _is_commanded(name, quantity)
    if commanded and quantity not in ("position", "", "time"):
        return f"a commanded {quantity}; only a position's command is used"
    if commanded and quantity != "time":
        sure = 0.9 if quantity else 0.65
        linear = "command_m" if _is_linear(name) else "command_rad"
        return [Guess(linear, "", sure, f"{said!r} is a position that is commanded")]
    if quantity == "position":
        return _positions(name, said, context)
    return _others(name, quantity, said, context)


def _positions(name: Name, said: str, context: Context) -> list[Guess] | str:
    kind = "m" if _is_linear(name) else "rad"
    motor, user = f"motor_position_{kind}", f"user_position_{kind}"
    if name.has(MOTOR):
        return [Guess(motor, "", 0.9, f"{said!r} is the motor's position")]
    if name.has(USER):
        return [Guess(user, "", 0.85, f"{said!r} is the position of the output")]
    if context.has_position_command and not name.has(frozenset({"encoder", "enc", "resolver"})):
        reason = f"{said!r} is a position, and the file has a command for it to follow"
        return [Guess(user, "", 0.7, reason), Guess(motor, "", 0.5, f"{said!r} is a position")]
    reason = f"{said!r} is a position, with no command for it to follow"
    return [Guess(motor, "", 0.65, reason), Guess(user, "", 0.5, f"{said!r} is a position")]


def _is_linear(name: Name) -> bool:
    if not name.unit:
        return not {"x", "stroke", "displacement"}.isdisjoint(name.words)
    return find_unit(name.unit, "m") is not None and not name.has(_ROTARY)


def _others(name: Name, quantity: str, said: str, context: Context) -> list[Guess] | str:
    plain = bool(set(name.words) <= QUANTITIES.get(quantity, frozenset()) | MOTOR | MEASURED)
    sure = 0.85 if plain else 0.65
    if quantity == "time":
        return [Guess("time_s", "", sure + 0.1, f"{said!r} is time")]
    if quantity == "speed":
        linear = find_unit(name.unit, "m/s") is not None or "dx" in name.words or "xdot" in name.words
        unit = "m_s" if linear else "rad_s"
        if (name.has(USER) or context.is_at_user) and not name.has(MOTOR):
            return [Guess(f"user_speed_{unit}", "", 0.85, f"{said!r} is the speed of the output")]
        return [Guess(f"motor_speed_{unit}", "", sure, f"{said!r} is a speed")]
    if quantity == "current":
        surer = 0.05 if name.has(frozenset({"iq", "ieq"})) else 0.0
        return [Guess("current_A", "", sure + surer, f"{said!r} is a current")]
    if quantity == "torque":
        signal = "load_torque_Nm" if name.has(LOAD) else "motor_torque_Nm"
        return [Guess(signal, "", 0.85 if name.has(LOAD | MOTOR) else 0.6, f"{said!r} is a torque")]
    if quantity == "voltage":
        signal = "bus_voltage_V" if name.has(BUS) or (context.has_duty and not name.has(MOTOR)) else "motor_voltage_V"
        known = name.has(BUS | MOTOR | {"vm", "vmot", "vq"})
        return [Guess(signal, "", 0.85 if known else 0.5, f"{said!r} is a voltage")]
    if quantity == "force":
        signal = "load_force_N" if name.has(LOAD) else "motor_force_N"
        return [Guess(signal, "", 0.85 if name.has(LOAD | MOTOR) else 0.6, f"{said!r} is a force")]
    table = {"duty": "duty", "temperature": "temperature_C", "segment": "segment"}
    table["enabled"] = "drive_enabled"
    if quantity in table:
        return [Guess(table[quantity], "", sure, f"{said!r} is {in_sentence(SIGNALS[table[quantity]].title)}")]
    if name.words[-1:] == ("load",):
        sure = 0.6 if name.unit else 0.35
        return [Guess(load, "", sure, f"{said!r} is a load") for load in ("load_torque_Nm", "load_force_N")]
    return _by_unit_alone(name)


def _by_unit_alone(name: Name) -> list[Guess] | str:
    for dimension, signal in {"rad/s": "motor_speed_rad_s", "A": "current_A", "°C": "temperature_C"}.items():
        if len(name.unit) > 1 and find_unit(name.unit, dimension):
            return [Guess(signal, "", 0.4, f"only its unit, {shown(name.unit)}, tells")]
    if not name.unit and len(name.words) == 1 and find_unit(name.words[0], "s") and len(name.words[0]) > 1:
        return [Guess("time_s", name.words[0], 0.6, f"{name.words[0]!r} is a unit of time")]
    return "its name says nothing known"


# --- guesses which column is which signal, and in which unit, from the names and, where given, the numbers ------------

_LEAST = 0.3  # confidence below which a column is left aside
_SURE = 0.6  # and from which on a guess is used without asking; tried on the headers of tests/recordings/test_mapping
_AS_LIKELY = 0.04  # less than this apart, two guesses are as likely; "iq" is surer than "current" by more
_NOTHING = ColumnMapping()


def guess_mapping(
    columns: Mapping[str, ArrayLike] | Iterable[str],
    *,
    known: ColumnMapping = _NOTHING,
    counts_per_turn: int | None = None,
) -> ColumnMapping:
    """The likely mapping of a file's columns; every entry says how sure it is and why.

    `columns` are the names, or names with their numbers ((n,) each), which then help with units that the
    names leave open.  `known` is what is mapped already and stays.  `counts_per_turn` is the encoder's, for
    columns in counts.  Nothing is raised for strange names: what is not understood is in `unmapped`, with the
    reason.
    """
    tables = columns if isinstance(columns, Mapping) else {}
    settled = {entry.column for entry in known.entries}
    names = [name for name in map(str, columns) if name not in settled]
    shares = Context([*names, *settled], [entry.signal for entry in known.entries])
    export = known_export([*map(str, columns)])
    ranked: list[tuple[float, int, str, Guess]] = []
    reasons = {name: "its name says nothing known" for name in names}
    for order, name in enumerate(names):
        found = guesses(name, shares, counts_per_turn)
        if export is not None and export.columns:
            of_tool = export.guess(name)
            found = of_tool if isinstance(of_tool, str) else [of_tool]
        if isinstance(found, str):
            reasons[name] = found
            continue
        for guess in found:
            guess = _checked(guess, tables.get(name))
            if guess.confidence >= _LEAST:
                ranked.append((-guess.confidence, order, name, guess))
    entries = {entry.signal: entry for entry in known.entries}
    used: set[str] = set()
    for _, _, name, guess in sorted(ranked, key=lambda item: item[:2]):
        if name in used or not name:
            continue
        if guess.signal in entries:
            reasons[name] = f"{guess.signal} is taken by {shown(entries[guess.signal].column)!r}"
            continue
        entries[guess.signal] = MappedColumn(
            guess.signal, name, guess.unit, confidence=round(guess.confidence, 2), reason=guess.reason
        )
        used.add(name)
    guessed_as = {entry.column: entry for entry in entries.values()}
    for signal, entry in entries.items():
        if entry.column not in settled:
            entries[signal] = replace(entry, rivals=_rivals(entry, ranked, guessed_as))
    ordered = tuple(entries[name] for name in SIGNALS if name in entries)
    return ColumnMapping(ordered, tuple((name, reasons[name]) for name in names if name not in used))


def doubt(entry: MappedColumn) -> str:
    """Why a guess must not be used before somebody has said so, in plain words; "" for one that is sure."""
    if entry.rivals:
        return f"{listed(map(repr, map(shown, entry.rivals)))} may be it as well"
    if entry.signal == "duty" and entry.confidence < _SURE:
        return entry.reason
    if entry.signal != "time_s" and not entry.unit and entry.column != entry.signal and SIGNALS[entry.signal].unit:
        return "it has no unit"  # the unit of time shows in its steps
    return entry.reason if entry.confidence < _SURE else ""


def _rivals(
    entry: MappedColumn, ranked: list[tuple[float, int, str, Guess]], chosen: Mapping[str, MappedColumn]
) -> tuple[str, ...]:
    """The columns that are as likely to be the signal, and are not used for what they are likelier to be."""
    found = []
    for _, _, column, guess in ranked:
        near = guess.signal == entry.signal and guess.confidence > entry.confidence - _AS_LIKELY
        elsewhere = chosen.get(column)
        better = elsewhere is not None and elsewhere.confidence >= guess.confidence + _AS_LIKELY
        if near and column != entry.column and not better:
            found.append(column)
    return tuple(found)


def _checked(guess: Guess, values: ArrayLike | None) -> Guess:
    """The guess, its unit and confidence improved by the numbers."""
    if values is None:
        return guess
    numbers: NDArray[np.float64] = np.asarray(values, np.float64).ravel()
    numbers = numbers[np.isfinite(numbers)]
    if numbers.size < 2:
        return guess
    if guess.signal == "time_s":
        steps = np.diff(numbers)
        if np.mean(steps > 0.0) < 0.9:
            return replace(guess, confidence=guess.confidence - 0.5, reason=f"{guess.reason}, but it does not increase")
        if not guess.unit and guess.confidence < 1.0 and "unit" not in guess.reason:
            return _time_unit(guess, float(np.median(steps)))
        return guess
    largest = float(np.max(np.abs(numbers)))
    if guess.signal == "duty" and not guess.unit and largest > MOST_DUTY:
        return _duty_unit(guess, largest)
    if guess.unit or guess.confidence == 1.0:
        return guess
    if guess.signal == "temperature_C" and largest > 200.0:
        return replace(guess, unit="K", reason=f"{guess.reason}; up to {largest:.3g}, so in kelvin")
    return guess


# Full scales that duties are counted in: percent, timers and the words of their registers.
_FULL_DUTIES = (
    *(100, 127, 128, 255, 256, 511, 512, 999, 1000, 1023, 1024, 2047, 2048, 4095, 4096, 8191, 8192, 9999, 10_000),
    *(16_383, 16_384, 32_767, 32_768, 65_535, 65_536),
)


def _duty_unit(guess: Guess, largest: float) -> Guess:
    """The scale of a duty that goes beyond ±1: plain where it goes to a full scale, else to be asked for."""
    full = next((one for one in _FULL_DUTIES if largest <= one * (1.0 + 1e-9)), None)
    if full is None:
        return replace(guess, confidence=0.5, reason=f"it goes up to {largest:g}, and nothing says what is full")
    unit = "%" if full == 100 else f"/{full}"
    if largest > 0.995 * full and (full == 100 or largest == full):
        return replace(guess, unit=unit, reason=f"{guess.reason}; up to {largest:g}, so that {full} is full")
    reason = f"it goes up to {largest:g}, and nothing says whether {full} is full"
    return replace(guess, unit=unit, confidence=0.5, reason=reason)


def _time_unit(guess: Guess, step: float) -> Guess:
    """The unit of time from the step, which is 20 µs to 0.5 s in any recording worth fitting."""
    for unit, least in (("", 0.0), ("ms", 0.5), ("us", 50.0), ("ns", 50_000.0)):
        if step >= least:
            chosen = unit
    if not chosen:
        return guess
    reason = f"{guess.reason}; steps of {step:.4g}, so in {chosen}"
    return replace(guess, unit=chosen, confidence=guess.confidence - 0.1, reason=reason)
