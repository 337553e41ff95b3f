"""Options that several commands share, and how their text is read."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ema_model import faults
from ema_model.actuator import Actuator, load_actuator
from ema_model.commands import COMMANDS, Command, Recorded, command
from ema_model.effects import find
from ema_model.effects.user.entries import kind_of, read_entries
from ema_model.errors import InputError, quoted
from ema_model.quantities.axes import Axes
from ema_model.recordings import Measurement, read
from ema_model.recordings.formats.text_layout import Hints, known_encoding
from ema_model.recordings.read import COMMAND_ALONE, INPUT_ALONE, Needs
from ema_model.recordings.recording_set import files_of, held_out, is_pattern, runs_of
from ema_model.simulation.run import Run
from emaviz.cli import files
from emaviz.cli.numbers import FINITE, SEED, whole
from emaviz.cli.output import Progress

_COMMAND = files.Input(
    "the file of a measurement",
    has_side_file=True,
    is_file=lambda name: name not in COMMANDS and bool(Path(name).suffix),
)


def add_fit(parser: argparse.ArgumentParser, what: str) -> None:
    """What identify, compare and discover share: the recordings' part to use, and where the result, `what`, goes"""
    add_actuator(parser)
    add_mapping(parser)
    parser.add_argument("--from", type=FINITE, dest="start_s", metavar="s", help="leave out what lies before")
    parser.add_argument("--to", type=FINITE, dest="stop_s", metavar="s", help="leave out what lies after")
    parser.add_argument(
        "--holdout",
        action="append",
        default=[],
        type=files.HELD_OUT,
        metavar="FILE|RULE",
        help="a recording that is not fitted, to judge the result by, or a rule that takes out those named so: "
        "'kp200*'; repeat for more",
    )
    parser.add_argument(
        "--runs",
        metavar="COLUMN",
        help="the column that numbers the runs of a file: each becomes a recording of its own, NAME#1, NAME#2 …",
    )
    parser.add_argument(
        "--save-actuator",
        type=files.SAVED_ACTUATOR,
        metavar="FILE.toml",
        help="write the fitted model as an actuator file",
    )
    add_record(parser, what)
    add_report(parser)
    add_json(parser)
    files.add_force(parser)


def read_set(
    arguments: argparse.Namespace, actuator: Actuator, progress: Progress
) -> tuple[list[Measurement], list[Measurement]]:
    """The recordings to fit and those held out, cut to --from and --to; says on stderr what was assumed of columns."""
    named = [text for text in arguments.holdout if not is_pattern(text)]
    unseen = [file for text in named for file in files_of(text)]
    places = [Path(file).resolve() for file in unseen]
    given = [
        file
        for text in arguments.files
        for file in files_of(text)
        if file == text or Path(file).resolve() not in places  # what is named itself is fitted all the same
    ]
    if not given and arguments.files:
        raise InputError("--holdout takes out every recording; leave some to fit")
    fitted, held = (read_files(names, arguments, actuator, progress) for names in (given, unseen))
    for rule in arguments.holdout:
        if is_pattern(rule):
            fitted, taken = held_out(fitted, rule)
            held += taken
    return fitted, held


def read_files(
    names: Sequence[str], arguments: argparse.Namespace, actuator: Actuator, progress: Progress
) -> list[Measurement]:
    """One after another, cut into runs and to --from and --to; says on stderr what was assumed of columns."""
    found: list[Measurement] = []
    for i, name in enumerate(names):
        progress.show(f"reading {Path(name).name} ({i + 1} of {len(names)})")
        one = read_one(name, arguments, actuator, progress)
        found += runs_of(one) if arguments.runs else [one]
    if arguments.start_s is None and arguments.stop_s is None:
        return found
    start = -math.inf if arguments.start_s is None else arguments.start_s
    stop = math.inf if arguments.stop_s is None else arguments.stop_s
    return [measurement.selected((start, stop)) for measurement in found]


def read_one(
    file: str,
    arguments: argparse.Namespace,
    actuator: Actuator,
    progress: Progress | None = None,
    needs: Needs | None = None,
) -> Measurement:
    runs = getattr(arguments, "runs", None)
    by_run = [f"segment={runs}"] if runs and runs != "segment" else []
    hints = Hints(arguments.header_line, arguments.encoding)
    measurement = read(file, actuator, [*arguments.mapping, *by_run], needs=needs, hints=hints)
    if told := measurement.reading.told:
        if progress is not None:
            progress.done()
        print(f"{Path(file).name}: {told}", file=sys.stderr)
    return measurement


def add_actuator(parser: argparse.ArgumentParser) -> None:
    """--actuator"""
    parser.add_argument(
        "--actuator", type=files.ACTUATOR, metavar="A.toml", help="parameters of the actuator; without it, the thesis's"
    )


def add_faults(parser: argparse.ArgumentParser) -> None:
    """--fault, repeated"""
    parser.add_argument(
        "--fault", action="append", default=[], metavar="k1=0.25", help="a fault k1 … k8 in 0 … 1; repeat for more"
    )


def add_mapping(parser: argparse.ArgumentParser) -> None:
    """--map, repeated; --header-line and --encoding"""
    parser.add_argument(
        "--map",
        action="append",
        default=[],
        dest="mapping",
        metavar="signal=column",
        help="a column's meaning, with its unit where it is not SI: motor_speed_rad_s=speed[rpm]; repeat for more",
    )
    parser.add_argument(
        "--header-line",
        type=whole(1, 10_000),
        metavar="N",
        help="the line with the columns' names, of a text in which another is found by itself",
    )
    parser.add_argument(
        "--encoding", type=_encoding, metavar="NAME", help="of a text: utf-8, cp1252, utf-16, … where another is found"
    )


def _encoding(text: str) -> str:
    try:
        return known_encoding(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{quoted(text)} is no encoding; utf-8, cp1252 and utf-16 are usual") from None


def add_effects(parser: argparse.ArgumentParser) -> None:
    """--effect, repeated"""
    parser.add_argument(
        "--effect",
        action="append",
        default=[],
        metavar="NAME:param=value,…",
        help="a physical effect, or your own torque 'user_torque:expression=c*omega,c=-1e-4'; repeat for more",
    )


def add_seed(parser: argparse.ArgumentParser) -> None:
    """--seed"""
    parser.add_argument("--seed", type=SEED, default=0, help="of all random numbers")


def add_json(parser: argparse.ArgumentParser) -> None:
    """--json"""
    parser.add_argument("--json", type=files.JSON, metavar="FILE.json", help="write the result there")


def add_report(parser: argparse.ArgumentParser) -> None:
    """--report"""
    parser.add_argument(
        "--report", type=files.REPORT, metavar="FILE.html", help="write a report that opens in any browser, offline"
    )


def add_record(parser: argparse.ArgumentParser, what: str) -> None:
    """--record; what: is written there"""
    parser.add_argument("--record", type=files.RRD, metavar="FILE.rrd", help=f"write {what} for the Rerun viewer")


def add_run(parser: argparse.ArgumentParser) -> None:
    """What is asked of the actuator: --command, --set, --duration, --load-torque, sensors' accuracy"""
    parser.add_argument(
        "--command",
        type=_COMMAND,
        default="chirp",
        metavar="NAME|FILE",
        help=f"{', '.join(COMMANDS)}, or a recording's command",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=value",
        dest="settings",
        help="a setting of the command, e.g. amplitude_rad=0.01; repeat for more",
    )
    parser.add_argument("--duration", type=FINITE, metavar="s", help="0.5 s, or the whole of a recorded command")
    parser.add_argument(
        "--load-torque", type=FINITE, default=0.0, metavar="N_m", help="on the user shaft, against positive motion"
    )
    parser.add_argument("--noise-current", type=FINITE, default=0.0, metavar="A", help="rms noise of the sensors")
    parser.add_argument(
        "--encoder-bits", type=whole(0, 32), default=0, metavar="N", help="per motor turn; 0 is a perfect one"
    )
    add_seed(parser)


def add_open_loop(parser: argparse.ArgumentParser) -> None:
    """--open-loop"""
    parser.add_argument(
        "--open-loop",
        action="store_true",
        help="leave the controller out: the recorded current, torque or force goes in, and the motion is compared",
    )


def actuator_of(arguments: argparse.Namespace) -> Actuator:
    """The actuator that --actuator names, without its controller where --open-loop asks for that."""
    actuator = load_actuator(arguments.actuator)
    return actuator.in_open_loop() if getattr(arguments, "open_loop", False) else actuator


def input_of(arguments: argparse.Namespace, actuator: Actuator) -> Measurement:
    """The recording of --input, whose current or torque is put in."""
    return read_one(arguments.input, arguments, actuator.in_open_loop(), needs=INPUT_ALONE)


def faults_of(arguments: argparse.Namespace, known: Mapping[str, float] | None = None) -> Any:
    """k (8,) from --fault, before what is known of the unit."""
    return faults.vector({**(known or {}), **dict(pair(text, "--fault") for text in arguments.fault)})


def effects_of(arguments: argparse.Namespace, axes: Axes) -> dict[str, dict[str, float]]:
    """Effects from --effect NAME:param=value,…, or user_torque:expression=…,param=value,…; names are the axes'."""
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
    duration = arguments.duration if arguments.duration is not None else length
    return Run(demand, duration, sample_rate_Hz, arguments.load_torque)


def _command(arguments: argparse.Namespace, actuator: Actuator) -> tuple[Command, float]:
    name = arguments.command
    if not _COMMAND.is_file(name):
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
