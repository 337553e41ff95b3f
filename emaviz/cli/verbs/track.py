"""`emaviz track`: k over the flights of one unit, and the life that remains."""

from __future__ import annotations

import argparse
from pathlib import Path

from ema_model.errors import InputError, quoted
from ema_model.tracking.criteria import LEAST_FLIGHTS
from ema_model.tracking.identify import identify_all
from ema_model.tracking.order import check_order, flights_in
from ema_model.tracking.summary import as_dict
from ema_model.tracking.track import check_thresholds, track
from emaviz.cli import files, given, options, output

HELP = "follow k over the flights of one unit: what drifts, and what life remains"
PLACE = 6
_FLIGHT = files.Input("the file of a measurement", has_side_file=True, is_file=lambda name: not Path(name).is_dir())


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of INTERFACES."""
    parser.add_argument(
        "files",
        nargs="+",
        type=_FLIGHT,
        metavar="FOLDER|FILE",
        help="a folder of one unit's recordings, a flight each, or the files in order of time",
    )
    parser.add_argument(
        "--threshold",
        action="append",
        default=[],
        metavar="k2=0.6",
        help="the value of a k at which the life ends; repeat for more",
    )
    options.add_actuator(parser)
    options.add_mapping(parser)
    options.add_record(parser, "k over the flights")
    options.add_report(parser)
    options.add_json(parser)
    files.add_force(parser)
    options.add_seed(parser)


def run(arguments: argparse.Namespace) -> int:
    """Identifies each flight, follows k, writes and prints."""
    thresholds = _thresholds(arguments.threshold)
    paths = _paths(arguments.files)
    actuator = given.actuator_of(arguments)
    progress = output.Progress()
    try:
        flights = list(
            identify_all(
                paths,
                lambda path: given.read_one(str(path), arguments, actuator, progress),
                actuator,
                arguments.seed,
                lambda number, name: progress.show(f"flight {number + 1} of {len(paths)}: {name}"),
            )
        )
        result = track(flights, thresholds, arguments.seed)
        if arguments.record:
            from emaviz.recording.tracking import write_tracking  # rerun takes a second to import

            write_tracking(result, arguments.record, output.configuration(arguments))
        if arguments.report:
            from emaviz.report import write_tracking_report  # plotly takes a second to import

            write_tracking_report(result, actuator.name, arguments.report)
    finally:
        progress.done()
    output.write_json(arguments.json, as_dict(result), arguments.seed, output.configuration(arguments))
    print(result)
    return 0


def _thresholds(texts: list[str]) -> dict[str, float]:
    found: dict[str, float] = {}
    for text in texts:
        name, value = given.pair(text, "--threshold")
        if name in found:
            raise InputError(f"--threshold {name}: given twice; write it once")
        found[name] = value
    check_thresholds(found)
    return found


def _paths(names: list[str]) -> list[Path]:
    named = [Path(name) for name in names]
    folders = [path for path in named if path.is_dir()]
    if folders and len(named) > 1:
        raise InputError(f"{quoted(folders[0])}: is a folder; name one folder alone, or files")
    paths = flights_in(folders[0]) if folders else named
    check_order(paths)
    if len(paths) < LEAST_FLIGHTS:
        flights = "1 flight" if len(paths) == 1 else f"{len(paths)} flights"
        raise InputError(
            f"{quoted(names[0])}: {flights} tell no trend; give {LEAST_FLIGHTS} or more, or use `emaviz identify`"
        )
    return paths
