"""The one way in and out: a file, its columns, units and checks, as a measurement; and a measurement as a file."""

from __future__ import annotations

import os
import shlex
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.actuator.actuator import CURRENT_INPUTS, VOLTAGE_INPUTS
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.files.opened import COLUMNS, FILE_BYTES, RUNS, check_user_file, listed, megabytes, reason, refusal, shown
from ema_model.files.written import whole_file
from ema_model.quantities import SIGNALS, lookalikes, looks_like_time
from ema_model.recordings.column_mapping import (
    ColumnMapping,
    MappedColumn,
    Reading,
    apply_mapping,
    doubt,
    guess_mapping,
    parse_mapping,
    unit_in_name,
    with_places,
    without_unit,
)
from ema_model.recordings.column_names import known_export
from ema_model.recordings.formats import WRITTEN, Format, format_of
from ema_model.recordings.formats.format import Clocks
from ema_model.recordings.formats.text_layout import Head, Hints, by_number
from ema_model.recordings.measurement import (
    ALONG_A_MAP,
    PHASES,
    Measurement,
    along_map,
    unwrapped,
    with_current,
    with_motor_side,
    with_third_phase,
    without_delays,
)
from ema_model.recordings.side_file import SideFile, find_side_file, read_side_file

# --- a file of any format as columns, and as a measurement once it is known which column is which signal --------------
# `ema_model.recordings.read` is the way in; this is what it is built on.

Array = NDArray[np.float64]
NONE = Hints()


def read_measurement(
    path: str | os.PathLike[str],
    mapping: ColumnMapping | Sequence[str] | None = None,
    *,
    side: SideFile | None = None,
    max_bytes: int = FILE_BYTES,
    hints: Hints = NONE,
) -> Measurement:
    """The measurement in a file, its name the file's stem, its notes what was found and left aside.

    `mapping`, or texts as of `--map`, says which columns are which signals; columns with canonical names
    need none.  `side` is what else is known; without it the file's side file is read, or its folder's, if there
    is one, and its mapping, window and segments are used.  A given mapping's entries go before the side file's.
    Raises InputError, one line with the file, the place in it and what to do, for whatever is wrong with the
    file; `max_bytes` bounds its size, on the disk and in memory.
    """
    path = os.fspath(path)
    check_file(path, max_bytes)
    notes = []
    if side is None:
        found = find_side_file(path)
        side = read_side_file(found) if found else SideFile()
        if found:
            notes.append(f"the side file {shown(found.name, 100)} is used")
    file_format = said_format(path, hints_of(path, side, hints))
    with _told(path):
        header = file_format.header(path, max_bytes)
        used = _merged(path, side, mapping, header)
        rate = _rate(path, hints_of(path, side, hints), used, header)
        known, foreign = choose_columns(
            path,
            header,
            used,
            needs_time=side.kind == "run" and rate is None,
            looked_at=isinstance(mapping, ColumnMapping),
        )
        columns = file_format.read(path, known, max_bytes, True)
        check_length(path, next(iter(columns.arrays.values())).size, side.kind)
        check_finite(path, columns.arrays, columns.place)
        signals, done = apply_mapping(columns.arrays, used)
        columns.arrays.clear()  # they are copied, and large; Arrow would keep their memory for later
        pa.default_memory_pool().release_unused()
    if rate is not None:
        signals = {"time_s": np.arange(float(next(iter(signals.values())).size)) / rate, **signals}
        done = (*done, f"time_s counts the samples at {rate:.6g} Hz, as was said")
    elif side.kind == "map" and "time_s" not in signals:
        signals = {"time_s": np.arange(float(next(iter(signals.values())).size)), **signals}
        done = (*done, "a static map without time: time_s counts the samples")
    check_values(path, signals, columns.place)
    told = (*([columns.layout] if columns.layout else []), *columns.notes, *notes, *done)
    bare = _measurement(path, signals, told, foreign, side)
    name = " ".join(filter(None, (bare.name, columns.title)))
    clocks = columns.clocks and _of_signals(columns.clocks, used)
    measurement = replace(bare, name=name, reading=Reading(clocks=clocks, layout=columns.layout))
    measurement = without_delays(unwrapped(path, measurement, used), used)
    check_length(path, measurement.samples, side.kind)
    if side.window_s is not None or side.segments is not None:
        try:
            measurement = measurement.selected(side.window_s, side.segments)
        except InputError as error:
            raise refusal(path, str(error).removeprefix(f"{shown(measurement.name, 100)}: ")) from None
        check_length(path, measurement.samples, side.kind)
    return measurement


def read_header(path: str, max_bytes: int, hints: Hints = NONE) -> list[str]:
    """The columns' names in the file's order; InputError for a file that cannot be read as a table."""
    check_file(path, max_bytes)
    with _told(path):
        return said_format(path, hints).header(path, max_bytes)


def read_head(path: str | os.PathLike[str], *, max_bytes: int = FILE_BYTES, hints: Hints = NONE) -> Head | None:
    """The first lines of a text and the layout found in them, for a person to look at; None for another format.

    Raises InputError for what is no text, and for hints that do not fit it.
    """
    path = os.fspath(path)
    check_file(path, max_bytes)
    with _told(path):
        head = said_format(path, hints).head
        return head(path, max_bytes) if head is not None else None


def read_columns(path: str | os.PathLike[str], *, max_bytes: int = FILE_BYTES, hints: Hints = NONE) -> dict[str, Array]:
    """The columns of numbers as they stand in the file, for a mapping step to show; others are left out.

    Raises InputError for a file that cannot be read as a table at all; the values are not checked.
    """
    path = os.fspath(path)
    check_file(path, max_bytes)
    file_format = said_format(path, hints)
    with _told(path):
        names = [name for name in file_format.header(path, max_bytes) if name]
        check_names(path, names)
        if not names:
            raise refusal(path, "has no columns")
        # What is wrong with all of them is told as for a measurement.
        return (
            file_format.read(path, names, max_bytes, False).arrays
            or file_format.read(path, names, max_bytes, True).arrays
        )


def hints_of(path: str, side: SideFile, given: Hints = NONE) -> Hints:
    """What is said of a file's layout: as given, then as in the side file, which may stand beside other formats too."""
    if format_of(path).hinted is None:
        return given.before(Hints(rate_Hz=side.text.rate_Hz))
    return given.before(side.text)


def _rate(path: str, hints: Hints, mapping: ColumnMapping, header: Sequence[str]) -> float | None:
    """The rate that was said, Hz; InputError where the file has a time."""
    rate = hints.rate_Hz
    if rate is None:
        return None
    time = mapping.get("time_s") or ("time_s" in header and MappedColumn("time_s", "time_s"))
    if time:
        raise refusal(path, f"time_s stands in column {shown(time.column)!r}; leave the rate out, or that column")
    if not 0.0 < rate <= _MOST_HZ:
        raise refusal(path, f"the rate must be a number of samples a second, not {rate:g}")
    return rate


def said_format(path: str, hints: Hints) -> Format:
    """The file's format, reading it as somebody has said that it is laid out; InputError where it is no text."""
    found = format_of(path)
    if not hints.is_of_text:
        return found
    if found.hinted is None:
        raise refusal(path, f"is {found.title}, no text; leave --header-line and --encoding out")
    return found.hinted(hints)


@contextmanager
def _told(path: str) -> Iterator[None]:
    """What the system cannot do becomes an InputError."""
    try:
        yield
    except OSError as error:
        raise refusal(path, f"cannot be read ({reason(error)}); check the disk and the permissions") from None
    except MemoryError:
        raise refusal(path, "does not fit into memory; split it, or keep fewer columns") from None


def _merged(
    path: str, side: SideFile, given: ColumnMapping | Sequence[str] | None, header: Sequence[str]
) -> ColumnMapping:
    """The mapping to use, given entries before the side file's; InputError if a column is missing."""
    if isinstance(given, str):
        given = [given]
    if given is not None and not isinstance(given, ColumnMapping):
        given = parse_mapping(given, header)
    merged = with_places(side.mapping or ColumnMapping(), header)
    for entry in with_places(given, header).entries if given else ():
        merged = merged.with_entry(entry)
    for entry in merged.entries:
        if entry.column not in header:
            by_side = side.mapping is not None and entry in side.mapping.entries and side.path
            asker = f", which {shown(Path(side.path).name, 100)} asks for" if by_side and side.path else ""
            missing = f"no column {shown(entry.column)!r} for {entry.signal}{asker}"
            meant = did_you_mean(entry.column, header)
            raise refusal(path, f"{missing}; correct the mapping (present: {listed(header)}){meant}")
    return merged


def _of_signals(clocks: Clocks, mapping: ColumnMapping) -> Clocks:
    mapped = {entry.column for entry in mapping.entries}
    of = {name: clock for name, clock in clocks.of.items() if name not in mapped}
    of |= {entry.signal: clocks.of[entry.column] for entry in mapping.entries if entry.column in clocks.of}
    return replace(clocks, of=of)


def check_file(path: str, max_bytes: int) -> None:
    """Raises InputError for what is no file, an empty or too large a one."""
    status = check_user_file(path, "the file of a measurement")
    if status.st_size == 0:
        raise refusal(path, "is empty; a measurement of 100 samples or more is expected")
    if status.st_size > max_bytes:
        size = f"is {megabytes(status.st_size)} large, over the limit of {megabytes(max_bytes)}"
        raise refusal(path, f"{size}; split it, or record fewer samples")


def _measurement(
    path: str, signals: dict[str, Array], notes: Sequence[str], foreign: Sequence[str], side: SideFile
) -> Measurement:
    for values in signals.values():
        values.flags.writeable = False  # ours alone, so that it need not be copied
    notes = list(notes)
    named = [name for name in foreign if name]
    if named:
        notes.append(f"left aside, as their names are not known: {listed(named)}")
    bare = Measurement(signals)
    if not bare.is_uniform:
        off = f"samples lie up to {100.0 * bare.jitter:.3g} % of a period off a regular grid"
        notes.append(f"{off}; the median step is {bare.sample_period_s:.6g} s")
    return Measurement(bare.signals, Path(path).stem, tuple(notes), side)


# --- what a file's columns must fulfil before they become a measurement, and a measurement before it is used ----------

Place = Callable[[int], str]

FEWEST_SAMPLES = 100
FEWEST_ROWS = 12  # of a static map
_LONGER = "record for longer or faster"
_MOST_HZ = 1e9
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
        if header and header[0] == by_number(0):
            problem = "line 1: names of columns are expected, found numbers; add a header line, or say which column"
            raise refusal(path, f"{problem} is which by its number: --map 'time_s=#1' (it has {listed(header)})")
        advice = "name the column of time, in seconds, time_s"
        if hints:
            advice = f"{hints[0]!r} looks like time: in seconds, name it time_s, or map it: --map 'time_s={hints[0]}'"
        advice += ", or give the --rate of a file without one"
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


def check_length(path: str, samples: int, kind: str = "run") -> None:
    """Raises TooShort for fewer samples than a fit can use; kind: of the recording, as in side files."""
    fewest, advice = (FEWEST_ROWS, "measure at more points") if kind == "map" else (FEWEST_SAMPLES, _LONGER)
    if samples < fewest:
        found = f"{samples} sample{'s' * (samples != 1)}"
        line = refusal(path, f"has {found}; {fewest} or more are expected, {advice}")
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


# --- a measurement as the model needs it: under the names inside, with an equivalent current --------------------------


def prepared(measurement: Measurement, actuator: Actuator) -> Measurement:
    """The measurement with the signals' rotary names, which the model has, and a current from its phase currents.

    One that is so already stays as it is.  Raises InputError for one that was prepared for other axes: the signals
    of the axes that it was read for are all that it has left.
    """
    if measurement.axes is not None:
        if measurement.axes != actuator.axes:
            raise InputError(f"{measurement.name}: it was read for an actuator with other axes; read it for this one")
        return measurement
    axes = actuator.axes
    others = axes.of_other_axes(measurement)
    inside = replace(measurement, signals=axes.inside(measurement.signals), axes=axes, of_other_axes=others)
    if others:
        inside = inside.with_notes(f"left aside, as the actuator's axes are of another kind: {listed(others)}")
    known = along_map(_with_other_side(inside, actuator))
    made = with_current(known, actuator.motor.pole_pairs, actuator.motor.rotor_offset_rad)
    if made is inside:
        return made
    names = tuple(name for name in made if name not in inside)
    # That three phase currents make the current goes without saying; what else was made is said.
    remarks = (*made.reading.remarks, *known.notes[len(inside.notes) :])
    return replace(made, reading=replace(made.reading, made=names, remarks=remarks))


def _with_other_side(inside: Measurement, actuator: Actuator) -> Measurement:
    """What the actuator's model needs and was not recorded, of what was: the motor's motion, and the third phase."""
    ratio, between = actuator.transmission.gear_ratio, _between(actuator)
    needs_current = "current_A" not in inside and sum(name in inside for name in PHASES) > 1
    if actuator.controller.kind == "unknown" or inside.is_map or needs_current:
        made = with_motor_side(inside, ratio, between)
    else:  # a loop has the user's position, which the motor's would only repeat; its speed tells more
        made = inside if between else with_motor_side(inside, ratio, speed_only=True)
    return with_third_phase(made) if needs_current else made


def _between(actuator: Actuator) -> list[str]:
    """What lies between the motor and the user in an actuator's model, by the names in its file."""
    play = ["transmission.backlash_rad"] if actuator.transmission.backlash_rad > 0.0 else []
    return [*play, *(name for name in _BETWEEN if name in actuator.effects)]


# --- the one door: any file of a known actuator becomes the measurement as the model needs it -------------------------
# Which column is which signal is said by hand, else by the file's side file, else by the actuator's file; canonical
# names speak for themselves, and what is then still open is guessed. A guess that is not sure is asked about.

Needs = Sequence[Sequence[str]]  # of each group one signal, the first that there is; names inside
COMMAND_ALONE: Needs = (("time_s",), ("command_rad",))
INPUT_ALONE: Needs = (("time_s",), CURRENT_INPUTS)
VOLTAGE_ALONE: Needs = (("time_s",), VOLTAGE_INPUTS)
WITHOUT_COMMAND = (  # the end of a line that asks for one
    "where no command was recorded, add --open-loop to compare or discover, "
    'or choose an actuator with [controller] kind = "unknown"'
)
_BETWEEN = ("torsional_compliance", "screw_lead_error")  # effects that part the user's motion from the motor's
_POSITIONS = ("motor_position_rad", "user_position_rad")
_MOTION = ("motor_position_rad", "user_position_rad", "motor_speed_rad_s")


def read(
    path: str | os.PathLike[str],
    actuator: Actuator,
    mapping: ColumnMapping | Sequence[str] = (),
    *,
    side: SideFile | None = None,
    needs: Needs | None = None,
    max_bytes: int = FILE_BYTES,
    hints: Hints = NONE,
) -> Measurement:
    """A recording for the model of this actuator: in SI, under the names inside, with a current where one can be made.

    `mapping`, or texts as of `--map`, goes before what the side file says.  `side` is the side file, where it is
    known already.  `hints` say how a text is laid out that is read wrongly without, and go before the side file's.
    `needs` are the signals that must be there, and sure, when columns have to be guessed; without it what the
    actuator's model needs.  The measurement's `reading` tells how it was read.  Raises InputError, one line, for
    whatever is wrong with the file, and for columns that are not clear: it lists them, with the `--map` to give.
    """
    return prepared(
        recorded(path, actuator, mapping, side=side, needs=needs, max_bytes=max_bytes, hints=hints), actuator
    )


def recorded(
    path: str | os.PathLike[str],
    actuator: Actuator,
    mapping: ColumnMapping | Sequence[str] = (),
    *,
    side: SideFile | None = None,
    needs: Needs | None = None,
    max_bytes: int = FILE_BYTES,
    hints: Hints = NONE,
) -> Measurement:
    """The first half of `read`: under the names of files, so that `prepared` makes it fit any actuator."""
    path = os.fspath(path)
    side = _side_file(path, actuator, side, max_bytes)
    hints = hints_of(path, side, hints)
    reading = how_to_read(path, actuator, mapping, side=side, max_bytes=max_bytes, hints=hints)
    if needs is None:
        needs = needed(actuator, is_map=side.kind == "map")
    if hints.rate_Hz:
        needs = [group for group in needs if "time_s" not in group]
    _ask(path, actuator, reading, read_header(path, max_bytes, hints), needs)
    measurement = read_measurement(path, reading.mapping, side=side, max_bytes=max_bytes, hints=hints)
    found = measurement.reading
    remarks = (*reading.remarks, *found.remarks)
    return replace(measurement, reading=replace(reading, clocks=found.clocks, layout=found.layout, remarks=remarks))


def how_to_read(
    path: str | os.PathLike[str],
    actuator: Actuator,
    mapping: ColumnMapping | Sequence[str] = (),
    *,
    side: SideFile | None = None,
    columns: Mapping[str, NDArray[np.float64]] | None = None,
    max_bytes: int = FILE_BYTES,
    hints: Hints = NONE,
) -> Reading:
    """What `read` takes which column for; `columns` are the file's, where they are read already."""
    path = os.fspath(path)
    side = _side_file(path, actuator, side, max_bytes)
    hints = hints_of(path, side, hints)
    header = read_header(path, max_bytes, hints)
    given = with_places(mapping, header) if isinstance(mapping, ColumnMapping) else parse_mapping(mapping, header)
    by_side = side.mapping is not None and bool(side.mapping.entries)
    known = with_places(side.mapping, header) if by_side and side.mapping else _usual(actuator, header)
    of_actuator = bool(known.entries) and not by_side
    for entry in given.entries:
        known = known.with_entry(entry)
    settled = {entry.column for entry in known.entries} | {"", *SIGNALS}
    if "duty" not in {entry.signal for entry in known.entries}:
        settled -= {"duty"}  # whose name says no scale
    there = _there(actuator, known, header) | ({"time_s"} if hints.rate_Hz else set())
    needs = needed(actuator, is_map=side.kind == "map")
    missing = {name for group in needs if there.isdisjoint(group) for name in group}
    if by_side or (of_actuator and not missing) or settled.issuperset(header):
        return Reading(known)  # somebody has looked at these columns
    guess = guess_mapping(
        read_columns(path, max_bytes=max_bytes, hints=hints) if columns is None else columns, known=known
    )
    fresh = [entry for entry in guess.entries if entry.column not in settled]
    fresh = [entry for entry in fresh if entry.column != entry.signal or entry.unit]
    if hints.rate_Hz:  # whatever looks like a time is none
        fresh = [entry for entry in fresh if entry.signal != "time_s"]
    if of_actuator:  # its file says what matters in its recordings, so that only what is needed is sought beside
        sought = {*missing, "duty"} if "duty" in header else missing
        fresh = [entry for entry in fresh if actuator.axes.inside({entry.signal: 0}).keys() & sought]
    doubts = tuple((entry, why) for entry in fresh if (why := doubt(entry)))
    sure = tuple(entry for entry in fresh if not doubt(entry))
    export = known_export(header)
    remarks = (export.sentence,) if export is not None and export.names else ()
    return Reading(ColumnMapping((*known.entries, *sure), guess.unmapped), sure, doubts, remarks=remarks)


def signals_in(
    path: str | os.PathLike[str], actuator: Actuator, mapping: Sequence[str] = (), *, hints: Hints = NONE
) -> set[str]:
    """The signals, by their names inside, that a file has or can be given, as `read` would take its columns."""
    path = os.fspath(path)
    hints = hints_of(path, _side_file(path, actuator, None, FILE_BYTES), hints)
    reading = how_to_read(path, actuator, mapping, hints=hints)
    entries = ColumnMapping((*reading.mapping.entries, *(entry for entry, _ in reading.doubts)))
    return _there(actuator, entries, read_header(path, FILE_BYTES, hints))


def needed(actuator: Actuator, *, is_map: bool = False) -> Needs:
    """The groups of signals of each of which the actuator's model needs one; names inside."""
    if is_map:
        return (ALONG_A_MAP, ("current_A", "motor_torque_Nm"))
    if actuator.controller.kind == "unknown":
        return (("time_s",), _POSITIONS, ("current_A", "motor_torque_Nm"))
    if actuator.controller.kind == "open":
        return (*VOLTAGE_ALONE, ("current_A", *_MOTION)) if actuator.takes_voltage else (*INPUT_ALONE, _MOTION)
    return (*COMMAND_ALONE, ("current_A", *_MOTION))


def check_same_actuator(measurements: Sequence[Measurement]) -> None:
    """Raises InputError if maps and runs are mixed, which no one model can be held against at once."""
    if len({measurement.is_map for measurement in measurements}) > 1:
        raise InputError("static maps and runs cannot be compared together; compare them one after the other")


def _side_file(path: str, actuator: Actuator, side: SideFile | None, max_bytes: int) -> SideFile:
    """What is known beside the columns: the side file's, else the actuator's rules for a file of that name."""
    check_file(path, max_bytes)
    if side is None:
        beside = find_side_file(path)
        side = read_side_file(beside) if beside else SideFile()
    is_map = any(rule.kind == "map" for rule in actuator.rules_for(Path(path).stem))
    return replace(side, kind="map") if is_map and not side.path else side


def _usual(actuator: Actuator, columns: Sequence[str]) -> ColumnMapping:
    """The part of the actuator's mapping that these columns are in."""
    usual = parse_mapping(actuator.mapping, columns)
    return ColumnMapping(tuple(entry for entry in usual.entries if entry.column in columns))


def _there(actuator: Actuator, mapping: ColumnMapping, header: Collection[str]) -> set[str]:
    """The signals, by their names inside, that a file so mapped has or can be given."""
    names = {entry.signal for entry in mapping.entries} | {name for name in header if name in SIGNALS}
    inside = set(actuator.axes.inside(dict.fromkeys(names)))
    has_current = inside.issuperset(_made_into_current(inside))
    return inside | ({"current_A"} if has_current else set())


def _made_into_current(known: Collection[str]) -> list[str]:
    """The signals that a current is made of: two phases of those that there are, or three, and a position."""
    phases = [name for name in PHASES if name in known]
    position = next((name for name in _POSITIONS if name in known), _POSITIONS[0])
    return [*(phases if len(phases) > 1 else PHASES), position]


def _ask(path: str, actuator: Actuator, reading: Reading, header: Sequence[str], needs: Needs) -> None:
    """Raises InputError where what is needed stands in no column, or in one that is not sure."""
    if not reading.is_guess:
        return  # what is missing is told by what needs it
    there = _there(actuator, reading.mapping, header)
    of_person = ColumnMapping(tuple(entry for entry in reading.mapping.entries if entry not in reading.guessed))
    stated = _there(actuator, of_person, ())
    doubts = {}
    for entry, why in reading.doubts:
        if not entry.unit:  # it may as well be of the kind that the actuator's axes have
            entry = replace(entry, signal=actuator.axes.signal(entry.signal))
        doubts |= {inside: (entry, why) for inside in actuator.axes.inside({entry.signal: 0})}
    nobody = "#N" if header and header[0] == by_number(0) else "COLUMN"
    questions, options, absent = [], [], []
    for name in dict.fromkeys(name for group in needs for name in _to_be_said(group, there, doubts, stated)):
        entry, why = doubts.get(name) or (MappedColumn(actuator.axes.signal(name), nobody), "")
        if not why:
            absent.append(name)
        doubtful = f"{shown(entry.column)!r} may be {entry.signal}, but {why}"
        questions.append(doubtful if why else f"{entry.signal} is needed")
        in_name = unit_in_name(entry.column, entry.signal)
        stated = replace(entry, unit=entry.unit or SIGNALS[entry.signal].unit).text
        options.append(f"--map {shlex.quote(f'{entry.signal}={entry.column}' if in_name else stated)}")
    if questions:
        for name in absent:
            if wrong := actuator.axes.mismatch(name, [*header, *(entry.signal for entry in reading.mapping.entries)]):
                raise refusal(path, f"{actuator.axes.signal(name)} is needed; {wrong}")
        found = f"say which column it is: {' '.join(options)} (the file has {listed(without_unit(header))})"
        is_of_model = "command_rad" in absent and needs != COMMAND_ALONE and not there.isdisjoint(INPUT_ALONE[1])
        hint = f"; {WITHOUT_COMMAND}" if is_of_model else ""
        hint += "; a file without a time is read with --rate HZ" if "time_s" in absent else ""
        if export := known_export(header):
            hint += f"; {export.sentence}"
        raise refusal(path, f"{'; '.join(questions)}; {found}{hint}")


def _to_be_said(
    group: Sequence[str], there: Collection[str], doubts: Collection[str], stated: AbstractSet[str]
) -> list[str]:
    """What a person must say for a group: nothing where the first signal of it that there is, is sure or stated."""
    if not stated.isdisjoint(group):
        return []
    for signal in group:
        parts = [signal]
        if signal == "current_A" and signal not in there and signal not in doubts:
            parts = _made_into_current({*there, *doubts})
        if all(part in there or part in doubts for part in parts):
            return [part for part in parts if part not in there]
    return [group[0]]


# --- writes a measurement to a file of any format ---------------------------------------------------------------------


def write_measurement(measurement: Measurement, path: str | os.PathLike[str]) -> None:
    """Writes all signals in the format that the suffix names; the file appears whole or not at all.

    An older file of that name is replaced; folders are not made.  Raises InputError for a place that cannot
    be written and for values that are not finite, which no reader would take back.
    """
    path = os.fspath(path)
    check_target(path)
    write = format_of(path, WRITTEN).write
    assert write is not None
    check_finite(path, measurement.signals, lambda row: f"sample {row + 1}")
    try:
        with whole_file(path) as draft:
            write(measurement.signals, os.fspath(draft))
    except OSError as error:
        raise refusal(path, f"cannot be written ({reason(error)}); check the disk and the permissions") from None


def check_target(path: str | os.PathLike[str]) -> None:
    """Raises InputError unless a measurement can be written there; to be asked before a long run."""
    path = os.fspath(path)
    if os.path.isdir(path):
        raise refusal(path, "is a folder; the name of a file is expected")
    format_of(path, WRITTEN)
    target = os.path.realpath(path)
    folder = os.path.dirname(target)
    if not os.path.isdir(folder):
        raise refusal(path, f"there is no folder {shown(os.path.dirname(path) or folder, 200)!r}; make it first")
    if os.path.exists(target) and not os.path.isfile(target):
        raise refusal(path, "is not a regular file; take another name")
    if not os.access(folder, os.W_OK):
        raise refusal(path, "no permission to write into its folder; take another folder")
