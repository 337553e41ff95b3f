"""The command line's parser, of what each verb states: its `HELP`, its `PLACE` in the list, and its options."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

import emaviz
from ema_model.analyses import Analysis, analyses
from ema_model.errors import InputError, did_you_mean, quoted
from emaviz.cli import COMMANDS, options
from emaviz.cli.ending import EXIT_CODES
from emaviz.cli.options import check_files

if TYPE_CHECKING:
    from ema_model.recordings import Measurement
    from emaviz.cli import flow, output


# --- the verbs of `ema_model.analyses`, made of what each engine states; and where any verb is found by its name ------


def verb_of(name: str) -> Any:
    """What has the `HELP`, `PLACE`, `add_arguments` and `run` of a command: its file in `verbs`, or an analysis."""
    known = analyses()
    return AnalysisVerb(known[name]) if name in known else importlib.import_module(f"emaviz.cli.verbs.{name}")


class AnalysisVerb:
    """`emaviz NAME FILE…` of an analysis: its options, its answer printed, and as JSON, report and recording."""

    def __init__(self, analysis: Analysis) -> None:
        self._analysis = analysis
        self.HELP, self.PLACE = analysis.help, analysis.place

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """The analysis's own, and those that all that read recordings have."""
        options.add_recordings(parser, "taken")
        for name, one in self._analysis.options.items():
            usual, choices = next(iter(one.choices)), tuple(one.choices)
            parser.add_argument(f"--{name}", choices=choices, default=usual, help=one.help)
        options.add_actuator(parser)
        options.add_mapping(parser)
        options.add_part(parser)
        options.add_outputs(parser, f"the {self._analysis.title[:1].lower()}{self._analysis.title[1:]}")
        options.add_open_loop(parser)
        parser.set_defaults(holdout=[])  # nothing is fitted

    def documents(self) -> tuple[type, ...]:
        """What --json holds."""
        from ema_model.result import json_type

        return (json_type(self._analysis.result),)

    def run(self, arguments: argparse.Namespace) -> int:
        """Reads, analyses, writes and prints."""
        from emaviz.cli import flow

        actuator = flow.actuator_of(arguments)
        chosen = {name: getattr(arguments, name) for name in self._analysis.options}

        def compute(recordings: list[Measurement], _: list[Measurement], progress: output.Progress) -> flow.Answer:
            return flow.of_result(self._analysis.analyse(recordings, actuator, **chosen, on_progress=progress.show))

        return flow.run(arguments, actuator, compute)


# --- the parser -------------------------------------------------------------------------------------------------------
# Nothing that computes is imported for it: the help, the completion and a refusal come at once.


class Parser(argparse.ArgumentParser):
    """Argparse that tells a mistake in one line, which points to what is like it and to the help of the verb."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = [str(one) for one in action.choices]
            like = did_you_mean(value, names)
            problem = f"{quoted(value)!r} is none of {', '.join(names)}{like}"
            raise argparse.ArgumentError(action, problem)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Refuses what is not known here, where the options are, and not in the parser of the whole program."""
        given = sys.argv[1:] if args is None else list(args)
        if self._subparsers is None:
            self._refuse_unknown(given)
            given = self._files_together(given)
        parsed, rest = super().parse_known_args(given, namespace)
        if rest:
            self.error(f"unexpected {' '.join(map(quoted, rest))}")
        return parsed, rest

    def _refuse_unknown(self, given: Sequence[str]) -> None:
        """Before anything else: a mistyped option is not a missing one."""
        for text in given[: given.index("--")] if "--" in given else given:
            name = text.partition("=")[0]
            if name.startswith("--") and " " not in name and not any(o.startswith(name) for o in self.option_names):
                self.error(f"no option {quoted(name)}{did_you_mean(name, self.option_names)}")

    def _files_together(self, given: Sequence[str]) -> list[str]:
        """The same with all that is no option behind the options: argparse takes a list of files in one piece only."""
        options: list[str] = []
        others: list[str] = []
        rest = list(given)
        while rest:
            text = rest.pop(0)
            if text == "--":
                return [*options, *others, text, *rest]
            if not text.startswith("-") or text == "-" or _is_number(text):
                others.append(text)
                continue
            options.append(text)
            name, equals, _ = text.partition("=")
            every = self._option_string_actions
            action = every.get(name) or next((every[option] for option in every if option.startswith(name)), None)
            if action is not None and action.nargs is None and not equals and rest:
                options.append(rest.pop(0))
        return [*options, *others]

    @property
    def option_names(self) -> list[str]:
        """The long ones, in order."""
        return [name for name in self._option_string_actions if name.startswith("--")]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


class _Version(argparse.Action):
    """--version, which is looked up when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print(f"emaviz {emaviz.__version__}")
        parser.exit()


def parser_of(wanted: str) -> Parser:
    """The parser with the wanted command alone; of another word, with the list of all commands without their options.

    `run` of what it parses runs the command.
    """
    known = wanted in COMMANDS
    return _parser((wanted,) if known else COMMANDS, with_options=known)


def whole_parser() -> Parser:
    """The parser with all commands and all their options."""
    return _parser(COMMANDS, with_options=True)


def _parser(verbs: Iterable[str], *, with_options: bool) -> Parser:
    about = "Break, watch and identify the model of an electromechanical actuator."
    parser = Parser(prog="emaviz", description=about, epilog=EXIT_CODES)
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    _add_verbose(parser)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    add_verbs(commands, {name: verb_of(name) for name in verbs}, "run", with_options=with_options)
    return parser


def add_verbs(to: Any, verbs: Mapping[str, Any], run: str, *, with_options: bool = True) -> None:
    """Parsers of these verbs by name, in their order; what is to be run is the `run` of what they parse."""
    for name, verb in sorted(verbs.items(), key=lambda one: one[1].PLACE):
        sub = to.add_parser(name, help=verb.HELP, description=verb.HELP)
        if with_options:
            sub.epilog = _ending(verb, sub.prog)
            verb.add_arguments(sub)
            _add_verbose(sub)
            sub.add_argument(
                "-q", "--quiet", action="store_true", default=argparse.SUPPRESS, help="say nothing of how far it is"
            )
        sub.set_defaults(**{run: partial(_run, verb, sub)})


def _add_verbose(to: argparse.ArgumentParser) -> None:
    to.add_argument(
        *("-v", "--verbose"),
        action="store_true",
        default=argparse.SUPPRESS,  # given before the command, it holds as well
        help="say on stderr what is done, and when; of an internal failure, where",
    )


def _ending(verb: Any, command: str) -> str:
    """The last line of --help; command: "emaviz compare"."""
    if not hasattr(verb, "documents"):
        return EXIT_CODES
    return f"{EXIT_CODES}.  Fields of --json: emaviz schema {command.removeprefix('emaviz ')}"


def _run(verb: Any, parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> int:
    check_files(parser, arguments)
    return verb.run(arguments)
