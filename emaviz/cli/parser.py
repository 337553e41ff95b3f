"""The command line's parser, of what each verb's file states: its `HELP`, its `PLACE` in the list, and its options."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Iterable
from functools import partial
from types import ModuleType
from typing import Any, NoReturn

import emaviz
from ema_model.errors import InputError
from emaviz.cli import COMMANDS
from emaviz.cli.exit_code import EXIT_CODES
from emaviz.cli.files import check_files


class Parser(argparse.ArgumentParser):
    """Argparse that tells a mistake in one line."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")


class _Version(argparse.Action):
    """--version, which is looked up when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        print(f"emaviz {emaviz.__version__}")
        parser.exit()


def parser_of(wanted: str) -> Parser:
    """The parser with the wanted command alone, or with all of them; `run` of what it parses runs the command."""
    about = "Break, watch and identify the model of an electromechanical actuator."
    parser = Parser(prog="emaviz", description=about, epilog=EXIT_CODES)
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    add_verbs(commands, "emaviz.cli.verbs", COMMANDS if wanted not in COMMANDS else (wanted,), "run")
    return parser


def add_verbs(to: Any, package: str, verbs: Iterable[str], run: str) -> None:
    """Parsers of the verbs of a package, in their order; what is to be run is the `run` of what they parse."""
    modules = {name: importlib.import_module(f"{package}.{name}") for name in verbs}
    for name, verb in sorted(modules.items(), key=lambda one: one[1].PLACE):
        sub = to.add_parser(name, help=verb.HELP, description=verb.HELP)
        sub.epilog = _ending(verb, sub.prog)
        verb.add_arguments(sub)
        sub.set_defaults(**{run: partial(_run, verb, sub)})


def _ending(verb: ModuleType, command: str) -> str:
    """The last line of --help; command: "emaviz compare"."""
    if not hasattr(verb, "documents"):
        return EXIT_CODES
    return f"{EXIT_CODES}.  Fields of --json: emaviz schema {command.removeprefix('emaviz ')}"


def _run(verb: ModuleType, parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> int:
    check_files(parser, arguments)
    return verb.run(arguments)
