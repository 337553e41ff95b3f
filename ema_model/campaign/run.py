"""Runs a plan into a folder: what has no row yet is computed, by whatever workers there are."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from ema_model.campaign.kinds import KINDS
from ema_model.campaign.plan import Plan
from ema_model.campaign.rows import common
from ema_model.campaign.schedulers import Died, Outcome, Scheduler
from ema_model.campaign.store import Store, header_of, version
from ema_model.campaign.task import Task

Progress = Callable[["Status"], None]


@dataclass
class Status:
    """How far a campaign is."""

    total: int
    there: int  # rows that an earlier run had made
    computed: int = 0
    errors: int = 0
    workers: int = 0
    started_s: float = field(default_factory=time.monotonic)
    left_s: float | None = None  # None: nothing to tell it by yet

    @property
    def text(self) -> str:
        """One line of it."""
        left = "" if self.left_s is None else f", {duration(self.left_s)} left"
        failed = f", {self.errors} errors" if self.errors else ""
        workers = f"{self.workers} workers{left}" if self.workers else "no workers: waiting for some"
        return f"{self.there + self.computed} of {self.total} tasks{failed}, {workers}"


def run_plan(
    plan: Plan,
    folder: str | os.PathLike[str],
    scheduler: Scheduler,
    *,
    retry: bool = False,
    on_progress: Progress | None = None,
) -> Status:
    """Computes what the folder lacks, and writes its tables; each row is kept as it comes.

    However it is ended, the next run goes on from the rows that are there.  retry: what ended in an error is
    computed again.  on_progress: called with new rows, and twice a second meanwhile; what it raises ends the run.

    Raises InputError for a folder that is not this plan's, for workers that cannot be reached, and for a disk that
    takes no more; what is there is kept.
    """
    store = Store.writing(folder, header_of(plan.title, plan.about, plan.tasks), plan.text, plan.tasks)
    try:
        there = store.names(errors=not retry)
        missing = [task for task in plan.tasks if task.name not in there]
        status = Status(len(plan.tasks), len(plan.tasks) - len(missing))
        if missing:
            _compute(missing, store, scheduler, status, on_progress or (lambda status: None))
        store.write_tables()
        return status
    finally:
        store.close()


def estimate_s(plan: Plan, there: set[str], workers: int, known: dict[str, float]) -> float:
    """About how long the rest of a plan takes; known: seconds that a task of some groups took."""
    return sum(known.get(task.group, rough_s(task)) for task in plan.tasks if task.name not in there) / max(1, workers)


def rough_s(task: Task) -> float:
    """About how long a task takes on one core of a common machine."""
    import msgspec

    kind = KINDS[task.kind]
    return kind.seconds(msgspec.convert(task.settings, kind.settings))


def duration(seconds: float) -> str:
    """'4 h 10 min', '12 min', '40 s'."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def _compute(
    missing: Sequence[Task], store: Store, scheduler: Scheduler, status: Status, on_progress: Progress
) -> None:
    waiting = Counter(task.group for task in missing)
    rough = {task.group: rough_s(task) for task in missing}
    spent: Counter[str] = Counter()
    count: Counter[str] = Counter()
    for outcomes in scheduler.outcomes(missing, version()):
        status.workers = scheduler.workers
        for kind, rows in _by_kind(outcomes):
            store.append(kind, rows)
            for row in rows:
                status.computed += 1
                status.errors += row["error"] is not None
                waiting[row["group"]] -= 1
                if row.get("elapsed_s"):
                    spent[row["group"]] += row["elapsed_s"]
                    count[row["group"]] += 1
        if count:
            each = {group: spent[group] / count[group] if count[group] else rough[group] for group in waiting}
            status.left_s = sum(each[group] * n for group, n in waiting.items()) / max(1, scheduler.workers)
        on_progress(status)


def _by_kind(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, list[dict]]]:
    rows: dict[str, list[dict]] = {}
    for task, answer in outcomes:
        row = common(task) | {"error": str(answer)} if isinstance(answer, Died) else answer
        rows.setdefault(task.kind, []).append(row)
    yield from rows.items()
