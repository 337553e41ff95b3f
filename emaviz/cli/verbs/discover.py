"""`emaviz discover`: which physical effects are missing, added one after another; the error ladder."""

from __future__ import annotations

import argparse
from dataclasses import replace
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
    from ema_model.discovery import Discovery
    from ema_model.fleet.discovery import UnitsDiscovered
    from ema_model.result import json_type
    from emaviz.cli.output import SavedModelJson

    return (json_type(Discovery, SavedModelJson), json_type(UnitsDiscovered))


def run(arguments: argparse.Namespace) -> int:
    """Discovers, and of units what they lack; once interrupted, what was found so far."""
    from emaviz.cli import flow

    actuator = flow.actuator_of(arguments)
    signals = _CURRENT_ONLY if arguments.signals == "current" else None
    if arguments.by or arguments.unit:
        return flow.run_discovery(arguments, actuator, signals)

    def compute(fitted: list[Measurement], held: list[Measurement], progress: output.Progress) -> flow.Answer:
        # These take a second: recordings are refused before.
        from ema_model.discovery import discover, verified
        from ema_model.discovery.words import verification
        from ema_model.quantities import plain

        with PartialAnswer() as partial:
            found = discover(
                fitted,
                actuator,
                holdout=held,
                signals=signals,
                most_effects=arguments.max_effects,
                on_progress=progress.show,
                stop=partial.is_interrupted,
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

        answer = flow.of_result(found, found.actuator)
        return replace(answer, is_whole=found.verdict != "interrupted", saved=saved)

    return flow.run(arguments, actuator, compute)
