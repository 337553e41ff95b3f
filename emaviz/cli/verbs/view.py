"""`emaviz view`: a recording in the Rerun viewer, in the browser, without a network."""

from __future__ import annotations

import argparse

from ema_model.errors import InputError
from emaviz.cli.options import Input, whole

HELP = "open a .rrd recording in the Rerun viewer (in the browser, no network needed)"
PLACE = 9


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """FILE.rrd, --port, --open."""
    parser.add_argument("file", type=Input("a .rrd file"), metavar="FILE.rrd")
    parser.add_argument("--port", type=whole(0, 65535), default=0, help="0 takes a free one")
    parser.add_argument("--open", action=argparse.BooleanOptionalAction, default=True, help="open the browser")


def run(arguments: argparse.Namespace) -> int:
    """Serves the viewer until interrupted."""
    from emaviz.recording import RecordingError
    from emaviz.recording.viewer import view

    try:
        view(arguments.file, open_browser=arguments.open, port=arguments.port)
    except RecordingError as error:
        raise InputError(str(error)) from None
    return 0
