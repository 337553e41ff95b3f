"""What a file's columns must fulfil before they become a measurement, and a measurement before it is used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError, quoted
from ema_model.files.limits import COLUMNS, RUNS
from ema_model.files.refusal import listed, refusal, shown
from ema_model.quantities.signals import SIGNALS, lookalikes, looks_like_time
from ema_model.recordings.columns.mapping import ColumnMapping
from ema_model.recordings.measurement import Measurement

Array = NDArray[np.float64]
Place = Callable[[int], str]

FEWEST_SAMPLES = 100
LARGEST = 1e30  # absolute value, in any unit
_SHORTEST_STEP_S = 1e-12
_LONGEST_NAME = 1_000  # characters
_NONE = ColumnMapping()


class TooShort(InputError):
    """A recording has fewer samples than a fit can use; one of several can be left out for that."""


def choose_columns(
    path: str,
    header: Sequence[str],
    mapping: ColumnMapping = _NONE,
    *,
    needs_time: bool = True,
    looked_at: bool = False,
) -> tuple[list[str], list[str]]:
    """The columns of a header to read, canonical or mapped, and the foreign ones to be left aside.

    Raises InputError if a name stands twice, the time is missing, or a foreign name looks like a canonical
    one that is missing; the last is no matter once columns are mapped, or somebody has looked at them.
    """
    check_names(path, header)
    mapped = {entry.column for entry in mapping.entries}
    signals = {entry.signal for entry in mapping.entries}
    known = [name for name in header if name in mapped or (name in SIGNALS and name not in signals)]
    foreign = [name for name in header if name not in known]
    if needs_time and "time_s" not in signals and ("time_s" not in known or "time_s" in mapped):
        hints = [shown(name) for name in foreign if looks_like_time(name)]
        advice = "name the column of time, in seconds, time_s"
        if hints:
            advice = f"{hints[0]!r} looks like time: in seconds, name it time_s, or map it: --map 'time_s={hints[0]}'"
        raise refusal(path, f"no column time_s; {advice} (present: {listed(header)})")
    if not known:
        raise refusal(path, f"no column has a known name; map them with --map (present: {listed(header)})")
    for name in foreign if not mapping.entries and not looked_at else ():
        candidates = lookalikes(name)
        if candidates and not set(candidates) & set(known):
            meant = " or ".join(candidates)
            advice = "if it is that, map it, or convert it to the unit and rename it"
            raise refusal(path, f"column {shown(name)!r} looks like {meant}; {advice}; otherwise rename or remove it")
    return known, foreign


def check_names(path: str, header: Sequence[str]) -> None:
    """Raises InputError if there are too many names, one is too long, or stands twice."""
    if len(header) > COLUMNS:
        raise refusal(path, f"has {len(header)} columns, over the limit of {COLUMNS}; keep fewer columns")
    longest = max(map(len, header), default=0)
    if longest > _LONGEST_NAME:
        raise refusal(path, f"a column's name has {longest} characters, over the limit of {_LONGEST_NAME}; shorten it")
    twice = [name for name, count in Counter(header).items() if count > 1 and name]
    if twice:
        raise refusal(path, f"column {shown(twice[0])!r} stands twice in the header; rename or remove one")


def check_values(path: str, arrays: Mapping[str, Array], place: Place) -> None:
    """Raises InputError for values that no sensor gives, states that are not whole and time that does not increase.

    `arrays` are columns of one length with `time_s`; `place` says where a sample stands in the file.
    """
    check_finite(path, arrays, place)
    for name in ("segment", "drive_enabled"):
        if name in arrays:
            values = arrays[name]
            whole = (values == np.round(values)) if name == "segment" else (values == 0.0) | (values == 1.0)
            expected = "a whole number" if name == "segment" else "0 or 1"
            for row in np.flatnonzero(~whole)[:1]:
                raise refusal(
                    path, f"{place(row)}, column {quoted(name)!r}: {expected} is expected, found {values[row]:g}"
                )
    if "segment" in arrays and (runs := np.count_nonzero(np.diff(arrays["segment"])) + 1) > RUNS:
        found = f"column 'segment' tells {runs} runs apart, over the limit of {RUNS}"
        raise refusal(path, f"{found}; correct it, or split the file")
    time = arrays["time_s"]
    wrong = np.diff(time) < _SHORTEST_STEP_S
    if "segment" in arrays:
        wrong &= np.diff(arrays["segment"]) == 0.0
    for row in np.flatnonzero(wrong)[:1] + 1:
        problem = f"{time[row]!s} follows {time[row - 1]!s}, but time must increase"
        advice = "sort or remove the row, or number the runs in a column segment"
        raise refusal(path, f"{place(row)}, column 'time_s': {problem}; {advice}")


def check_finite(path: str, arrays: Mapping[str, Array], place: Place) -> None:
    """Raises InputError for the first NaN, infinite or absurd value, column by column.

    No quantity is that large; loggers write such numbers for a missing one, and their squares overflow.
    """
    for name, values in arrays.items():
        for row in np.flatnonzero(~(np.abs(values) <= LARGEST))[:1]:
            value = values[row]
            found = "NaN" if np.isnan(value) else "an infinite value" if np.isinf(value) else f"{value:.3g}"
            expected = "a finite number is expected" if not np.isfinite(value) else "no quantity is that large"
            problem = f"{found}; {expected}, correct it or remove the row"
            raise refusal(path, f"{place(row)}, column {quoted(name)!r}: {problem}")


def check_length(path: str, samples: int) -> None:
    """Raises TooShort for fewer samples than a fit can use."""
    if samples < FEWEST_SAMPLES:
        found = f"{samples} sample{'s' * (samples != 1)}"
        line = refusal(path, f"has {found}; {FEWEST_SAMPLES} or more are expected, record for longer or faster")
        raise TooShort(str(line))


def check_needed(measurement: Measurement, *names: str) -> None:
    """Raises InputError if a signal that an analysis needs is missing, empty or constant."""
    measurement.require(*names)
    for name in names:
        values = measurement[name]
        if not values.size or np.all(values == values[0]):
            value = f"is constant ({values[0]:g})" if values.size else "is empty"
            where = f"{quoted(measurement.name)}: " if measurement.name else ""
            column = quoted(measurement.shown(name))
            raise InputError(f"{where}column {column!r} {value}, but it must vary here; record it while the axis moves")
