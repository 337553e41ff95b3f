"""The verbs of `ema_model.analyses`, made of what each engine states; and where any verb is found by its name."""

from __future__ import annotations

import argparse
import importlib
from typing import TYPE_CHECKING, Any

from ema_model.analyses import Analysis, analyses
from emaviz.cli import options

if TYPE_CHECKING:
    from ema_model.recordings import Measurement
    from emaviz.cli import flow, output


def verb_of(name: str) -> Any:
    """What has the `HELP`, `PLACE`, `add_arguments` and `run` of a command: its file in `verbs`, or an analysis."""
    known = analyses()
    return AnalysisVerb(known[name]) if name in known else importlib.import_module(f"emaviz.cli.verbs.{name}")


class AnalysisVerb:
    """`emaviz NAME FILE…` of an analysis: its options, its answer printed, and as JSON, report and recording."""

    def __init__(self, analysis: Analysis) -> None:
        self._analysis = analysis
        self.HELP, self.PLACE = analysis.help, analysis.place

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """The analysis's own, and those that all that read recordings have."""
        options.add_recordings(parser, "taken")
        for name, one in self._analysis.options.items():
            usual, choices = next(iter(one.choices)), tuple(one.choices)
            parser.add_argument(f"--{name}", choices=choices, default=usual, help=one.help)
        options.add_actuator(parser)
        options.add_mapping(parser)
        options.add_part(parser)
        options.add_outputs(parser, f"the {self._analysis.title[:1].lower()}{self._analysis.title[1:]}")
        options.add_open_loop(parser)
        parser.set_defaults(holdout=[])  # nothing is fitted

    def documents(self) -> tuple[type, ...]:
        """What --json holds."""
        from ema_model.result import json_type

        return (json_type(self._analysis.result),)

    def run(self, arguments: argparse.Namespace) -> int:
        """Reads, analyses, writes and prints."""
        from emaviz.cli import flow, option_values

        actuator = option_values.actuator_of(arguments)
        chosen = {name: getattr(arguments, name) for name in self._analysis.options}

        def compute(recordings: list[Measurement], _: list[Measurement], progress: output.Progress) -> flow.Answer:
            return flow.of_result(self._analysis.analyse(recordings, actuator, **chosen, on_progress=progress.show))

        return flow.run(arguments, actuator, compute)
