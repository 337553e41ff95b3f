"""The one door: any file of a known actuator becomes the measurement as the model needs it.

Which column is which signal is said by hand, else by the file's side file, else by the actuator's file; canonical
names speak for themselves, and what is then still open is guessed.  A guess that is not sure is asked about.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ema_model.actuator import Actuator
from ema_model.errors import InputError
from ema_model.files.limits import FILE_BYTES
from ema_model.files.refusal import listed, refusal, shown
from ema_model.quantities.signals import SIGNALS
from ema_model.recordings.columns.guess import doubt, guess_mapping
from ema_model.recordings.columns.mapping import ColumnMapping, MappedColumn, parse_mapping, unit_in_name
from ema_model.recordings.columns.reading import Reading, without_unit
from ema_model.recordings.equivalent_current import PHASES
from ema_model.recordings.file import NONE, check_file, hints_of, read_columns, read_header, read_measurement
from ema_model.recordings.formats.text_layout import Hints
from ema_model.recordings.measurement import Measurement
from ema_model.recordings.prepared import prepared
from ema_model.recordings.side_file.read import SideFile, find_side_file, read_side_file

Needs = Sequence[Sequence[str]]  # of each group one signal, the first that there is; names inside
COMMAND_ALONE: Needs = (("time_s",), ("command_rad",))
INPUT_ALONE: Needs = (("time_s",), ("current_A", "motor_torque_Nm"))
WITHOUT_COMMAND = (  # the end of a line that asks for one
    "where no command was recorded, add --open-loop to compare or discover, "
    'or choose an actuator with [controller] kind = "unknown"'
)
_MAKES_CURRENT = [*PHASES, "motor_position_rad"]
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
    _ask(path, actuator, reading, read_header(path, max_bytes, hints), needs)
    measurement = read_measurement(path, reading.mapping, side=side, max_bytes=max_bytes, hints=hints)
    return replace(
        measurement,
        reading=replace(reading, clocks=measurement.reading.clocks, layout=measurement.reading.layout),
    )


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
    given = mapping if isinstance(mapping, ColumnMapping) else parse_mapping(mapping, header)
    by_side = side.mapping is not None and bool(side.mapping.entries)
    known = side.mapping if by_side and side.mapping else _usual(actuator, header)
    of_actuator = bool(known.entries) and not by_side
    for entry in given.entries:
        known = known.with_entry(entry)
    settled = {entry.column for entry in known.entries} | {"", *SIGNALS}
    there = _there(actuator, known, header)
    needs = needed(actuator, is_map=side.kind == "map")
    missing = {name for group in needs if there.isdisjoint(group) for name in group}
    if by_side or (of_actuator and not missing) or settled.issuperset(header):
        return Reading(known)  # somebody has looked at these columns
    guess = guess_mapping(
        read_columns(path, max_bytes=max_bytes, hints=hints) if columns is None else columns, known=known
    )
    fresh = [entry for entry in guess.entries if entry.column not in settled]
    if of_actuator:  # its file says what matters in its recordings, so that only what is needed is sought beside
        fresh = [entry for entry in fresh if actuator.axes.inside({entry.signal: 0}).keys() & missing]
    doubts = tuple((entry, why) for entry in fresh if (why := doubt(entry)))
    sure = tuple(entry for entry in fresh if not doubt(entry))
    return Reading(ColumnMapping((*known.entries, *sure), guess.unmapped), sure, doubts)


def needed(actuator: Actuator, *, is_map: bool = False) -> Needs:
    """The groups of signals of each of which the actuator's model needs one; names inside."""
    if is_map:
        return (("motor_position_rad",), ("current_A", "motor_torque_Nm"))
    if actuator.controller.kind == "unknown":
        return (("time_s",), ("motor_position_rad",), ("current_A", "motor_torque_Nm"))
    if actuator.controller.kind == "open":
        return (*INPUT_ALONE, _MOTION)
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


def _usual(actuator: Actuator, columns: Collection[str]) -> ColumnMapping:
    """The part of the actuator's mapping that these columns are in."""
    usual = parse_mapping(actuator.mapping, columns)
    return ColumnMapping(tuple(entry for entry in usual.entries if entry.column in columns))


def _there(actuator: Actuator, mapping: ColumnMapping, header: Collection[str]) -> set[str]:
    """The signals, by their names inside, that a file so mapped has or can be given."""
    names = {entry.signal for entry in mapping.entries} | {name for name in header if name in SIGNALS}
    inside = set(actuator.axes.inside(dict.fromkeys(names)))
    return inside | ({"current_A"} if inside.issuperset(_MAKES_CURRENT) else set())


def _ask(path: str, actuator: Actuator, reading: Reading, header: Sequence[str], needs: Needs) -> None:
    """Raises InputError where what is needed stands in no column, or in one that is not sure."""
    if not reading.is_guess:
        return  # what is missing is told by what needs it
    there = _there(actuator, reading.mapping, header)
    doubts = {}
    for entry, why in reading.doubts:
        if not entry.unit:  # it may as well be of the kind that the actuator's axes have
            entry = replace(entry, signal=actuator.axes.signal(entry.signal))
        doubts |= {inside: (entry, why) for inside in actuator.axes.inside({entry.signal: 0})}
    questions, options, absent = [], [], []
    for name in dict.fromkeys(name for group in needs for name in _to_be_said(group, there, doubts)):
        entry, why = doubts.get(name) or (MappedColumn(actuator.axes.signal(name), "COLUMN"), "")
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
        raise refusal(path, f"{'; '.join(questions)}; {found}{hint}")


def _to_be_said(group: Sequence[str], there: Collection[str], doubts: Collection[str]) -> list[str]:
    """What a person must say for a group: nothing where the first signal of it that there is, is sure."""
    for signal in group:
        parts = [signal] if signal in there or signal in doubts or signal != "current_A" else _MAKES_CURRENT
        if all(part in there or part in doubts for part in parts):
            return [part for part in parts if part not in there]
    return [group[0]]
