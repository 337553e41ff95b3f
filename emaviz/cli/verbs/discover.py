"""`emaviz discover`: which physical effects are missing, added one after another; the error ladder."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from emaviz.cli import options
from emaviz.cli.ending import PartialAnswer
from emaviz.cli.options import whole

if TYPE_CHECKING:
    from ema_model.recordings import Measurement
    from emaviz.cli import flow, output

HELP = "find the physical effects that the model lacks, and add them"
PLACE = 5
_CURRENT_ONLY = ("current_A",)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES."""
    options.add_recordings(parser, "fitted", declared=options.UNITS)
    options.add_units(parser)
    options.add_fit(parser, "the discovery")
    parser.add_argument("--signals", choices=("current", "all"), default="all", help="what is fitted")
    parser.add_argument("--max-effects", type=whole(0, 100), default=100, metavar="N", help="at most so many are added")
    options.add_open_loop(parser)
    options.add_seed(parser)


def documents() -> tuple[type, ...]:
    """What --json holds: of recordings, and of units beside each other."""
    from ema_model.discovery.words import DiscoveryJson
    from ema_model.fleet.discovery import UnitsDiscoveredJson

    return (DiscoveryJson, UnitsDiscoveredJson)


def run(arguments: argparse.Namespace) -> int:
    """Discovers, and of units what they lack; once interrupted, what was found so far."""
    from emaviz.cli import flow, option_values

    actuator = option_values.actuator_of(arguments)
    signals = _CURRENT_ONLY if arguments.signals == "current" else None
    if arguments.by or arguments.unit:
        from emaviz.cli import by_unit

        return by_unit.run_discovery(arguments, actuator, signals)

    def compute(fitted: list[Measurement], held: list[Measurement], progress: output.Progress) -> flow.Answer:
        # These take a second: recordings are refused before.
        from ema_model.discovery import as_dict, discover, verified
        from ema_model.discovery.words import verification
        from ema_model.quantities.numbers import plain

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

        def saved() -> tuple[str, dict[str, Any]]:
            """The saved model, simulated again, in words and as JSON."""
            again = verified(found, arguments.save_actuator)
            of_saved = {
                "file": arguments.save_actuator,
                "verified_rmse": again.rmse,
                "verified_holdout_rmse": again.holdout_rmse,
            }
            return f"saved {arguments.save_actuator}, {verification(found, again)}", {"saved_actuator": plain(of_saved)}

        def record(path: str, configuration: Mapping[str, Any]) -> None:
            from emaviz.recording.discovery import write_discovery

            write_discovery(found, path, configuration)

        def report(path: str, configuration: Mapping[str, Any]) -> None:
            from emaviz.report import write_discovery_report

            write_discovery_report(found, path, configuration)

        is_whole = found.verdict != "interrupted"
        return flow.Answer(found, plain(as_dict(found)), found.actuator, record, report, is_whole, saved)

    return flow.run(arguments, actuator, compute)
