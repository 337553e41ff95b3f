"""Options that verbs share, and what they give."""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ema_model.errors import did_you_mean, quoted
from ema_model.files.opened import shown
from ema_model.members import stated, stated_in
from emaviz.cli import files

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
    names, places = stated("ema_model.commands", "name"), stated("ema_model.commands", "place")
    del names["recorded"]  # which is made from a file
    return tuple(names[file] for file in sorted(names, key=lambda file: (places.get(file, _LAST), names[file])))


@dataclass(frozen=True)
class _CommandOrFile(files.Input):
    """The type of an option that takes a command's name, or a recording's file."""

    def __call__(self, text: str) -> str:
        if not self.is_file(text) and text not in (names := command_names()):
            raise argparse.ArgumentTypeError(
                f"no command {quoted(text)!r}; commands are {', '.join(names)}, or a recording's file"
                f"{did_you_mean(text, names)}"
            )
        return text


_LAST = 9  # the place of a command that states none
_LOAD = "ema_model.simulation.load_profile"

COMMAND_OR_FILE = _CommandOrFile(
    "the file of a measurement",
    has_side_file=True,
    is_file=lambda name: bool(Path(name).suffix) and name not in command_names(),
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


def add_units(parser: argparse.ArgumentParser) -> None:
    """--by and --unit; `by_unit` takes what they give."""
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
        "--actuator", type=files.ACTUATOR, metavar="A.toml", help="parameters of the actuator; without it, the thesis's"
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
    kinds = stated_in("ema_model.effects.user.entries", "TITLES")
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
