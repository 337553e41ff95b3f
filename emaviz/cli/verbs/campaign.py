"""`emaviz campaign`: the many tasks of a plan, resumable; how far it is; what its rows say."""

from __future__ import annotations

import argparse
import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from ema_model.errors import InputError
from ema_model.files.opened import shown
from emaviz.cli import options
from emaviz.cli.ending import PartialAnswer
from emaviz.cli.options import whole

if TYPE_CHECKING:
    from ema_model.campaign import Status
    from ema_model.campaign.plan import Plan
    from emaviz.cli import output
    from emaviz.cli.output import PlannedJson

HELP = "compute the many tasks of a plan, in processes or on a Dask cluster; status and report of one"
PLACE = 11
_STATUS, _REPORT = "status", "report"
_PLAN = options.Input("a plan (.toml)", is_file=lambda name: bool(Path(name).suffix))


def _address(text: str) -> str:
    """The type of --scheduler."""
    if not re.fullmatch(r"(tcp|tls|ws|wss|ucx)://\S+:\d+", text):
        raise argparse.ArgumentTypeError(f"must be an address such as tcp://127.0.0.1:8786, not {shown(text)!r}")
    return text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """PLAN with where its rows go and who computes them; or status and report with a campaign's folder."""
    parser.usage = (
        "emaviz campaign PLAN --out DIR [--scheduler tcp://HOST:PORT] [--workers N] [--dry-run] [--retry]\n"
        "       emaviz campaign status|report DIR [--json FILE.json]"
    )
    parser.add_argument("plan", type=_PLAN, metavar="PLAN", help="its file, or a shipped one's name; or status, report")
    parser.add_argument("folder", nargs="?", type=options.Folder(), metavar="DIR", help="of status and report")
    parser.add_argument("--out", dest="out", type=options.Folder(), metavar="DIR", help="where the rows are kept")
    parser.add_argument(
        "--scheduler",
        type=_address,
        metavar="tcp://HOST:PORT",
        help="of Dask; without it, processes here. Whoever answers there is trusted: what it sends by pickle is run",
    )
    parser.add_argument("--workers", type=whole(1, 10_000), metavar="N", help="processes here; all cores without it")
    parser.add_argument("--dry-run", action="store_true", help="say what would be computed, and how long it takes")
    parser.add_argument("--retry", action="store_true", help="compute again what ended in an error")
    options.add_json(parser)


def documents() -> tuple[type, ...]:
    """What --json holds: of a campaign, and of what one would compute."""
    from ema_model.campaign.store import Campaign
    from ema_model.result import json_type
    from emaviz.cli.output import InterruptedCampaignJson, PlannedJson

    return (json_type(Campaign, InterruptedCampaignJson), PlannedJson)


def run(arguments: argparse.Namespace) -> int:
    """Computes, or tells."""
    told = arguments.plan in (_STATUS, _REPORT)
    if told != (arguments.folder is not None) or told == (arguments.out is not None):
        raise InputError("campaign takes PLAN --out DIR, or status DIR, or report DIR (see emaviz campaign --help)")
    if arguments.plan == _STATUS:
        return _status(arguments)
    if arguments.plan == _REPORT:
        return _report(arguments)
    if arguments.scheduler and arguments.workers:
        raise InputError("--workers is of processes here; a cluster has the workers that were begun for it")
    from ema_model.campaign import load_plan, plan_path

    plan = load_plan(plan_path(arguments.plan))
    return _dry_run(plan, arguments) if arguments.dry_run else _run(plan, arguments)


def _run(plan: Plan, arguments: argparse.Namespace) -> int:
    from ema_model.campaign import Store, run_plan, scheduler
    from ema_model.campaign.store import Campaign, interrupted
    from emaviz.cli import output

    progress = output.Progress(arguments)
    progress.show("beginning")
    try:
        workers = scheduler(arguments.scheduler, arguments.workers)
        told = _Told(progress, arguments.scheduler)
        with PartialAnswer() as rows:
            rows.grows()
            status = run_plan(plan, arguments.out, workers, retry=arguments.retry, on_progress=told)
    except KeyboardInterrupt:
        progress.done()
        with suppress(InputError):  # there is no folder yet
            store = Store(arguments.out)
            print(interrupted(store), flush=True)
            output.write_json(arguments, {**Campaign(store).to_dict(), "interrupted": True})
        raise
    finally:
        progress.done()
    print(_ended(status, arguments.out))
    output.write_json(arguments, Campaign(Store(arguments.out)).to_dict())
    return 0


class _Told:
    """Shows how far it is; that all workers are gone is a line of its own, once each time."""

    def __init__(self, progress: output.Progress, scheduler: str | None) -> None:
        self._progress, self._scheduler, self._waiting = progress, scheduler, False

    def __call__(self, at: Status) -> None:
        if not at.workers and not self._waiting:
            self._progress.done()
            begin = f"; begin some: `dask worker {self._scheduler} --nthreads 1`" if self._scheduler else ""
            print(f"{at.text}{begin}", file=sys.stderr, flush=True)
        self._waiting = not at.workers
        self._progress.show(at.text)


def _ended(status: Status, folder: str) -> str:
    failed = f", {status.errors} of them errors" if status.errors else ""
    there = f", {status.there} were there" if status.there else ""
    return f"{folder}: {status.total} tasks, {status.computed} computed now{failed}{there}"


def _dry_run(plan: Plan, arguments: argparse.Namespace) -> int:
    """What there is to do, by the seconds that such tasks took where some are there, else by rough ones."""
    from ema_model.campaign import Store, duration, estimate_s, scheduler
    from emaviz.cli import output

    try:
        store = Store(arguments.out)
    except InputError:  # nothing there yet
        store = None
    there = store.names(errors=not arguments.retry) if store else set()
    known = store.seconds() if store else {}
    workers = scheduler(arguments.scheduler, arguments.workers).workers
    total = estimate_s(plan, there, workers, known)
    groups = {task.group: task.kind for task in plan.tasks}
    for group, kind in groups.items():
        tasks = [task for task in plan.tasks if task.group == group]
        left = sum(task.name not in there for task in tasks)
        how = "measured" if group in known else "rough"
        seconds = estimate_s(plan, there | {t.name for t in plan.tasks if t.group != group}, 1, known)
        print(f"{group:28}{kind:10}{left:8} of {len(tasks)}   {duration(seconds)} on one core ({how})")
    print(f"{workers} workers: about {total / 3600.0:.2g} h ({duration(total)})")
    numbers: PlannedJson = {"tasks": len(plan.tasks), "there": len(there), "workers": workers, "seconds": total}
    output.write_json(arguments, numbers)
    return 0


def _status(arguments: argparse.Namespace) -> int:
    from ema_model.campaign import Store
    from ema_model.campaign.store import Campaign, progress_table
    from emaviz.cli import output

    found = Campaign(Store(arguments.folder))
    print(progress_table(found))
    output.write_json(arguments, found.to_dict())
    return 0


def _report(arguments: argparse.Namespace) -> int:
    from ema_model.campaign import Store
    from ema_model.campaign.store import Campaign, report_text
    from emaviz.cli import output

    found = Campaign(Store(arguments.folder))
    print(report_text(found))
    found.export(Path(arguments.folder) / "report.html")
    output.write_json(arguments, found.to_dict())
    return 0
