"""`emaviz compare`: recordings beside the model, and where it fails."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from ema_model.errors import InputError
from emaviz.cli import files, options

if TYPE_CHECKING:
    from ema_model.comparison import Comparison
    from emaviz.cli import output

HELP = "show where the model fails beside recordings"
PLACE = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES, with the signals to fit."""
    files.add_recordings(parser, "compared", declared=files.UNITS)
    options.add_units(parser)
    options.add_fit(parser, "the comparison")
    parser.add_argument(
        "--calibrate", action=argparse.BooleanOptionalAction, default=True, help="fit the actuator within tolerances"
    )
    parser.add_argument(
        "--free", action="append", metavar="NAME", help="calibrate only these: k1 … k8 or section.name; repeat for more"
    )
    options.add_faults(parser)
    options.add_effects(parser)
    parser.add_argument(
        "--signal",
        action="append",
        dest="signals",
        metavar="NAME[=weight]",
        help="fit only these signals, with a weight (1 is what the noise says); repeat for more",
    )
    options.add_open_loop(parser)
    options.add_seed(parser)


def documents() -> tuple[type, ...]:
    """What --json holds: of recordings, and of units beside each other."""
    from ema_model.comparison.summary import ComparisonJson
    from ema_model.units.result import UnitsComparedJson

    return (ComparisonJson, UnitsComparedJson)


def run(arguments: argparse.Namespace) -> int:
    """Reads, compares, writes and prints."""
    if arguments.save_actuator and not arguments.calibrate:
        raise InputError("--save-actuator writes what the calibration found; leave --no-calibrate out")
    from emaviz.cli import given, output

    actuator = given.actuator_of(arguments)
    if arguments.by or arguments.unit:
        from emaviz.cli import by_unit

        return by_unit.run(arguments, actuator)
    k, weights = given.faults_of(arguments, actuator.faults), given.weights_of(arguments.signals)
    effects = given.effects_of(arguments, actuator.axes)
    progress = output.Progress(arguments)
    try:
        measurements, held = given.read_set(arguments, actuator, progress)
        from ema_model.comparison import as_dict, compare  # takes a second: recordings are refused before

        result = compare(
            measurements,
            actuator,
            k=k,
            effects=effects,
            calibrate=arguments.calibrate,
            free=arguments.free,
            signals=weights,
            holdout=held,
            on_progress=progress.show,
        )
    finally:
        progress.done()
    if result.calibration is not None and arguments.save_actuator:
        from ema_model.actuator import save_actuator

        save_actuator(result.calibration.actuator, arguments.save_actuator)
    output.write_json(arguments, as_dict(result))
    print(result, flush=True)
    _write(result, arguments, progress)
    return 0


def _write(result: Comparison, arguments: argparse.Namespace, progress: output.Progress) -> None:
    """The recording and the report, last: if one fails or is interrupted, the answer is there."""
    try:
        if arguments.record:
            progress.show("recording")
            _record(result, arguments)
        if arguments.report:
            progress.show("writing the report")
            from emaviz.report import write_report  # plotly takes a second to import

            write_report(result, arguments.report)
    finally:
        progress.done()


def _record(result: Comparison, arguments: argparse.Namespace) -> None:
    from emaviz.cli import output
    from emaviz.recording import RecordingError
    from emaviz.recording.comparison import write_comparison

    try:
        write_comparison(result, arguments.record, output.configuration(arguments))
    except RecordingError as error:
        raise InputError(str(error)) from None
