"""`emaviz actuator`: describe an actuator in a file, check one, and read what its keys mean.

One file a verb, each with `HELP`, `add_arguments(parser)` and `run(arguments)`.
"""

from __future__ import annotations

import argparse
import importlib
from functools import partial
from types import ModuleType

from emaviz.cli.files import check_files

HELP = "describe an actuator in a file, check one, or read what every key of it means"
VERBS = ("new", "check", "keys")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The verbs with their own options."""
    verbs = parser.add_subparsers(title="what to do", metavar="new|check|keys", dest="verb", required=True)
    for name in VERBS:
        verb = importlib.import_module(f"{__name__}.{name}")
        sub = verbs.add_parser(name, help=verb.HELP, description=verb.HELP)
        verb.add_arguments(sub)
        sub.set_defaults(run_verb=partial(_run, verb, sub))


def run(arguments: argparse.Namespace) -> int:
    """Runs the verb."""
    run_verb = vars(arguments).pop("run_verb")  # not one of the options that results repeat
    return run_verb(arguments)


def _run(verb: ModuleType, parser: argparse.ArgumentParser, arguments: argparse.Namespace) -> int:
    check_files(parser, arguments)
    return verb.run(arguments)
