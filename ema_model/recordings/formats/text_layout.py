"""How a table is laid out that an instrument wrote as text, its dates and times with it."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
from numpy.typing import NDArray

from ema_model.files.opened import refusal, shown
from ema_model.recordings.column_names import dimensions_of
from ema_model.recordings.formats.arrow import as_numpy

# --- date and time as loggers write them, as seconds since the first --------------------------------------------------

_CLOCK = r"(?P<clock>\d{1,2}:\d{2}:\d{2}([.,:]\d{1,9})?)\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(Z|[+-]\d{2}:?\d{2})?"
_STAMP = re.compile(
    rf"((?P<date>\d{{4}}[-/]\d{{1,2}}[-/]\d{{1,2}}|\d{{1,2}}[./-]\d{{1,2}}[./-](\d{{4}}|\d{{2}}))[T ,]\s*)?{_CLOCK}"
)
pc: Any = pyarrow.compute  # its functions are made when it is imported
_HALF_DAY_S = 43_200.0


def is_stamp(cell: str) -> bool:
    """Whether a cell is a time of day, with or without a date."""
    cell = cell.strip()
    return len(cell) < 50 and _STAMP.fullmatch(cell) is not None


def seconds(cells: pa.ChunkedArray) -> NDArray[np.float64] | None:
    """Seconds since the first stamp; None if one is none.  Without a date, midnight is passed where time falls back.

    Day and month are told apart by which is over 12, and by the point between them; else the month comes first.
    """
    text = pc.utf8_trim_whitespace(cells)
    clock = pc.replace_substring(pc.replace_substring_regex(text, r"\s*(Z|[+-]\d{2}:?\d{2})$", ""), ",", ".")
    first = _STAMP.fullmatch(str(text[0]))
    if first is None:
        return None
    clock = pc.replace_substring_regex(clock, r"(:\d{2}:\d{2}):(\d+)", r"\1.\2")
    afternoon = None
    if first["half"]:
        afternoon = as_numpy(pc.match_substring_regex(clock, r"[Pp]\.?[Mm]\.?$"))
        clock = pc.replace_substring_regex(clock, r"\s*[AaPp]\.?[Mm]\.?$", "")
    days = _days(clock) if first["date"] else None
    if first["date"]:
        if days is None:
            return None
        clock = pc.replace_substring_regex(clock, r"^.*[T ]", "")
    parts = pc.extract_regex(clock, r"^(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2}\.?\d*)$")
    if parts.null_count:
        return None
    hours, minutes, rest = (as_numpy(pc.struct_field(parts, [i]).cast(pa.float64())) for i in range(3))
    if afternoon is not None:
        hours = hours % 12.0 + 12.0 * afternoon
    values = 3600.0 * hours + 60.0 * minutes + rest
    if days is not None:
        values = values + 86_400.0 * (days - days[0])
    else:
        values = values + 86_400.0 * np.cumsum(np.diff(values, prepend=values[0]) < -_HALF_DAY_S)
    return np.round(values - values[0], 9)


def _days(text: pa.ChunkedArray) -> NDArray[np.float64] | None:
    date = pc.replace_substring_regex(text, r"[T ,].*$", "")
    date = pc.replace_substring_regex(date, r"[./-]", "-")
    parts = pc.extract_regex(date, r"^(?P<a>\d+)-(?P<b>\d+)-(?P<c>\d+)$")
    if parts.null_count:
        return None
    a, b, c = (as_numpy(pc.struct_field(parts, [i]).cast(pa.int64())) for i in range(3))
    if np.max(a) > 31:
        year, month, day = a, b, c
    else:
        day_first = np.max(a) > 12 or "." in str(text[0]).split(" ")[0].split("T")[0]
        day, month = (a, b) if day_first else (b, a)
        year = np.where(c < 100, c + 2000, c)
    if np.any((month < 1) | (month > 12) | (year < 1) | (year > 9999)):
        return None
    months = (year - 1970).astype("datetime64[Y]").astype("datetime64[M]") + (month - 1).astype("timedelta64[M]")
    return (months.astype("datetime64[D]") + (day - 1).astype("timedelta64[D]")).astype(np.int64).astype(np.float64)


# --- how a table is laid out that an instrument wrote as text: found from its first lines, and told in one ------------
# Oscilloscopes, DIAdem, LabVIEW, TwinCAT and the like write lines about the measurement before the names of the
# columns, a row of units below them, in the encoding and with the decimal sign of their country.

HEAD_BYTES = 65_536
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "blanks"}
_SURE_SEPARATORS = tuple(SEPARATORS)[:-1]  # blanks stand in names and between others, too
_COMMENTS = "#%"
_PAIR = re.compile(r"([A-Za-z_][^:,;\t]{0,60}?)\s*:\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_MOST_BETWEEN = 3  # lines between the names and the numbers: units, types, descriptions
_LOOKED_AT = 50  # rows below a header, to see whether it is one
_FEWEST_ROWS = 2
_MOST_OF_ROWS = 0.9  # that are numbers, where no names stand above
_NUMBER = re.compile(
    r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?|[+-]?\d{1,3}([.,'\u00a0\u202f ]\d{3})+([.,]\d+)?|[+-]?(nan|inf)",
    re.IGNORECASE,
)
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(['\u00a0\u202f ]\d{3})+([.,]\d+)?")
_BLANKS = "'\u00a0\u202f "
# Those that logs are usually written in, with their titles; Python's others can be said, too.
ENCODINGS = {
    "utf-8": "UTF-8",
    "cp1252": "Windows-1252",
    "utf-16-le": "UTF-16",
    "utf-16-be": "UTF-16, big-endian",
    "cp1250": "Windows-1250",
    "cp1251": "Windows-1251",
    "cp850": "DOS 850",
    "mac-roman": "Mac Roman",
    "gb18030": "GB 18030",
    "shift_jis": "Shift JIS",
    "euc_kr": "EUC-KR",
}
_BOMS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
_CONTROL = re.compile(r"[\0-\x08\x0e-\x1f]")
_UNIT_WORDS = frozenset("volt volts ampere amp second seconds sec % 1 - bar mbar hz khz dimensionless n/a".split())


@dataclass(frozen=True)
class Hints:
    """What somebody has said of a text's layout, who need not say any of it."""

    header_line: int | None = None  # from 1
    encoding: str | None = None
    rate_Hz: float | None = None  # of a file of any format without a time

    def before(self, others: Hints) -> Hints:
        """These; what they leave open is as the others say."""
        return Hints(
            self.header_line or others.header_line, self.encoding or others.encoding, self.rate_Hz or others.rate_Hz
        )

    @property
    def is_of_text(self) -> bool:
        """Whether something of them is of texts alone."""
        return self.header_line is not None or self.encoding is not None


@dataclass(frozen=True)
class Layout:
    """How a text is laid out.  Lines count from 1."""

    encoding: str
    has_mark: bool  # a byte-order mark begins it
    header_line: int  # 0 where the numbers stand without names
    units_line: int | None
    data_line: int
    cells: tuple[str, ...]  # of the header, as they stand
    units: tuple[str, ...]  # of the row below; "" each where there is none
    separator: str
    decimal: str
    thousands: str
    head: frozenset[str]  # the lines above the numbers, which may be repeated further down
    is_labelled: bool = False  # each number has its column's name before it: angle:1.5

    @property
    def told(self) -> str:
        """What is unusual in it: "header in line 4, units in line 5, Windows-1252"."""
        unnamed = "a label before each number" if self.is_labelled else "no line of names, columns by number"
        parts = [unnamed] if self.header_line == 0 else []
        if self.header_line > 1:
            parts.append(f"header in line {self.header_line}")
        if self.units_line:
            parts.append(f"units in line {self.units_line}")
        if self.encoding != "utf-8":
            parts.append(ENCODINGS.get(self.encoding, self.encoding))
        if self.thousands:
            parts.append(f"thousands set off by {_SIGNS.get(self.thousands, 'blanks')}")
        return ", ".join(parts)


@dataclass(frozen=True)
class Head:
    """The first lines of a text as they stand, for a person to look at, and how they were understood."""

    lines: tuple[str, ...]
    encoding: str
    layout: Layout | None  # where a table is seen

    @property
    def told(self) -> str:
        """What was found: "header in line 4, units in line 5, Windows-1252"; "" where there is no table."""
        if self.layout is None:
            return ""
        return ", ".join(filter(None, ("header in line 1" if self.layout.header_line == 1 else "", self.layout.told)))


_SIGNS = {",": "commas", ".": "points", "'": "apostrophes"}


def encoding_of(path: str, head: bytes, said: str | None = None) -> tuple[str, int]:
    """The encoding, and the length of the mark that begins the text; InputError if it is no text in any."""
    for mark, name in _BOMS:
        if head.startswith(mark):
            return name, len(mark)
    if said:
        return said, 0
    pairs = len(head) // 2
    for name, zeros in (("utf-16-le", head[1::2].count(0)), ("utf-16-be", head[0::2].count(0))):
        if pairs > 8 and zeros > 0.7 * pairs:
            return name, 0
    try:
        text = codecs.getincrementaldecoder("utf-8")().decode(head, final=len(head) < HEAD_BYTES)
        name, strange = "utf-8", "\0" in text
    except UnicodeDecodeError:
        name, strange = "cp1252", bool(_CONTROL.search(head.decode("cp1252", "replace")))
    if strange:
        raise refusal(path, "is not text (neither UTF-8, UTF-16 nor Windows-1252); export it again as CSV")
    return name, 0


def known_encoding(text: str) -> str:
    """The name that Python has for an encoding; ValueError for none, or one that is no encoding of text."""
    try:
        found = codecs.lookup(text)
    except LookupError:
        raise ValueError(text) from None
    if not found._is_text_encoding:
        raise ValueError(text)
    return {"utf-8-sig": "utf-8", "utf-16": "utf-16-le"}.get(found.name, found.name)


def lines_of(path: str, said: str | None = None) -> tuple[list[str], str, int, bool]:
    """The first lines, the encoding, its mark's length, and whether the last line is cut."""
    with open(path, "rb") as file:
        head = file.read(HEAD_BYTES)
    encoding, mark = encoding_of(path, head, said)
    is_cut = len(head) == HEAD_BYTES
    text = codecs.getincrementaldecoder(encoding)("replace").decode(head[mark:], final=not is_cut)
    return re.split(r"\r\n|\r|\n", text), encoding, mark, is_cut


def read_head(path: str, hints: Hints) -> Head:
    """The first lines and their layout; InputError as `find_layout` raises it."""
    lines, encoding, _, is_cut = lines_of(path, hints.encoding)
    return Head(tuple(lines[:-1] if is_cut or not lines[-1] else lines), encoding, find_layout(path, hints))


def find_layout(path: str, hints: Hints) -> Layout | None:
    """The layout of a text whose table begins with names; None if no table is seen in its first lines.

    The header is the line of names with the most rows of numbers below it, the first of equals.  InputError for what
    is no text, for a said header without rows of numbers below it, and for a said encoding in which no table is seen.
    """
    lines, encoding, mark, is_cut = lines_of(path, hints.encoding)
    if is_cut:
        lines = lines[:-1]
    if hints.header_line is not None and not 0 < hints.header_line <= len(lines):
        raise refusal(path, f"has no line {hints.header_line} among its first; name another header line")
    tables = {separator: [split(line, separator) for line in lines] for separator in SEPARATORS}
    best = None
    for separators in (_SURE_SEPARATORS, " "):
        best = best or _best(tables, separators, hints.header_line)
        if best is None and hints.header_line is None:
            best = _without_names(tables, separators)
    if best is None:
        if hints.header_line is not None:
            found = shown(lines[hints.header_line - 1], 60)
            problem = f"no table begins there ({found!r}); name another header line"
            raise refusal(path, f"line {hints.header_line}: {problem}")
        if hints.encoding is not None:
            told = ENCODINGS.get(encoding, encoding)
            raise refusal(path, f"no table is seen in it as {told}; name another encoding")
        return _labelled(lines, encoding, mark)
    at, first, separator = best
    rows = tables[separator]
    units_at = next((i for i in range(at + 1, first) if is_units(rows[i])), None) if at >= 0 else None
    width = max(len(rows[max(at, 0)]), len(rows[first]))
    cells = [cell.strip() for cell in rows[at]] if at >= 0 else [by_number(i) for i in range(len(rows[first]))]
    if at >= 0:
        cells[0] = cells[0].lstrip("#% ")
        if all(cell.endswith(":") for cell in cells if cell):  # as Arduino's plotter takes them
            cells = [cell.rstrip(": ") for cell in cells]
    units = [cell.strip().strip("[]()") for cell in rows[units_at]] if units_at is not None else []
    sample = [cell.strip() for row in rows[first : first + 300] for cell in row]
    decimal, thousands = _signs(sample, separator)
    return Layout(
        encoding,
        mark > 0,
        at + 1,
        None if units_at is None else units_at + 1,
        first + 1,
        tuple(cells + [""] * (width - len(cells)))[:width],
        tuple((units + [""] * width)[:width]),
        separator,
        decimal,
        thousands,
        frozenset(line.strip() for line in lines[:first] if line.strip()),
    )


def by_number(i: int) -> str:
    """What a column without a name is called, by its place from 0."""
    return f"#{i + 1}"


def _best(
    tables: Mapping[str, Sequence[Sequence[str]]], separators: Iterable[str], said: int | None
) -> tuple[int, int, str] | None:
    """Line of names and of the first numbers, from 0, and separator, of the table with the most rows."""
    best: tuple[float, int, int, str] | None = None
    for separator in separators:
        rows = tables[separator]
        for at in range(len(rows)) if said is None else [said - 1]:
            if said is None and not _is_names(rows, at):
                continue
            first, score = _rows_below(rows, at)
            if score > 0.0 and (best is None or score > best[0]):
                best = score, at, first, separator
    return best[1:] if best else None


def _without_names(
    tables: Mapping[str, Sequence[Sequence[str]]], separators: Iterable[str]
) -> tuple[int, int, str] | None:
    """The same of a text that begins with numbers, but for blank lines and comments; -1 for the line of names."""
    for separator in separators:
        rows = tables[separator]
        first = next((i for i, row in enumerate(rows) if _is_content(row)), len(rows))
        below = rows[first : first + _LOOKED_AT]
        if len(below) > _FEWEST_ROWS and len(below[0]) > 1 and _are_numbers(below[0]):
            alike = [row for row in below if len(row) == len(below[0]) and _are_numbers(row)]
            if len(alike) >= _MOST_OF_ROWS * len(below):
                return -1, first, separator
    return None


def _labelled(lines: Sequence[str], encoding: str, mark: int) -> Layout | None:
    """The layout of lines that Arduino's plotter takes, of labels and values: angle:1.5,speed:3.2; None for others.

    By arduino/Arduino, build/shared/ArduinoSerialPlotterProtocol.md: tabs, commas or blanks part the pairs.
    """
    first = next((i for i, line in enumerate(lines) if line.strip()), len(lines))
    for separator in "\t, ":
        rows = [_pairs(line, separator) for line in lines[first : first + _LOOKED_AT] if line.strip()]
        if len(rows) <= _FEWEST_ROWS or len(rows[0]) < 2 or len(set(rows[0])) < len(rows[0]):
            continue
        if sum(row == rows[0] for row in rows) >= _MOST_OF_ROWS * len(rows):
            names, units = tuple(rows[0]), ("",) * len(rows[0])
            return Layout(
                encoding, mark > 0, 0, None, first + 1, names, units, separator, ".", "", frozenset(), is_labelled=True
            )
    return None


def _pairs(line: str, separator: str) -> list[str]:
    """The labels of a line of labels and values; nothing where one of its parts is no such pair."""
    parts = [part for part in line.strip(f"{separator} \t").split(separator) if part.strip()]
    found = [_PAIR.fullmatch(part.strip()) for part in parts]
    return [pair[1] for pair in found if pair] if all(found) else []


def _is_content(row: Sequence[str]) -> bool:
    return any(cell.strip() for cell in row) and not row[0].lstrip().startswith(tuple(_COMMENTS))


def _are_numbers(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell.strip()]
    return bool(filled) and all(is_number(cell) or is_stamp(cell) for cell in filled)


def split(line: str, separator: str) -> list[str]:
    """A line's cells; several blanks between two are one."""
    if separator == " ":
        line = re.sub(r"\s+", " ", line).strip()
        if line.startswith(tuple(_COMMENTS)):
            line = line.lstrip(f"{_COMMENTS} ")
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def is_number(cell: str) -> bool:
    """Whether it is a number in any country's writing."""
    return _NUMBER.fullmatch(cell.strip()) is not None


def is_units(row: Sequence[str]) -> bool:
    """Whether the cells of a row are units, as far as they are filled."""
    cells = [cell.strip().strip("[]()") for cell in row if cell.strip()]
    return bool(cells) and sum(map(_is_unit, cells)) > 0.5 * len(cells) and not all(cell in "1-" for cell in cells)


@lru_cache(1000)
def _is_unit(text: str) -> bool:
    return text.lower() in _UNIT_WORDS or (len(text) <= 24 and bool(dimensions_of(text)))


def _is_names(rows: Sequence[Sequence[str]], at: int) -> bool:
    """Whether a line may hold the columns' names: no numbers, unless the next line holds their units."""
    row = rows[at]
    filled = [cell for cell in row if cell.strip()]
    if len(row) < 2 or 2 * len(filled) < len(row) or is_number(filled[0]):
        return False
    if is_units(row) and at > 0 and len(rows[at - 1]) == len(row) and not is_units(rows[at - 1]):
        return False  # those of the names above it
    if any(is_number(cell) or is_stamp(cell) for cell in filled):
        below = rows[at + 1] if at + 1 < len(rows) else []
        return len(below) == len(row) and is_units(below)
    return True


def _rows_below(rows: Sequence[Sequence[str]], at: int) -> tuple[int, float]:
    """The first row of numbers below a header, and how much of a table follows: rows, by the share of numbers."""
    width = len(rows[at])
    first = next((i for i in range(at + 1, min(at + 2 + _MOST_BETWEEN, len(rows))) if _is_data(rows[i], width)), None)
    if first is None:
        return 0, 0.0
    seen = filled = numbers = 0
    for row in rows[first : first + _LOOKED_AT]:
        if not any(cell.strip() for cell in row):
            continue
        if not _is_data(row, width):
            break
        seen += 1
        filled += sum(bool(cell.strip()) for cell in row)
        numbers += sum(is_number(cell) or is_stamp(cell) for cell in row)
    return first, seen * numbers / filled if seen >= _FEWEST_ROWS else 0.0


def _is_data(row: Sequence[str], width: int) -> bool:
    extra = len(row) - width
    if extra not in (0, 1) or (extra == 1 and row[-1].strip()):
        return False
    return any(is_number(cell) for cell in row)


def _signs(cells: Sequence[str], separator: str) -> tuple[str, str]:
    """The decimal sign, and what sets thousands off."""
    numbers = [cell for cell in cells if _NUMBER.fullmatch(cell)]
    blanks = next((sign for cell in numbers if _THOUSANDS.fullmatch(cell) for sign in cell if sign in _BLANKS), "")
    with_comma = any("," in cell for cell in numbers)
    both = next((cell for cell in numbers if "," in cell and "." in cell), "")
    if both:
        decimal = max(".,", key=both.rfind)
        return decimal, "," if decimal == "." else "."
    if any(cell.count(".") > 1 for cell in numbers):
        return ",", "."
    if any(cell.count(",") > 1 for cell in numbers):
        return ".", ","
    if separator == "," or not with_comma:
        return ".", "," if with_comma else blanks
    return ",", "." if any("." in cell for cell in numbers) else blanks
