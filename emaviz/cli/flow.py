"""The one flow of every verb that reads recordings: read, compute, save, write, print, record, report.

A verb states its options and one function that computes; what comes before and after stands here once.  The recording
and the report come last: if one of them fails, the answer and the other are there.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ema_model import faults
from ema_model.actuator import Actuator, load_actuator, save_actuator
from ema_model.commands import Command, Recorded, command
from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.files.opened import FILE_BYTES, listed
from ema_model.quantities import Axes
from ema_model.recordings import Measurement, read, read_header
from ema_model.recordings.formats.text_layout import Hints
from ema_model.recordings.read import COMMAND_ALONE, INPUT_ALONE, VOLTAGE_ALONE, Needs, signals_in
from ema_model.recordings.recording_set import (
    RUN,
    check_held_out,
    column_of_runs,
    episodes_of,
    files_of,
    held_out,
    is_pattern,
    long_enough,
    runs_of,
)
from emaviz.cli import output
from emaviz.cli.ending import ExitCode
from emaviz.cli.options import COMMAND_OR_FILE
from emaviz.cli.output import Progress

if TYPE_CHECKING:
    from ema_model.result import Result
    from ema_model.simulation.run import Run


# --- the values of shared options: the actuator, recordings, faults, effects, weights, and the run asked for ----------


def read_set(
    arguments: argparse.Namespace, actuator: Actuator, progress: Progress
) -> tuple[list[Measurement], list[Measurement]]:
    """The recordings to fit and those held out, cut to --from and --to; says on stderr what was assumed of columns."""
    given, unseen = files_to_read(arguments)
    if not given and arguments.files:
        raise InputError("--holdout takes out every recording; leave some to fit")
    fitted, held = (read_files(names, arguments, actuator, progress) for names in (given, unseen))
    for rule in arguments.holdout:
        if is_pattern(rule):
            fitted, taken = held_out(fitted, rule)
            held += taken
    check_held_out(fitted, held)
    return fitted, held


def files_to_read(arguments: argparse.Namespace, *, in_folders: bool = False) -> tuple[list[str], list[str]]:
    """The files to fit and those that --holdout names, which are taken out of folders and patterns.

    in_folders: as of `files_of`.  InputError for one that is named itself both times.
    """
    unseen = [file for text in arguments.holdout if not is_pattern(text) for file in files_of(text)]
    places = {Path(file).resolve() for file in unseen}
    given: list[str] = []
    for text in arguments.files:
        for file in files_of(text, in_folders=in_folders):
            if Path(file).resolve() not in places:
                given.append(file)
            elif file == text:
                raise InputError(
                    f"{quoted(file)}: is named to be fitted and by --holdout; hold out a recording that is not fitted"
                )
    return given, unseen


def read_files(
    names: Sequence[str], arguments: argparse.Namespace, actuator: Actuator, progress: Progress
) -> list[Measurement]:
    """One after another, cut into runs and to --from and --to; says on stderr what was assumed of columns."""
    return [one for _, found in read_each(names, arguments, actuator, progress) for one in found]


def read_each(
    names: Sequence[str], arguments: argparse.Namespace, actuator: Actuator, progress: Progress
) -> Iterator[tuple[str, list[Measurement]]]:
    """The same by file; says on stderr which of several is too short, and leaves it out."""

    def read_runs(numbered: tuple[int, str]) -> list[Measurement]:
        number, name = numbered
        progress.show(f"reading {Path(name).name} ({number} of {len(names)})")
        one = read_one(name, arguments, actuator, progress)
        found = runs_of(one) if arguments.runs else episodes_of(one, name)
        if arguments.start_s is None and arguments.stop_s is None:
            return found
        start = -math.inf if arguments.start_s is None else arguments.start_s
        stop = math.inf if arguments.stop_s is None else arguments.stop_s
        return [measurement.selected((start, stop)) for measurement in found]

    for (_, name), found in long_enough(enumerate(names, 1), read_runs, lambda line: say(line, progress)):
        yield name, found


def say(line: str, progress: Progress | None) -> None:
    """A line on stderr, in place of how far the work is."""
    if progress is not None:
        progress.done()
    print(line, file=sys.stderr)


def read_one(
    file: str,
    arguments: argparse.Namespace,
    actuator: Actuator,
    progress: Progress | None = None,
    needs: Needs | None = None,
) -> Measurement:
    """A recording as --map, --header-line, --encoding, --rate and --runs say; needs: of its signals, all by default."""
    runs = getattr(arguments, "runs", None)
    if not runs and not any(text.partition("=")[0].strip() == "segment" for text in arguments.mapping):
        runs = column_of_runs(file)
    by_run = [f"segment={runs}"] if runs and runs != "segment" else []
    measurement = read(file, actuator, [*arguments.mapping, *by_run], needs=needs, hints=hints_of(arguments))
    if told := measurement.reading.told:
        say(f"{Path(file).name}: {told}", progress)
    return measurement


def hints_of(arguments: argparse.Namespace) -> Hints:
    """How files are laid out: --header-line, --encoding and --rate."""
    return Hints(arguments.header_line, arguments.encoding, arguments.rate)


def actuator_of(arguments: argparse.Namespace) -> Actuator:
    """The actuator that --actuator names, without its controller where --open-loop asks for that."""
    actuator = load_actuator(arguments.actuator)
    if not getattr(arguments, "open_loop", False):
        return actuator
    files = files_to_read(arguments)[0]
    return actuator.in_open_loop(_recorded(files[0], arguments, actuator) if files else ())


def input_of(arguments: argparse.Namespace, actuator: Actuator) -> Measurement:
    """The recording of --input, whose current or torque, or voltage or duty, is put in."""
    opened = actuator.in_open_loop(_recorded(arguments.input, arguments, actuator))
    return read_one(arguments.input, arguments, opened, needs=VOLTAGE_ALONE if opened.takes_voltage else INPUT_ALONE)


def _recorded(file: str, arguments: argparse.Namespace, actuator: Actuator) -> set[str]:
    """The signals of a file, where they decide what is put in; of a drive without a voltage they do not."""
    if actuator.inverter.kind != "voltage":
        return set()
    return signals_in(file, actuator, arguments.mapping, hints=Hints(arguments.header_line, arguments.encoding))


def faults_of(arguments: argparse.Namespace, known: Mapping[str, float] | None = None) -> Any:
    """k (8,) from --fault, before what is known of the unit."""
    return faults.vector({**(known or {}), **dict(pair(text, "--fault") for text in arguments.fault)})


def effects_of(arguments: argparse.Namespace, axes: Axes) -> dict[str, dict[str, float]]:
    """Effects from --effect NAME:param=value,…, or user_torque:expression=…,param=value,…; names are the axes'."""
    if not arguments.effect:
        return {}
    from ema_model.effects import find  # the kernels take a while to import
    from ema_model.effects.user.torque import kind_of, read_entries

    effects: dict[str, dict[str, float]] = {}
    for text in arguments.effect:
        name, _, rest = text.partition(":")
        parts = split_at_commas(rest)
        if (kind := kind_of(name)) is None:
            effect = find(name, axes)
            given = effect.inside(dict(pair(part, f"--effect {quoted(name)}") for part in parts))
        else:
            try:
                effect, given = read_entries(kind, dict(_user_entry(part) for part in parts))
            except InputError as error:
                raise InputError(f"--effect {quoted(name)}: {error}") from None
        if effect.name in effects:
            raise InputError(f"--effect {quoted(name)}: given twice; write it once")
        effects[effect.name] = effect.settings(given)
    return effects


def effects_to_fit(arguments: argparse.Namespace) -> list[str]:
    """Effects of the library that --effect names without any value: their values are what the recordings ask for."""
    if not arguments.effect:
        return []
    from ema_model.effects.user.torque import kind_of

    parts = [text.partition(":") for text in arguments.effect]
    return [name for name, _, rest in parts if not split_at_commas(rest) and kind_of(name) is None]


def split_at_commas(text: str) -> list[str]:
    """The parts between commas that stand outside parentheses and brackets; empty ones are left out."""
    parts, depth = [""], 0
    for character in text:
        depth += (character in "([") - (character in ")]")
        if character == "," and depth <= 0:
            parts.append("")
        else:
            parts[-1] += character
    return [part for part in parts if part]


def _user_entry(part: str) -> tuple[str, str | float | list[float]]:
    """One entry of a user's effect: a text, a number, or a list of numbers in brackets."""
    name, separator, value = (piece.strip() for piece in part.partition("="))
    if not separator:
        raise InputError(f"{quoted(part.strip())}: write it as name=value")
    if name in ("expression", "variable", "modulator"):
        return name, value
    try:
        if name == "values":
            return name, [float(one) for one in value.removeprefix("[").removesuffix("]").split(",")]
        return name, float(value)
    except ValueError:
        as_what = "values=[number,number,…]" if name == "values" else "name=number"
        raise InputError(f"{quoted(part.strip())}: write it as {as_what}") from None


def weights_of(texts: list[str] | None) -> dict[str, float] | None:
    """Weights from --signal NAME or NAME=weight."""
    if texts is None:
        return None
    return dict(pair(text, "--signal") if "=" in text else (text, 1.0) for text in texts)


def run_of(arguments: argparse.Namespace, actuator: Actuator, sample_rate_Hz: float = 10_000.0) -> Run:
    """The run that the options ask for."""
    demand, length = _command(arguments, actuator)
    from ema_model.simulation.run import LoadProfile, Run  # takes a second: a wrong command is refused before

    duration = arguments.duration if arguments.duration is not None else length
    load = LoadProfile(arguments.load_shape, arguments.load_time, arguments.load_frequency)
    return Run(demand, duration, sample_rate_Hz, arguments.load_torque, load)


def _command(arguments: argparse.Namespace, actuator: Actuator) -> tuple[Command, float]:
    name = arguments.command
    if not COMMAND_OR_FILE.is_file(name):
        settings = {}
        for text in arguments.settings:
            key, separator, value = text.partition("=")
            if not separator:
                raise InputError(f"--set {quoted(text)}: write it as NAME=value")
            settings[key] = value
        return command(name, settings), 0.5
    if arguments.settings:
        raise InputError("--set changes a built-in command, not a recorded one")
    recording = read_one(name, arguments, actuator, needs=COMMAND_ALONE)
    recording.require("command_rad")
    return Recorded(recording.time_s, recording["command_rad"], str(name)), recording.duration_s


def pair(text: str, option: str) -> tuple[str, float]:
    """`name=number`; InputError that names the option."""
    name, separator, value = text.partition("=")
    try:
        if not separator:
            raise ValueError
        return name.strip(), float(value)
    except ValueError:
        raise InputError(f"{option} {quoted(text)}: write it as name=number") from None


# --- the one flow -----------------------------------------------------------------------------------------------------
# A verb states its options and one function that computes; what comes before and after stands here once. The recording
# and the report come last: if one of them fails, the answer and the other are there.

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
        from emaviz.views.report import export

        export(result, path, configuration)

    return Answer(result, result.to_dict(), actuator, record=write, report=write)


Read = TypeVar("Read")  # recordings, or recordings by unit


def run(
    arguments: argparse.Namespace,
    actuator: Actuator,
    compute: Callable[[Read, Read, output.Progress], Answer],
    read: Callable[[argparse.Namespace, Actuator, output.Progress], tuple[Read, Read]] = read_set,
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
    actuator = replace(actuator, effects={**actuator.effects, **effects_of(arguments, actuator.axes)})

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
    given_files, unseen = files_to_read(arguments, in_folders=True)
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
    for file, found in read_each(files, arguments, actuator, progress):
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
    columns = read_header(files[0], FILE_BYTES, hints_of(arguments))
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
