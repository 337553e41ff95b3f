"""`emaviz actuator`: describe an actuator in a file, check one, and read what its keys mean.

One file a verb, each with `HELP`, `add_arguments(parser)` and `run(arguments)`.
"""

from __future__ import annotations

import argparse
from importlib import import_module

from ema_model.members import stated
from emaviz.cli.parser import add_verbs

HELP = "describe an actuator in a file, check one, or read what every key of it means"
PLACE = 7


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The verbs with their own options."""
    verbs = parser.add_subparsers(title="what to do", metavar="new|check|keys", dest="verb", required=True)
    add_verbs(verbs, {name: import_module(f"{__name__}.{name}") for name in stated(__name__, "HELP")}, "run_verb")


def run(arguments: argparse.Namespace) -> int:
    """Runs the verb."""
    run_verb = vars(arguments).pop("run_verb")  # not one of the options that results repeat
    return run_verb(arguments)
