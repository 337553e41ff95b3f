"""`emaviz discover`: which physical effects are missing, added one after another; the error ladder."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from emaviz.cli import files, options
from emaviz.cli.exit_code import ExitCode
from emaviz.cli.interrupt import PartialAnswer
from emaviz.cli.options import whole

if TYPE_CHECKING:
    from ema_model.discovery import Discovery

HELP = "find the physical effects that the model lacks, and add them"
PLACE = 5
_CURRENT_ONLY = ("current_A",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES."""
    files.add_recordings(parser, "fitted", declared=files.UNITS)
    options.add_units(parser)
    options.add_fit(parser, "the discovery")
    parser.add_argument("--signals", choices=("current", "all"), default="all", help="what is fitted")
    parser.add_argument("--max-effects", type=whole(0, 100), default=3, metavar="N", help="at most so many are added")
    options.add_open_loop(parser)
    options.add_seed(parser)


def documents() -> tuple[type, ...]:
    """What --json holds: of recordings, and of units beside each other."""
    from ema_model.discovery.words import DiscoveryJson
    from ema_model.units.discovery.summary import UnitsDiscoveredJson

    return (DiscoveryJson, UnitsDiscoveredJson)


def run(arguments: argparse.Namespace) -> int:
    """Reads, discovers, writes and prints; once interrupted, what was found so far."""
    from emaviz.cli import given, output

    actuator = given.actuator_of(arguments)
    signals = _CURRENT_ONLY if arguments.signals == "current" else None
    if arguments.by or arguments.unit:
        from emaviz.cli import by_unit

        return by_unit.run_discovery(arguments, actuator, signals)
    progress = output.Progress(arguments)
    try:
        fitted, held = given.read_set(arguments, actuator, progress)
        # These take a second: recordings are refused before.
        from ema_model.actuator import save_actuator
        from ema_model.comparison.summary import plain
        from ema_model.discovery import as_dict, discover, verified
        from ema_model.discovery.words import verification

        with PartialAnswer() as answer:
            found = discover(
                fitted,
                actuator,
                holdout=held,
                signals=signals,
                most_effects=arguments.max_effects,
                on_progress=progress.show,
                stop=answer.is_interrupted,
            )
        told, document = str(found), as_dict(found)
        is_whole = found.verdict != "interrupted"
        if arguments.save_actuator and is_whole:
            save_actuator(found.actuator, arguments.save_actuator)
            progress.show("simulating the saved model")
            saved = verified(found, arguments.save_actuator)
            told += f"\n\nsaved {arguments.save_actuator}, {verification(found, saved)}"
            document["saved_actuator"] = {
                "file": arguments.save_actuator,
                "verified_rmse": saved.rmse,
                "verified_holdout_rmse": saved.holdout_rmse,
            }
    finally:
        progress.done()
    output.write_json(arguments, plain(document))
    print(told)
    if not is_whole:
        output.say_not_written(arguments, "save_actuator")
    _write(found, arguments)
    return ExitCode.DONE if is_whole else ExitCode.INTERRUPTED


def _write(found: Discovery, arguments: argparse.Namespace) -> None:
    """The recording and the report, last: if one fails, the answer is there."""
    from emaviz.cli import output

    if arguments.record:
        from emaviz.recording.discovery import write_discovery  # rerun takes a second to import

        write_discovery(found, arguments.record, output.configuration(arguments))
    if arguments.report:
        from emaviz.report import write_discovery_report  # as does plotly

        write_discovery_report(found, arguments.report, output.configuration(arguments))
