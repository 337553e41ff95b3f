"""A campaign as a result: how far it is, what its rows say together, and all of it in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

from msgspec import Meta

from ema_model.campaign.store import GroupJson, Store, failed, summaries
from ema_model.result import Result
from ema_model.text import Document, Lines, Note, Table

_MOST_ERRORS = 10


@dataclass(frozen=True, eq=False, repr=False)
class Campaign(Result):
    """The rows of a campaign's folder, each read once."""

    store: Store

    @property
    def title(self) -> Annotated[str, Meta(description="of the plan")]:
        """As the plan has it."""
        return self.store.header.title

    @property
    def version(
        self,
    ) -> Annotated[dict[str, str], Meta(description="of emaviz, a hash of its sources, and of its libraries")]:
        """With which the rows were made."""
        return self.store.header.version

    @property
    def commit(self) -> Annotated[str, Meta(description="of its source; empty where that is not known")]:
        """As the header has it."""
        return self.store.header.commit

    @property
    def groups(self) -> Annotated[dict[str, GroupJson], Meta(description="by name")]:
        """How far each is."""
        return self.progress

    @cached_property
    def progress(self) -> dict[str, GroupJson]:
        """The same, counted once."""
        return self.store.progress()

    @cached_property
    def by_kind(self) -> dict[str, list[dict[str, Any]]]:
        """All rows, with how each came about, by the kind of task."""
        return {kind: self.store.table(kind, how=True).to_pylist() for kind in set(self.store.header.kinds.values())}

    def answers(self, kind: str) -> list[dict[str, Any]]:
        """The rows of a kind that are no errors."""
        return [row for row in self.by_kind.get(kind, []) if row["error"] is None]

    def grouped(self, kind: str) -> dict[str, list[dict[str, Any]]]:
        """The same by group."""
        groups = dict.fromkeys(row["group"] for row in self.answers(kind))
        return {group: [row for row in self.answers(kind) if row["group"] == group] for group in groups}

    def of_known_truth(self, least: int = 1) -> dict[str, list[dict[str, Any]]]:
        """Identifications by group, of groups with so many or more."""
        known = {
            group: [row for row in rows if row["k_true"] is not None]
            for group, rows in self.grouped("identify").items()
        }
        return {group: rows for group, rows in known.items() if len(rows) >= least}

    @property
    def how_far(self) -> str:
        """'done', or '12 of 40 tasks have a row'."""
        rows, tasks = self.computed
        return "done" if rows == tasks else f"{rows} of {tasks} tasks have a row"

    @property
    def computed(self) -> tuple[int, int]:
        """Tasks that have a row, and all."""
        every = self.progress.values()
        return sum(one["rows"] for one in every), sum(one["tasks"] for one in every)


# --- in words, for a terminal, a page, a report, and as Markdown ------------------------------------------------------


def document_of(of: Campaign) -> Document:
    """How far it is, a table a kind of task, and how many errors there are."""
    tables = [_table(one.title, one.heads, one.lines) for one in summaries(of.store)]
    errors = sum(one["errors"] for one in of.progress.values())
    notes = [Note(f"{errors} tasks ended in an error.")] if errors else []
    told = Lines([f"{of.title}: {of.how_far}. Made with {made_with(of.store)}."])
    return Document([told, *notes, _table("", _PROGRESS, _counted(of)), *tables])


_PROGRESS = ("group", "does", "rows", "of", "errors")


def _counted(of: Campaign) -> list[list[str]]:
    """A line a group."""
    return [
        [group, one["kind"], *(str(one[what]) for what in ("rows", "tasks", "errors"))]
        for group, one in of.progress.items()
    ]


def _table(title: str, heads: Sequence[str], lines: Sequence[Sequence[str]]) -> Table:
    """Its first two columns, of text, as one."""
    rows = [[" · ".join(filter(None, line[:2])), *line[2:]] for line in lines]
    first = " · ".join(filter(None, heads[:2]))
    return Table(list(heads[2:]), rows, f"{title}: {first}" if title else first)


def made_with(store: Store) -> str:
    """'emaviz 0.1.0 (commit 1a2b3c), numpy 2.4.6, …; begun 2026-11-22 10:00'."""
    header = store.header
    versions = dict(header.version)
    own = f"emaviz {versions.pop('emaviz')} (commit {header.commit or 'none'}, sources {versions.pop('sources')})"
    return f"{', '.join([own, *(f'{name} {one}' for name, one in versions.items())])}; begun {header.begun}"


def progress_table(of: Campaign) -> str:
    """How far each group is."""
    lines = _counted(of)
    return f"{of.title}: {of.how_far}\n{made_with(of.store)}\n\n{_aligned([_PROGRESS, *lines])}"


def interrupted(store: Store) -> str:
    """What a campaign has that was interrupted."""
    rows, tasks = Campaign(store).computed
    return f"{store.folder}: interrupted, {rows} of {tasks} tasks have a row; the same line goes on from there"


def report_text(of: Campaign) -> str:
    """The tables in Markdown, with the version and the commit that they were made with."""
    store = of.store
    parts = [f"## {store.header.title}", *filter(None, [store.header.about]), f"Made with {made_with(store)}."]
    for one in summaries(store):
        parts += [f"### {one.title}", markdown_table(one.heads, one.lines)]
    if errors := failed(store):
        shown = [
            f"- {row['group']}, {row['case']}, seed {row['seed']}: {row['error']}" for row in errors[:_MOST_ERRORS]
        ]
        more = [f"- … {len(errors)} in all"] if len(errors) > _MOST_ERRORS else []
        parts += ["### Errors", "\n".join(shown + more)]
    return "\n\n".join(parts)


def markdown_table(heads: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table as Markdown has it."""
    rows = [heads, ["---"] * len(heads), *lines]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows)


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(w) if i < 2 else cell.rjust(w) for i, (cell, w) in enumerate(zip(row, widths)))
        for row in rows
    )
