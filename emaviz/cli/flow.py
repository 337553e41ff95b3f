"""The one flow of every verb that reads recordings: read, compute, save, write, print, record, report.

A verb states its options and one function that computes; what comes before and after stands here once.  The recording
and the report come last: if one of them fails, the answer and the other are there.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ema_model.actuator import Actuator, save_actuator
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.files.opened import FILE_BYTES, listed
from ema_model.recordings import Measurement, read_header
from ema_model.recordings.recording_set import RUN, held_out, is_pattern
from emaviz.cli import option_values, output
from emaviz.cli.ending import ExitCode

if TYPE_CHECKING:
    from ema_model.result import Result


Write = Callable[[str, Mapping[str, Any]], None]  # a file's path, and the options that the answer was computed with


@dataclass(frozen=True)
class Answer:
    """What a verb found, and how it is written."""

    words: object  # str() of it is printed
    document: Mapping[str, Any]  # of --json
    actuator: Actuator | None = None  # of --save-actuator
    record: Write | None = None  # of --record; imports rerun, which takes a second
    report: Write | None = None  # of --report; imports plotly, which takes a second
    is_whole: bool = True  # else it was interrupted, and its model is not saved
    saved: Callable[[], tuple[str, Mapping[str, Any]]] | None = None  # of the saved model: words, JSON


def of_result(result: Result, actuator: Actuator | None = None) -> Answer:
    """What a verb finds that answers with a result: it says, shows and exports itself.

    actuator: of --save-actuator.
    """

    def write(path: str, configuration: Mapping[str, Any]) -> None:
        from emaviz.views.export import export

        export(result, path, configuration)

    return Answer(result, result.to_dict(), actuator, record=write, report=write)


Read = TypeVar("Read")  # recordings, or recordings by unit


def run(
    arguments: argparse.Namespace,
    actuator: Actuator,
    compute: Callable[[Read, Read, output.Progress], Answer],
    read: Callable[[argparse.Namespace, Actuator, output.Progress], tuple[Read, Read]] = option_values.read_set,
) -> ExitCode:
    """Reads what is fitted and what is held out, computes, and finishes."""
    progress = output.Progress(arguments)
    try:
        fitted, held = read(arguments, actuator, progress)
        return finish(arguments, compute(fitted, held, progress), progress)
    finally:
        progress.done()


def finish(arguments: argparse.Namespace, answer: Answer, progress: output.Progress) -> ExitCode:
    """Saves the model, writes the JSON, prints, records and reports."""
    words, document = str(answer.words), dict(answer.document)
    if answer.is_whole and answer.actuator is not None and getattr(arguments, "save_actuator", None):
        save_actuator(answer.actuator, arguments.save_actuator)
        if answer.saved is not None:
            progress.show("simulating the saved model")
            line, of_saved = answer.saved()
            words, document = f"{words}\n\n{line}", {**document, **of_saved}
    progress.done()
    output.write_json(arguments, document)
    print(words, flush=True)
    if not answer.is_whole:
        output.say_not_written(arguments, "save_actuator")
    configuration = output.configuration(arguments)
    failed: list[Exception] = []
    for option, write in (("record", answer.record), ("report", answer.report)):
        if write is not None and (path := getattr(arguments, option, None)):
            progress.show(f"writing the {option.replace('record', 'recording')}")
            try:
                write(path, configuration)
            except (InputError, OSError) as error:
                failed.append(error)
    progress.done()
    if failed:
        raise InputError("; ".join(map(str, failed))) from failed[0]
    return ExitCode.DONE if answer.is_whole else ExitCode.INTERRUPTED


# --- `… --by unit`: whose a recording is, what units differ in, and which physics they lack ---------------------------

_BY_FOLDER = ("unit", "folder")
_NOT_OF_UNITS = {"record": None, "calibrate": True, "signals": None, "fault": []}  # with their defaults
_WORD = {"calibrate": "--no-calibrate", "signals": "--signal"}
Units = dict[str, list[Measurement]]


def run_by_unit(arguments: argparse.Namespace, actuator: Actuator) -> int:
    """Compares the units."""
    from ema_model.fleet.compare import compare_units

    _refuse(arguments, _NOT_OF_UNITS)
    actuator = replace(actuator, effects={**actuator.effects, **option_values.effects_of(arguments, actuator.axes)})

    def compute(fitted: Units, held: Units, progress: output.Progress) -> Answer:
        result = compare_units(
            fitted, actuator, holdout=held, free=arguments.free, seed=arguments.seed, on_progress=progress.show
        )

        return of_result(result, result.type_actuator)

    return run(arguments, actuator, compute, read_units)


def run_discovery(arguments: argparse.Namespace, actuator: Actuator, signals: tuple[str, ...] | None) -> int:
    """Looks for what the units lack."""
    from ema_model.fleet.discovery import discover_units

    _refuse(arguments, ["record"])

    def compute(fitted: Units, held: Units, progress: output.Progress) -> Answer:
        result = discover_units(
            fitted,
            actuator,
            holdout=held,
            signals=signals,
            most_effects=arguments.max_effects,
            seed=arguments.seed,
            on_progress=progress.show,
        )

        return of_result(result, result.compared.type_actuator)

    return run(arguments, actuator, compute, read_units)


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
    from ema_model.fleet.compare import check_same_type

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
