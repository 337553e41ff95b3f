"""What a file's columns must fulfil before they become a measurement, and a measurement before it is used."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ema_model.errors import InputError
from ema_model.measurement.measurement import Measurement
from ema_model.measurement.refusal import listed, refusal, shown
from ema_model.measurement.signals import SIGNALS, lookalikes, looks_like_time

Array = NDArray[np.float64]
Place = Callable[[int], str]

FEWEST_SAMPLES = 100


def choose_columns(path: str, header: Sequence[str]) -> tuple[list[str], list[str]]:
    """The canonical columns of a header, and the foreign ones to be left aside.

    Raises InputError if a name stands twice, the time is missing, or a foreign name looks like a canonical
    one that is missing.
    """
    twice = [name for name, count in Counter(header).items() if count > 1 and name]
    if twice:
        raise refusal(path, f"column {shown(twice[0])!r} stands twice in the header; rename or remove one")
    known = [name for name in header if name in SIGNALS]
    foreign = [name for name in header if name not in SIGNALS]
    if "time_s" not in known:
        hints = [f"{shown(name)!r} looks like time: in seconds," for name in foreign if looks_like_time(name)]
        advice = f"{hints[0]} name it time_s" if hints else "name the column of time, in seconds, time_s"
        raise refusal(path, f"no column time_s; {advice} (present: {listed(header)})")
    for name in foreign:
        candidates = lookalikes(name)
        if candidates and not set(candidates) & set(known):
            meant = " or ".join(candidates)
            advice = f"if it is that, convert it to the unit and rename it {meant}; otherwise rename or remove it"
            raise refusal(path, f"column {shown(name)!r} looks like {meant}; {advice}")
    return known, foreign


def check_values(path: str, arrays: Mapping[str, Array], place: Place) -> None:
    """Raises InputError for values that are not finite, states that are not whole and time that does not increase.

    `arrays` are columns of one length with `time_s`; `place` says where a sample stands in the file.
    """
    check_finite(path, arrays, place)
    for name in ("segment", "drive_enabled"):
        if name in arrays:
            values = arrays[name]
            whole = (values == np.round(values)) if name == "segment" else (values == 0.0) | (values == 1.0)
            expected = "a whole number" if name == "segment" else "0 or 1"
            for row in np.flatnonzero(~whole)[:1]:
                raise refusal(path, f"{place(row)}, column {name!r}: {expected} is expected, found {values[row]:g}")
    time = arrays["time_s"]
    wrong = np.diff(time) <= 0.0
    if "segment" in arrays:
        wrong &= np.diff(arrays["segment"]) == 0.0
    for row in np.flatnonzero(wrong)[:1] + 1:
        problem = f"{time[row]!s} follows {time[row - 1]!s}, but time must increase"
        advice = "sort or remove the row, or number the runs in a column segment"
        raise refusal(path, f"{place(row)}, column 'time_s': {problem}; {advice}")


def check_finite(path: str, arrays: Mapping[str, Array], place: Place) -> None:
    """Raises InputError for the first NaN or infinite value, column by column."""
    for name, values in arrays.items():
        for row in np.flatnonzero(~np.isfinite(values))[:1]:
            found = "NaN" if np.isnan(values[row]) else "an infinite value"
            problem = f"{found}; a finite number is expected, correct it or remove the row"
            raise refusal(path, f"{place(row)}, column {name!r}: {problem}")


def check_length(path: str, samples: int) -> None:
    """Raises InputError for fewer samples than a fit can use."""
    if samples < FEWEST_SAMPLES:
        found = f"{samples} sample{'s' * (samples != 1)}"
        raise refusal(path, f"has {found}; {FEWEST_SAMPLES} or more are expected, record for longer or faster")


def check_needed(measurement: Measurement, *names: str) -> None:
    """Raises InputError if a signal that an analysis needs is missing, empty or constant."""
    measurement.require(*names)
    for name in names:
        values = measurement[name]
        if not values.size or np.all(values == values[0]):
            value = f"is constant ({values[0]:g})" if values.size else "is empty"
            where = f"{measurement.name}: " if measurement.name else ""
            raise InputError(f"{where}column {name!r} {value}, but it must vary here; record it while the axis moves")
