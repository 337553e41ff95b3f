"""Which column of a file is which signal, its unit and its sign: stated by a person, applied, and put into words."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ema_model.errors import InputError, did_you_mean
from ema_model.files.opened import listed, shown
from ema_model.quantities import SIGNALS
from ema_model.recordings.column_names import readings
from ema_model.recordings.formats.format import Clocks
from ema_model.recordings.units import UnitOfMeasure, dimensions_of, find_unit, known_units

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
