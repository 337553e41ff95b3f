"""`emaviz`, `emaviz gui`: the app in the browser."""

from __future__ import annotations

import argparse
from pathlib import Path

from emaviz.cli.options import RECORDING, Folder, add_actuator, whole

HELP = "the app in the browser (also without a command)"
PLACE = 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """FILE…, --host, --allow-host, --port, --open, --data-dir, --campaign, --actuator."""
    parser.add_argument("files", nargs="*", type=RECORDING, metavar="FILE", help="recordings to open")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on; the default is this machine only")
    parser.add_argument(
        "--allow-host",
        action="append",
        default=[],
        metavar="NAME",
        help="name or address by which other machines ask for the page, for a --host they reach; repeatable",
    )
    parser.add_argument("--port", type=whole(0, 65535), default=8080)
    parser.add_argument("--open", action=argparse.BooleanOptionalAction, default=True, help="open the browser")
    parser.add_argument("--data-dir", type=Path, default=Path("emaviz-data"), metavar="DIR", help="recordings, uploads")
    parser.add_argument(
        "--campaign", action="append", default=[], type=Folder(), metavar="DIR", help="a campaign to open; repeatable"
    )
    add_actuator(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serves the app until interrupted."""
    from emaviz.page.app import serve

    return serve(arguments)
