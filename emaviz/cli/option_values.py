"""The values of shared options: the actuator, recordings, faults, effects, weights, and the run that is asked for."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ema_model import faults
from ema_model.actuator import Actuator, load_actuator
from ema_model.commands import Command, Recorded, command
from ema_model.errors import InputError, quoted
from ema_model.quantities import Axes
from ema_model.recordings import Measurement, read
from ema_model.recordings.formats.text_layout import Hints
from ema_model.recordings.read import COMMAND_ALONE, INPUT_ALONE, VOLTAGE_ALONE, Needs, signals_in
from ema_model.recordings.recording_set import (
    check_held_out,
    column_of_runs,
    episodes_of,
    files_of,
    held_out,
    is_pattern,
    long_enough,
    runs_of,
)
from emaviz.cli.options import COMMAND_OR_FILE
from emaviz.cli.output import Progress

if TYPE_CHECKING:
    from ema_model.simulation.run import Run


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
