"""`emaviz track`: k over the flights of one unit, and the life that remains."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ema_model.errors import InputError, quoted
from emaviz.cli import options
from emaviz.cli.ending import PartialAnswer

if TYPE_CHECKING:
    from ema_model.actuator import Actuator
    from ema_model.tracking.flights import Flight
    from emaviz.cli import output

HELP = "follow k over the flights of one unit: what drifts, and what life remains"
PLACE = 6
_FLIGHT = options.Input("the file of a measurement", has_side_file=True, is_file=lambda name: not Path(name).is_dir())


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
    parser.add_argument(
        "--watch", action="store_true", help="go on, and take up each flight that arrives in the folder; Ctrl-C ends it"
    )
    options.add_actuator(parser)
    options.add_mapping(parser)
    options.add_record(parser, "k over the flights")
    options.add_report(parser)
    options.add_json(parser)
    options.add_force(parser)
    options.add_seed(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from ema_model.result import json_type
    from ema_model.tracking.track import Tracked
    from emaviz.cli.output import InterruptedTrackJson

    return (json_type(Tracked, InterruptedTrackJson),)


def run(arguments: argparse.Namespace) -> int:
    """Identifies each flight, follows k, writes and prints; again for each that arrives, if it shall watch.

    Once interrupted, what the flights so far say.
    """
    from emaviz.cli import flow, output

    thresholds = _thresholds(arguments.threshold)
    actuator = flow.actuator_of(arguments)
    progress = output.Progress(arguments)
    try:
        if arguments.watch:
            _watch(arguments, actuator, thresholds, progress)
        else:
            paths = _paths(arguments.files)
            flights: list[Flight] = []
            try:
                with PartialAnswer() as answer:
                    for flight in _identified(paths, arguments, actuator, progress):
                        flights.append(flight)
                        answer.grows()
            except KeyboardInterrupt:
                from ema_model.tracking.trends import LEAST_FLIGHTS

                progress.done()
                print(f"Interrupted: {len(flights)} of {len(paths)} flights are identified.", flush=True)
                if sum(not one.excluded for one in flights) >= LEAST_FLIGHTS:
                    _tell(flights, arguments, actuator, thresholds, progress, of=len(paths))
                else:
                    print(f"A trend needs {LEAST_FLIGHTS} usable flights or more.")
                    output.say_not_written(arguments, "record", "report", "json")
                raise
            _tell(flights, arguments, actuator, thresholds, progress)
    finally:
        progress.done()
    return 0


def _identified(
    paths: Sequence[Path], arguments: argparse.Namespace, actuator: Actuator, progress: output.Progress
) -> Iterator[Flight]:
    from ema_model.tracking.flights import identify_all
    from emaviz.cli import flow

    return identify_all(
        paths,
        lambda path: flow.read_one(str(path), arguments, actuator, progress),
        actuator,
        arguments.seed,
        lambda number, name: progress.show(f"flight {number + 1} of {len(paths)}: {name}", number / len(paths)),
        lambda line: flow.say(line, progress),
    )


def _tell(
    flights: Sequence[Flight],
    arguments: argparse.Namespace,
    actuator: Actuator,
    thresholds: Mapping[str, float],
    progress: output.Progress,
    of: int | None = None,
) -> None:
    """Writes and prints what flights say; of: as many as there would have been without an interrupt."""
    from ema_model.tracking.track import track
    from emaviz.cli import flow

    answer = flow.of_result(replace(track(flights, thresholds, arguments.seed), actuator=actuator.name))
    if of is not None:
        more = {"interrupted": True, "flights_identified": len(flights), "flights_named": of}
        answer = replace(answer, document={**answer.document, **more})
    flow.finish(arguments, answer, progress)


def _watch(
    arguments: argparse.Namespace, actuator: Actuator, thresholds: Mapping[str, float], progress: output.Progress
) -> None:
    """Until it is interrupted; a file that cannot be used is told once and left out, and may be replaced."""
    from ema_model.files.opened import LOOK_S, Watched
    from ema_model.recordings.recording_set import recordings_in
    from ema_model.tracking.flights import check_order, in_order
    from ema_model.tracking.trends import LEAST_FLIGHTS
    from emaviz.cli import flow

    folder = Path(arguments.files[0])
    if len(arguments.files) > 1 or not folder.is_dir():
        raise InputError(f"--watch: {quoted(arguments.files[0])}: name one folder, in which flights arrive")
    watched = Watched()
    flights: dict[Path, Flight] = {}
    print(f"watching {folder}; Ctrl-C ends it", file=sys.stderr)
    try:
        while True:
            new = watched.arrived(recordings_in(folder))
            for path in new:
                flights.pop(path, None)  # it may have been replaced
                try:
                    check_order(in_order([*flights, path]))
                    flights |= zip([path], _identified([path], arguments, actuator, progress))
                except InputError as error:
                    flow.say(f"{error}; left out", progress)
            if len(flights) < LEAST_FLIGHTS:
                progress.show(f"{len(flights)} of the {LEAST_FLIGHTS} flights that a trend needs")
            elif any(path in flights for path in new):
                _tell([flights[path] for path in in_order(flights)], arguments, actuator, thresholds, progress)
            time.sleep(LOOK_S)
    except KeyboardInterrupt:  # how a watch ends
        return


def _thresholds(texts: list[str]) -> dict[str, float]:
    if not texts:
        return {}
    from ema_model.tracking.track import check_thresholds
    from emaviz.cli import flow

    found: dict[str, float] = {}
    for text in texts:
        name, value = flow.pair(text, "--threshold")
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
    from ema_model.tracking.flights import check_enough, check_order, flights_in

    paths = flights_in(folders[0]) if folders else named
    check_order(paths)
    check_enough(paths, names[0])
    return paths
