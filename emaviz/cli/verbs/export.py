"""`emaviz export`: the corrected model for other tools, each replayed on recordings with its loss."""

from __future__ import annotations

import argparse

from ema_model.members import stated_in
from emaviz.cli import options

HELP = "take the model home: as C, FMU, MJCF or Python, each replayed on recordings with its loss"
PLACE = 7


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """ACTUATOR, the targets, the recordings of the proof, the folder."""
    parser.add_argument("actuator", type=options.ACTUATOR, metavar="ACTUATOR.toml", help="the model to take home")
    options.add_recordings(parser, "replayed one after another", nargs="*")
    parser.add_argument(
        "--to",
        action="append",
        required=True,
        choices=stated_in("ema_model.exports.export", "NAMES"),
        help="what to write; repeat for more",
    )
    parser.add_argument(
        "--out", required=True, type=options.Folder(), metavar="DIR", help="the folder to write, new or empty"
    )
    parser.add_argument("--name", default="", metavar="NAME", help="of files and functions; the actuator's without it")
    parser.add_argument(
        "--fmi", choices=stated_in("ema_model.exports.fmu", "VERSIONS"), default="3.0", help="the version of an FMU"
    )
    options.add_mapping(parser)
    options.add_report(parser)
    options.add_json(parser)
    parser.set_defaults(runs=None, start_s=None, stop_s=None)  # recordings are replayed as they are


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from ema_model.exports.replay import Export
    from ema_model.result import json_type

    return (json_type(Export),)


def run(arguments: argparse.Namespace) -> int:
    """Reads, writes, replays."""
    from ema_model.exports.export import check_folder

    check_folder(arguments.out)  # before recordings are read
    from ema_model.actuator import load_actuator
    from ema_model.exports.export import export
    from ema_model.recordings.recording_set import files_of
    from emaviz.cli import flow, output

    actuator = load_actuator(arguments.actuator)
    progress = output.Progress(arguments)
    try:
        names = [name for text in arguments.files for name in files_of(text)]
        recordings = flow.read_files(names, arguments, actuator, progress)
        result = export(
            actuator,
            arguments.to,
            recordings,
            arguments.out,
            name=arguments.name,
            fmi=arguments.fmi,
            on_progress=progress.show,
        )
        return flow.finish(arguments, flow.of_result(result), progress)
    finally:
        progress.done()
