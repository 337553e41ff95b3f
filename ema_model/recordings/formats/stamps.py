"""Date and time as loggers write them, as seconds since the first."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
from numpy.typing import NDArray

from ema_model.recordings.formats.arrow import as_numpy

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
