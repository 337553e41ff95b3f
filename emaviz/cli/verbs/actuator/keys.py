"""`emaviz actuator keys`: the reference of every key of an actuator file."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING, cast

from emaviz.cli import options

if TYPE_CHECKING:
    from emaviz.cli.output import KeysJson

HELP = "print the reference of every key of an actuator file, as Markdown"
PLACE = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """--json."""
    options.add_json(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import KeysJson

    return (KeysJson,)


def run(arguments: argparse.Namespace) -> int:
    """Prints it."""
    from ema_model.actuator.reference import markdown, parameter_rows
    from emaviz.cli import output

    print(markdown())
    document = cast("KeysJson", {"parameters": [asdict(row) for row in parameter_rows()]})
    output.write_json(arguments, document)
    return 0
