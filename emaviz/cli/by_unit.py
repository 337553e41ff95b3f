"""`emaviz compare|discover … --by unit`: whose a recording is, what units differ in, and which physics they lack."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from copy import copy
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path

from ema_model.actuator import Actuator
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.files.opened import FILE_BYTES, listed
from ema_model.fleet.compare import check_same_type
from ema_model.recordings import Measurement, read_header
from ema_model.recordings.recording_set import RUN, held_out, is_pattern
from emaviz.cli import flow, option_values, output

_BY_FOLDER = ("unit", "folder")
_NOT_OF_UNITS = {"record": None, "calibrate": True, "signals": None, "fault": []}  # with their defaults
_WORD = {"calibrate": "--no-calibrate", "signals": "--signal"}
Units = dict[str, list[Measurement]]


def run(arguments: argparse.Namespace, actuator: Actuator) -> int:
    """Compares the units."""
    from ema_model.fleet.compare import compare_units

    _refuse(arguments, _NOT_OF_UNITS)
    actuator = replace(actuator, effects={**actuator.effects, **option_values.effects_of(arguments, actuator.axes)})

    def compute(fitted: Units, held: Units, progress: output.Progress) -> flow.Answer:
        result = compare_units(
            fitted, actuator, holdout=held, free=arguments.free, seed=arguments.seed, on_progress=progress.show
        )

        return flow.of_result(result, result.type_actuator)

    return flow.run(arguments, actuator, compute, read_units)


def run_discovery(arguments: argparse.Namespace, actuator: Actuator, signals: tuple[str, ...] | None) -> int:
    """Looks for what the units lack."""
    from ema_model.fleet.discovery import discover_units

    _refuse(arguments, ["record"])

    def compute(fitted: Units, held: Units, progress: output.Progress) -> flow.Answer:
        result = discover_units(
            fitted,
            actuator,
            holdout=held,
            signals=signals,
            most_effects=arguments.max_effects,
            seed=arguments.seed,
            on_progress=progress.show,
        )

        return flow.of_result(result, result.compared.type_actuator)

    return flow.run(arguments, actuator, compute, read_units)


def _refuse(arguments: argparse.Namespace, options: Iterable[str]) -> None:
    """InputError for one of these options that is given."""
    for name in options:
        if getattr(arguments, name) != _NOT_OF_UNITS[name]:
            raise InputError(f"{_WORD.get(name, f'--{name}')}: has no meaning where units are compared; leave it out")


def read_units(arguments: argparse.Namespace, actuator: Actuator, progress: output.Progress) -> tuple[Units, Units]:
    """The recordings to fit and those held out, by unit; InputError where it is not clear whose one is."""
    given_files, unseen = option_values.files_to_read(arguments, in_folders=True)
    named = {Path(file).resolve() for file in unseen}
    files = list(dict.fromkeys([*given_files, *unseen]))
    check_same_type(files)
    column = _column(arguments, files)
    if column:
        arguments = copy(arguments)
        arguments.runs = column
    fitted: Units = {}
    held: Units = {}
    for file, found in option_values.read_each(files, arguments, actuator, progress):
        for one in found:
            unit = f"{column} {one.name.rpartition(RUN)[2]}" if column else _unit_of(file, one.name, arguments.unit)
            (held if Path(file).resolve() in named else fitted).setdefault(unit, []).append(one)
    for text in arguments.unit:
        if (name := _named(text)[0]) not in fitted and name not in held:
            raise InputError(f"--unit {quoted(text)}: none of the recordings has such a name; check the pattern")
    for rule in filter(is_pattern, arguments.holdout):
        kept, taken = held_out([one for given in fitted.values() for one in given], rule)
        held = {
            unit: [*held.get(unit, []), *(one for one in given if any(one is other for other in taken))]
            for unit, given in fitted.items()
        }
        fitted = {unit: [one for one in given if any(one is other for other in kept)] for unit, given in fitted.items()}
    return fitted, held


def _column(arguments: argparse.Namespace, files: list[str]) -> str:
    """The column that tells the unit; "" where folders or patterns do."""
    if arguments.by is None:
        return ""
    if arguments.unit and arguments.by not in _BY_FOLDER:
        raise InputError("--by names a column, and --unit patterns: give one of them")
    if arguments.unit:
        return ""
    columns = read_header(files[0], FILE_BYTES, option_values.hints_of(arguments))
    if arguments.by in columns:
        if arguments.runs:
            raise InputError("--runs and --by COLUMN both cut the files into runs; give one of them")
        return arguments.by
    if arguments.by in _BY_FOLDER:
        return ""
    raise InputError(
        f"--by {quoted(arguments.by)}: {quoted(Path(files[0]).name)} has no such column (it has {listed(columns)}); "
        f"--by unit takes folders as units{did_you_mean(arguments.by, columns)}"
    )


def _unit_of(file: str, name: str, units: list[str]) -> str:
    if not units:
        return Path(file).resolve().parent.name
    found = [
        unit
        for unit, pattern in map(_named, units)
        if any(fnmatchcase(text, pattern) for text in (name, Path(file).name, file))
    ]
    if len(set(found)) != 1:
        of = "of no unit" if not found else f"of {' and of '.join(dict.fromkeys(found))}"
        raise InputError(f"{quoted(Path(file).name)}: is {of}, by --unit; give patterns that name each recording once")
    return found[0]


def _named(text: str) -> tuple[str, str]:
    name, separator, pattern = (part.strip() for part in text.partition("="))
    if not separator or not name or not pattern:
        raise InputError(f"--unit {quoted(text)}: write it as NAME=GLOB, for example left='*left*'")
    return name, pattern
