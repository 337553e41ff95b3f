"""Options that verbs share: files, numbers, models, runs."""

from __future__ import annotations

import argparse
import math
import os
import re
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from glob import has_magic
from pathlib import Path
from typing import Generic, NamedTuple, TypeVar

from ema_model.errors import InputError, did_you_mean, quoted
from ema_model.files.opened import check_user_file, shown
from ema_model.members import stated, stated_by_class, stated_in

# --- the files that a command reads and writes: declared with its options, checked all together before it begins ------
# An option's `type` declares it: an `Input` for what is read, an `Output` for what is written.

# What reads recordings takes a while to import: it is imported where it is asked.


@dataclass(frozen=True)
class Input:
    """The type of an option that names a file to read."""

    expected: str  # as in "an actuator file (.toml)"
    has_side_file: bool = False
    is_file: Callable[[str], bool] = bool  # tells a file's name from what else the option takes
    several: bool = False  # a folder or a pattern stands for the recordings in it
    in_folders: bool = False  # a folder without recordings stands for those in its folders

    def __call__(self, text: str) -> str:
        return text


@dataclass(frozen=True)
class Output:
    """The type of an option that names a file to write."""

    ends_in: tuple[str, ...] = ()  # none: as measurements are written
    is_kept: bool = True  # one that exists is replaced with --force only
    has_side_file: bool = False

    def __call__(self, text: str) -> str:
        return text

    @property
    def suffixes(self) -> tuple[str, ...]:
        """One of these ends the name."""
        if self.ends_in:
            return self.ends_in
        import emaviz.formats  # noqa: F401  they join the family
        from ema_model.recordings.formats import WRITTEN

        return tuple(WRITTEN)

    def suffix_of(self, path: Path) -> str:
        """As it is compared: of measurements' alone, readers take capitals."""
        return path.suffix.lower() if self.has_side_file else path.suffix


@dataclass(frozen=True)
class Folder:
    """The type of an option that names a folder, which whoever takes it looks at."""

    def __call__(self, text: str) -> str:
        return text


RECORDING = Input("the file of a measurement", has_side_file=True)
RECORDINGS = replace(RECORDING, several=True)
UNITS = replace(RECORDINGS, in_folders=True)
HELD_OUT = replace(RECORDINGS, is_file=lambda text: not _is_pattern(text))
ACTUATOR = Input("an actuator file (.toml)")
# an MJCF model, and of which joint: whoever reads it splits the two
JOINT = Input("an MJCF model (.xml)", is_file=lambda text: "#" not in text)
JSON = Output((".json",), is_kept=False)
REPORT = Output((".html", ".htm"), is_kept=False)
RRD = Output((".rrd",))
SAVED_ACTUATOR = Output((".toml",))
MEASUREMENT = Output(has_side_file=True)


def _is_pattern(text: str) -> bool:
    from ema_model.recordings.recording_set import is_pattern

    return is_pattern(text)


_Declared = TypeVar("_Declared", Input, Output)


class _Named(NamedTuple, Generic[_Declared]):
    path: Path
    option: str  # empty for a positional one
    declared: _Declared


def add_recordings(parser: argparse.ArgumentParser, done: str, nargs: str = "+", declared: Input = RECORDINGS) -> None:
    """The recordings of one actuator that a command takes; done: "fitted"."""
    parser.add_argument(
        "files",
        nargs=nargs,
        type=declared,
        metavar="FILE",
        help=f"recordings of one actuator, {done} together; folders, LeRobot datasets and patterns too",
    )


def add_force(parser: argparse.ArgumentParser) -> None:
    """--force, for a command with an output that is kept"""
    parser.add_argument("--force", action="store_true", help="replace a recording or an actuator file that exists")


def check_files(parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> None:
    """Raises InputError for an input that is no file, and for an output that may not or cannot be written.

    To be asked before any work.  Where the outputs go, what killed processes left of theirs is removed.
    """
    from ema_model.files.written import remove_abandoned

    inputs = [one for one in _named(Input, parser, arguments) if one.declared.is_file(str(one.path))]
    outputs = _named(Output, parser, arguments)
    for one in inputs:
        check_user_file(one.path, one.declared.expected)
    taken = [place for one in inputs for place in _taken(one)]
    for one in outputs:
        if problem := _problem(one, taken, getattr(arguments, "force", False)):
            raise InputError(f"{one.option} {shown(one.path, 300)}: {problem}")
        taken += _taken(one)
    for folder in {os.path.dirname(os.path.realpath(one.path)) for one in outputs}:
        remove_abandoned(folder)


def _named(
    kind: type[_Declared], parser: argparse.ArgumentParser, arguments: argparse.Namespace
) -> list[_Named[_Declared]]:
    named = []
    for action in parser._actions:
        if isinstance(action.type, kind):
            value = getattr(arguments, action.dest)
            option = "".join(action.option_strings[:1])
            for text in value if isinstance(value, list) else [value]:
                if text is not None:
                    named += [_Named(Path(one), option, action.type) for one in _files(text, action.type)]
    return named


def _files(text: str, declared: Input | Output) -> list[str]:
    stands_for_others = os.path.isdir(text) or has_magic(text)  # else there is no need to ask what reads recordings
    if isinstance(declared, Input) and declared.several and stands_for_others and declared.is_file(text):
        import emaviz.formats  # noqa: F401  they join the family
        from ema_model.recordings.recording_set import files_of

        return files_of(text, in_folders=declared.in_folders)
    return [text]


def _taken(one: _Named[_Declared]) -> list[tuple[Path, str]]:
    """Where no other output may go, and why: the file itself, and what would be read as its side file."""
    taken = [(one.path, f"is what {one.option} names" if one.option else "is a file to read")]
    if one.declared.has_side_file:
        from ema_model.recordings.side_file import OF_A_FOLDER, side_path

        own = side_path(one.path)
        why = f"is the place of the side file of {shown(one.path.name, 100)}"
        taken += [(own, why), (own.with_name(OF_A_FOLDER), why)]
    return taken


def _problem(one: _Named[Output], taken: list[tuple[Path, str]], force: bool) -> str | None:
    """Why this output may not or cannot be written, if so."""
    path, declared = one.path, one.declared
    target = Path(os.path.realpath(path))
    for other, why in taken:
        if _are_same(path, other):
            return f"{why}; name another file"
    if target.is_dir():
        return "is a folder; name a file in it"
    if declared.suffix_of(path) not in declared.suffixes:
        return f"the name must end in {' or '.join(declared.suffixes)}"
    if not target.parent.is_dir():
        return f"the folder {target.parent if path.is_symlink() else path.parent} does not exist; make it first"
    if target.exists() and not target.is_file():
        return "is not a regular file; name another"
    if not os.access(target.parent, os.W_OK):
        return f"no permission to write in {target.parent}"
    if declared.is_kept and target.exists() and not force:
        return "exists already; name another file, or replace it with --force"
    return None


def _are_same(one: Path, other: Path) -> bool:
    """Whether both names mean one file, by links and by spellings that some file systems do not tell apart."""
    if one.exists() or other.exists():
        return one.exists() and other.exists() and one.samefile(other)
    one, other = (Path(os.path.realpath(path)) for path in (one, other))
    return one.parent == other.parent and _folded(one.name) == _folded(other.name)


def _folded(name: str) -> str:
    return unicodedata.normalize("NFC", name).casefold()


# --- the numbers that options take, checked while the options are read ------------------------------------------------


@dataclass(frozen=True)
class Number:
    """The type of an option that takes a finite number, from `low` to `high`."""

    low: float = -math.inf
    high: float = math.inf
    whole: bool = False

    def __call__(self, text: str) -> float:
        try:
            value = int(text) if self.whole else float(text)
        except ValueError:  # no number, or one of thousands of digits
            value = math.nan
        if not (self.low <= value <= self.high and math.isfinite(value)):
            raise argparse.ArgumentTypeError(f"must be {self._expected}, not {shown(text)!r}")
        return value

    @property
    def _expected(self) -> str:
        kind = "a whole number" if self.whole else "a finite number"
        return kind if math.isinf(self.low) else f"{kind} from {self.low} to {self.high}"


FINITE = Number()
SAMPLE_RATE = Number(1e-3, 1e9)  # Hz
SEED = Number(0, 2**63 - 1, whole=True)


def whole(low: int, high: int) -> Number:
    """The type of an option that takes a whole number from `low` to `high`."""
    return Number(low, high, whole=True)


# --- options that several commands share; what they give is read by `given` -------------------------------------------
# Names of commands, effects and the like are read from the sources that state them: the parser must answer at once,
# and to import what computes takes a second.


@cache
def command_names() -> tuple[str, ...]:
    """As `ema_model.commands.COMMANDS` has them, in its order."""
    names, places = stated_by_class("ema_model.commands", "name"), stated_by_class("ema_model.commands", "place")
    del names["Recorded"]  # which is made from a file
    return tuple(names[one] for one in sorted(names, key=lambda one: (places.get(one, _LAST), names[one])))


@dataclass(frozen=True)
class _CommandOrFile(Input):
    """The type of an option that takes a command's name, or a recording's file."""

    def __call__(self, text: str) -> str:
        if not self.is_file(text) and text not in (names := command_names()):
            raise argparse.ArgumentTypeError(
                f"no command {quoted(text)!r}; commands are {', '.join(names)}, or a recording's file"
                f"{did_you_mean(text, names)}"
            )
        return text


_LAST = 9  # the place of a command that states none
_LOAD = "ema_model.simulation.run"

COMMAND_OR_FILE = _CommandOrFile(
    "the file of a measurement",
    has_side_file=True,
    is_file=lambda name: bool(Path(name).suffix) and name not in command_names(),
)


def add_fit(parser: argparse.ArgumentParser, what: str) -> None:
    """What identify, compare and discover share: the recordings' part to use, and where the result, `what`, goes"""
    add_actuator(parser)
    add_mapping(parser)
    add_part(parser)
    parser.add_argument(
        "--holdout",
        action="append",
        default=[],
        type=HELD_OUT,
        metavar="FILE|RULE",
        help="a recording that is not fitted, to judge the result by, or a rule that takes out those named so: "
        "'kp200*'; repeat for more",
    )
    parser.add_argument(
        "--save-actuator",
        type=SAVED_ACTUATOR,
        metavar="FILE.toml",
        help="write the fitted model as an actuator file",
    )
    add_outputs(parser, what)


def add_part(parser: argparse.ArgumentParser) -> None:
    """--from, --to and --runs: which part of a recording is taken"""
    parser.add_argument("--from", type=FINITE, dest="start_s", metavar="s", help="leave out what lies before")
    parser.add_argument("--to", type=FINITE, dest="stop_s", metavar="s", help="leave out what lies after")
    parser.add_argument(
        "--runs",
        metavar="COLUMN",
        help="the column that numbers the runs of a file: each becomes a recording of its own, NAME#1, NAME#2 …",
    )


def add_outputs(parser: argparse.ArgumentParser, what: str) -> None:
    """--record, --report, --json and --force, of the result, `what`"""
    add_record(parser, what)
    add_report(parser)
    add_json(parser)
    add_force(parser)


def add_units(parser: argparse.ArgumentParser) -> None:
    """--by and --unit; `flow` takes what they give."""
    parser.add_argument(
        "--by",
        metavar="unit|COLUMN",
        help="take units beside each other: a unit is a folder of recordings, or a number in a column of that name",
    )
    parser.add_argument(
        "--unit",
        action="append",
        default=[],
        metavar="NAME=GLOB",
        help="the recordings of one unit, by their names or paths: left='*left*'; repeat for each unit",
    )


def add_actuator(parser: argparse.ArgumentParser) -> None:
    """--actuator"""
    parser.add_argument(
        "--actuator", type=ACTUATOR, metavar="A.toml", help="parameters of the actuator; without it, the thesis's"
    )


def add_faults(parser: argparse.ArgumentParser) -> None:
    """--fault, repeated"""
    parser.add_argument(
        "--fault", action="append", default=[], metavar="k1=0.25", help="a fault k1 … k8 in 0 … 1; repeat for more"
    )


def add_mapping(parser: argparse.ArgumentParser) -> None:
    """--map, repeated; --header-line, --encoding and --rate"""
    parser.add_argument(
        "--map",
        action="append",
        default=[],
        dest="mapping",
        metavar="signal=column",
        help="a column's meaning, with its unit where it is not SI: motor_speed_rad_s=speed[rpm]; #7 is the seventh "
        "column; repeat for more",
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
    parser.add_argument("--rate", type=SAMPLE_RATE, metavar="HZ", help="samples a second, of a file without a time")


def _encoding(text: str) -> str:
    from ema_model.recordings.formats.text_layout import known_encoding  # the readers take a while to import

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
        type=_with_effect,
        metavar="NAME:param=value,…",
        help="a physical effect, or your own torque 'user_torque:expression=c*omega,c=-1e-4'; repeat for more; "
        "without values it is fitted, where anything is",
    )


def _with_effect(text: str) -> str:
    effect_name(text.partition(":")[0])
    return text


def effect_name(text: str) -> str:
    """The type of an argument that names an effect: of the library, or of the user's own kinds."""
    kinds = stated_in("ema_model.effects.user.torque", "TITLES")
    known = [*stated("ema_model.effects", "EFFECT"), *kinds]
    # A model may hold an effect several times: cogging_torque_2.
    if not (
        text in known or re.sub(r"_\d+$", "", text) in known or text.startswith(tuple(f"{kind}_" for kind in kinds))
    ):
        like = did_you_mean(text, known) or "; `emaviz effects` lists them"
        raise argparse.ArgumentTypeError(f"no effect {quoted(text)!r}{like}")
    return text


def add_seed(parser: argparse.ArgumentParser) -> None:
    """--seed"""
    parser.add_argument("--seed", type=SEED, default=0, help="of all random numbers")


def add_json(parser: argparse.ArgumentParser) -> None:
    """--json"""
    parser.add_argument("--json", type=JSON, metavar="FILE.json", help="write the result there")


def add_report(parser: argparse.ArgumentParser) -> None:
    """--report"""
    parser.add_argument(
        "--report", type=REPORT, metavar="FILE.html", help="write a report that opens in any browser, offline"
    )


def add_record(parser: argparse.ArgumentParser, what: str) -> None:
    """--record; what: is written there"""
    parser.add_argument("--record", type=RRD, metavar="FILE.rrd", help=f"write {what} for the Rerun viewer")


def add_run(parser: argparse.ArgumentParser) -> None:
    """What is asked of the actuator: --command, --set, --duration, --load-torque, sensors' accuracy"""
    shapes, time_s, frequency_Hz = (stated_in(_LOAD, fact) for fact in ("SHAPES", "time_s", "frequency_Hz"))
    parser.add_argument(
        "--command",
        type=COMMAND_OR_FILE,
        default="chirp",
        metavar="NAME|FILE",
        help=f"{', '.join(command_names())}, or a recording's command",
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
    parser.add_argument("--load-shape", choices=shapes, default="constant", help="of the load torque over time")
    parser.add_argument(
        "--load-time", type=FINITE, default=time_s, metavar="s", help="of its step, or of its chirp's rise"
    )
    parser.add_argument(
        "--load-frequency", type=FINITE, default=frequency_Hz, metavar="Hz", help="of its sine, or chirp"
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
        help="leave the controller out: the recorded current, torque or force goes in; of a voltage drive, its voltage",
    )
