"""A campaign in words and tables, for a terminal and for Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from ema_model.campaign.store import Store, failed, summaries

_MOST_ERRORS = 10


def made_with(store: Store) -> str:
    """'emaviz 0.1.0 (commit 1a2b3c), numpy 2.4.6, …; begun 2026-11-22 10:00'."""
    header = store.header
    versions = dict(header.version)
    own = f"emaviz {versions.pop('emaviz')} (commit {header.commit or 'none'}, sources {versions.pop('sources')})"
    return f"{', '.join([own, *(f'{name} {one}' for name, one in versions.items())])}; begun {header.begun}"


def progress_table(store: Store) -> str:
    """How far each group is."""
    heads = ("group", "does", "rows", "of", "errors")
    lines = [
        [group, one["kind"], str(one["rows"]), str(one["tasks"]), str(one["errors"])]
        for group, one in store.progress().items()
    ]
    rows, tasks = (sum(int(line[at]) for line in lines) for at in (2, 3))
    state = "done" if rows == tasks else f"{rows} of {tasks} tasks have a row"
    return f"{store.header.title}: {state}\n{made_with(store)}\n\n{_aligned([heads, *lines])}"


def interrupted(store: Store) -> str:
    """What a campaign has that was interrupted."""
    groups = store.progress().values()
    rows, tasks = (sum(one[of] for one in groups) for of in ("rows", "tasks"))
    return f"{store.folder}: interrupted, {rows} of {tasks} tasks have a row; the same line goes on from there"


def report_text(store: Store) -> str:
    """The tables in Markdown, with the version and the commit that they were made with."""
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
