"""The command line's parser: one file a command, with `HELP`, `add_arguments(parser)` and `run(arguments)`."""

from __future__ import annotations

import argparse
import importlib
from functools import partial
from types import ModuleType
from typing import Any, NoReturn

import emaviz
from ema_model.errors import InputError
from emaviz.cli import COMMANDS
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
    parser = Parser(prog="emaviz", description="Break, watch and identify the model of an electromechanical actuator.")
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name in COMMANDS if wanted not in COMMANDS else (wanted,):
        command = importlib.import_module(f"emaviz.cli.{name}")
        sub = commands.add_parser(name, help=command.HELP, description=command.HELP)
        command.add_arguments(sub)
        sub.set_defaults(run=partial(_run, command, sub))
    return parser


def _run(command: ModuleType, parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> int:
    check_files(parser, arguments)
    return command.run(arguments)
