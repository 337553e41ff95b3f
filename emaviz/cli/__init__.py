"""The command line: one file a command, each with `HELP`, `add_arguments(parser)` and `run(arguments)`.

Exit codes: 0 done, 2 the input or the arguments are wrong (one line on stderr), 1 an internal failure.
"""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

from ema_model.errors import InputError
from emaviz import __version__

COMMANDS = ("gui", "simulate", "identify", "compare", "discover", "effects", "view")


class _Parser(argparse.ArgumentParser):
    """Argparse that tells a mistake in one line."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see {self.prog} --help)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given[:1] != ["--version"] and given[:1] not in (["-h"], ["--help"]) and (not given or given[0] not in COMMANDS):
        given.insert(0, "gui")
    try:
        parsed = _parser(given[0]).parse_args(given)
        return int(parsed.run(parsed) or 0)
    except InputError as error:
        print(f"emaviz: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader of our output went away, as `| head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _parser(wanted: str) -> _Parser:
    parser = _Parser(prog="emaviz", description="Break, watch and identify the model of an electromechanical actuator.")
    parser.add_argument("--version", action="version", version=f"emaviz {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name in COMMANDS if wanted not in COMMANDS else (wanted,):
        module = importlib.import_module(f"emaviz.cli.{name}")
        sub = commands.add_parser(name, help=module.HELP, description=module.HELP)
        module.add_arguments(sub)
        sub.set_defaults(run=module.run)
    return parser
