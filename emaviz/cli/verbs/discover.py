"""`emaviz discover`: which physical effects are missing, added one after another; the error ladder."""

from __future__ import annotations

import argparse

from ema_model.actuator import save_actuator
from ema_model.comparison.summary import plain
from ema_model.discovery import Discovery, as_dict, discover, verified
from ema_model.discovery.words import verification
from emaviz.cli import by_unit, files, given, options, output
from emaviz.cli.numbers import whole

HELP = "find the physical effects that the model lacks, and add them"
PLACE = 5
_CURRENT_ONLY = ("current_A",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES."""
    files.add_recordings(parser, "fitted", declared=files.UNITS)
    by_unit.add_units(parser)
    options.add_fit(parser, "the discovery")
    parser.add_argument("--signals", choices=("current", "all"), default="all", help="what is fitted")
    parser.add_argument("--max-effects", type=whole(0, 100), default=3, metavar="N", help="at most so many are added")
    options.add_open_loop(parser)
    options.add_seed(parser)


def documents() -> tuple[type, ...]:
    """What --json holds: of recordings, and of units beside each other."""
    from ema_model.discovery.shown.summary import DiscoveryJson
    from ema_model.units.discovery.summary import UnitsDiscoveredJson

    return (DiscoveryJson, UnitsDiscoveredJson)


def run(arguments: argparse.Namespace) -> int:
    """Reads, discovers, writes and prints."""
    actuator = given.actuator_of(arguments)
    signals = _CURRENT_ONLY if arguments.signals == "current" else None
    if by_unit.is_asked(arguments):
        return by_unit.run_discovery(arguments, actuator, signals)
    progress = output.Progress()
    try:
        fitted, held = given.read_set(arguments, actuator, progress)
        found = discover(
            fitted,
            actuator,
            holdout=held,
            signals=signals,
            most_effects=arguments.max_effects,
            on_progress=progress.show,
        )
        told, document = str(found), as_dict(found)
        if arguments.save_actuator:
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
    _write(found, arguments)
    return 0


def _write(found: Discovery, arguments: argparse.Namespace) -> None:
    """The recording and the report, last: if one fails, the answer is there."""
    if arguments.record:
        from emaviz.recording.discovery.write import write_discovery  # rerun takes a second to import

        write_discovery(found, arguments.record, output.configuration(arguments))
    if arguments.report:
        from emaviz.report import write_discovery_report  # as does plotly

        write_discovery_report(found, arguments.report, output.configuration(arguments))
