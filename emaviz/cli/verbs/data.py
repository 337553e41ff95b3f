"""`emaviz data`: recordings of others for the shipped benchmarks: what to fetch, and how they become recordings."""

from __future__ import annotations

import argparse
import os
from typing import TYPE_CHECKING

from ema_model.errors import InputError
from emaviz.cli import options

if TYPE_CHECKING:
    from emaviz.cli.output import DataJson

HELP = "say where the benchmarks' recordings of others come from, and make them of a local copy"
PLACE = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """NAME, --from, --out, --json."""
    parser.add_argument("name", nargs="?", metavar="NAME", help="of a data set; without it, all of them are listed")
    parser.add_argument(
        "--from", dest="copy", type=options.Folder(), metavar="COPY", help="the repository's files, here"
    )
    parser.add_argument(
        "--out", type=options.Folder(), metavar="DIR", help="gets a folder NAME of recordings; else EMAVIZ_DATA says it"
    )
    options.add_json(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from emaviz.cli.output import DataJson

    return (DataJson,)


def run(arguments: argparse.Namespace) -> int:
    """Lists, says, or converts."""
    from ema_model.campaign.data_sets import FOLDER, convert, data_set, data_sets
    from emaviz.cli import output

    if arguments.name is None:
        if arguments.copy or arguments.out:
            raise InputError(f"name a data set: {', '.join(data_sets())}")
        chosen = list(data_sets().values())
    else:
        chosen = [data_set(arguments.name)]
    written = []
    if arguments.name is None:
        for one in chosen:
            print(f"{one.name:14}{one.title}\n{'':14}{one.address}, licence: {one.licence}")
    elif arguments.copy is None:
        (one,) = chosen
        print(f"{one.title}\n{one.address}, licence: {one.licence}\n")
        print("\n".join(one.how_to_get))
        print(f"\n{len(one.files)} files, by SHA-256")
        print("\n".join(f"{digest}  {path}" for path, digest in one.files.items()))
    else:
        out = arguments.out or os.environ.get(FOLDER)
        if not out:
            raise InputError(f"--out DIR, or the environment variable {FOLDER}, names the folder of the recordings")
        written = [str(path) for path in convert(chosen[0], arguments.copy, out)]
        print(f"{len(written)} recordings written into {os.path.dirname(written[0])}")
    numbers: DataJson = {
        "sets": [
            {
                "name": one.name,
                "repository": one.repository,
                "commit": one.commit,
                "licence": one.licence,
                "files": dict(one.files),
            }
            for one in chosen
        ],
        "written": written,
    }
    output.write_json(arguments, numbers)
    return 0
