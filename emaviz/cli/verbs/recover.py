"""`emaviz recover`: a whole recording from one that was cut off."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from ema_model.errors import InputError
from emaviz.cli import options

if TYPE_CHECKING:
    from emaviz.cli.output import RecoveredJson

HELP = "make a whole recording of one that was cut off (FILE.part)"
PLACE = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """FILE.part, --out, --json."""
    parser.add_argument("file", type=options.Input("a recording that was cut off (.part)"), metavar="FILE.part")
    parser.add_argument(
        "--out", type=options.RRD, metavar="FILE.rrd", help="its name; without it, FILE's without .part"
    )
    options.add_json(parser)
    options.add_force(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import RecoveredJson

    return (RecoveredJson,)


def run(arguments: argparse.Namespace) -> int:
    """Recovers it; the part goes once its recording was read."""
    from emaviz.cli import output
    from emaviz.recording import RecordingError
    from emaviz.recording.read import recover_part

    part = Path(arguments.file)
    if part.suffix != ".part":
        raise InputError(f"{part}: a recording that was cut off ends in .part; nothing needs to be recovered")
    target = Path(arguments.out) if arguments.out else part.with_suffix("")
    try:
        recover_part(part, target, replace=arguments.force)
    except RecordingError as error:
        raise InputError(str(error)) from None
    result: RecoveredJson = {"file": str(target), "bytes": target.stat().st_size}
    output.write_json(arguments, result)
    print(f"{target}: recovered from {part.name}, which is removed")
    return 0
