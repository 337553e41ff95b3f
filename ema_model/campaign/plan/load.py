"""Plans from files: what is in one, and which come with the package."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from ema_model.campaign.axes import MOST_TASKS
from ema_model.campaign.plan.document import check_names, document_of, plan_text, table_of
from ema_model.campaign.plan.group import Group, excitation_of
from ema_model.campaign.task import Task
from ema_model.errors import InputError, quoted
from ema_model.files.shipped import shipped_folder

_ENTRIES = ("schema", "title", "about", "like", "runs", "groups")


@dataclass(frozen=True)
class Plan:
    """What a campaign computes."""

    title: str
    about: str
    text: str  # a file that gives the same plan, wherever it lies
    tasks: tuple[Task, ...]


def load_plan(path: str | os.PathLike[str]) -> Plan:
    """The plan of a file, or the shipped one of that name; InputError, one line, for whatever is wrong in it.

    Files that it names lie beside it, unless their paths are whole.
    """
    file = plan_path(path)
    document = document_of(file, 0)
    check_names(document, _ENTRIES, f"{quoted(file)}:")
    if document.get("schema", 1) != 1:
        raise InputError(f"{quoted(file)}: schema {quoted(document['schema'], 40)} is not known; this reads schema 1")
    groups = table_of(document, "groups", f"{quoted(file)}:")
    if not groups:
        raise InputError(f"{quoted(file)}: has no [groups.NAME]; each says what is to be computed")
    runs = {}
    for name, table in table_of(document, "runs", f"{quoted(file)}:").items():
        where = f"{quoted(file)}: [runs.{quoted(name)}]"
        runs[name] = excitation_of(table, where)
    tasks: list[Task] = []
    for name, table in groups.items():
        where = f"{quoted(file)}: [groups.{quoted(name)}]"
        if not isinstance(table, dict):
            raise InputError(f"{where} must be a table")
        group = Group(name, table, runs, file.parent, where)
        if (count := len(tasks) + group.count) > MOST_TASKS:
            raise InputError(f"{where} takes the plan to {count} tasks, and {MOST_TASKS} are the most; split it")
        tasks += group.tasks()
    title, about = (str(document.get(key, usual)) for key, usual in (("title", file.stem), ("about", "")))
    return Plan(title, about, plan_text(document, file), tuple(tasks))


def plan_path(path: str | os.PathLike[str]) -> Path:
    """Where a plan lies: the file, or, of a name without a suffix, the one that is shipped under it."""
    given = Path(path)
    if given.suffix or given.exists():
        return given
    known = shipped_plans()
    if str(given) not in known:
        raise InputError(f"no plan {quoted(given)!r}; shipped are {', '.join(known)}, or name a file (.toml)")
    return known[str(given)]


def shipped_plans() -> dict[str, Path]:
    """The plans that come with the package (assets/plans), by name."""
    return {path.stem: path for path in sorted(shipped_folder("plans").glob("*.toml"))}
