"""`emaviz reproduce`: the thesis's evaluation beside ours, as a campaign, a report and a recording."""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path

from ema_model.errors import InputError
from emaviz.cli import options
from emaviz.cli.ending import PartialAnswer
from emaviz.cli.options import whole

HELP = "compute the thesis's evaluation anew, and set its numbers beside ours"
PLACE = 12
_PLAN = options.Input("a plan (.toml)", is_file=lambda name: bool(Path(name).suffix))
REPORT, RECORDING = "reproduce.html", "reproduce.rrd"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """--out, --quick, --workers; --plan for a plan of one's own with the same groups."""
    parser.add_argument(
        "--out", required=True, type=options.Folder(), metavar="DIR", help="where the rows, the report and the .rrd go"
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--quick", action="store_true", help="one run of each in place of ten: minutes, not an hour")
    which.add_argument("--plan", type=_PLAN, metavar="PLAN.toml", help="another plan, with groups as `thesis` has them")
    parser.add_argument("--workers", type=whole(1, 10_000), metavar="N", help="processes; all cores without it")
    options.add_json(parser)


def documents() -> tuple[type, ...]:
    """What --json holds."""
    from ema_model.campaign.thesis import Evaluation
    from ema_model.result import json_type

    return (json_type(Evaluation),)


def run(arguments: argparse.Namespace) -> int:
    """Computes what the folder lacks, writes both files, prints the short table."""
    from ema_model.actuator import load_actuator
    from ema_model.campaign import Store, load_plan, run_plan, scheduler
    from ema_model.campaign.plan import plan_path
    from ema_model.campaign.store import interrupted
    from ema_model.campaign.thesis import Evaluation, drawn
    from ema_model.campaign.thesis_words import aligned, answer, short_table
    from emaviz.cli import output

    plan = load_plan(plan_path(arguments.plan or ("thesis_quick" if arguments.quick else "thesis")))
    if "identify" not in {task.kind for task in plan.tasks}:
        raise InputError(f"{arguments.plan}: identifies nothing, so that nothing stands beside the thesis")
    progress = output.Progress(arguments)
    progress.show("beginning")
    try:
        workers = scheduler(None, arguments.workers)
        try:
            with PartialAnswer() as rows:
                rows.grows()
                status = run_plan(plan, arguments.out, workers, on_progress=lambda at: progress.show(at.text))
        except KeyboardInterrupt:
            progress.done()
            with suppress(InputError):  # there is no folder yet
                print(interrupted(Store(arguments.out)), flush=True)
            raise
        progress.show("simulating the responses")
        found = Evaluation(Store(arguments.out), drawn(load_actuator()))
        progress.show("writing the report and the recording")
        folder = Path(arguments.out)
        for name in (REPORT, RECORDING):
            found.export(folder / name)
    finally:
        progress.done()
    output.write_json(arguments, found.to_dict())
    print(aligned(*short_table(found)))
    print("", *answer(found), sep="\n")
    if status.errors:
        print(f"{status.errors} tasks ended in an error; the report lists them")
    print(f"{folder / REPORT}, {folder / RECORDING}")
    return 0
