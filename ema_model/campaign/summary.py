"""What a campaign's rows say together: a table a kind, a line a group, and one a case where a group has several."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ema_model.campaign.kinds import KINDS
from ema_model.campaign.store import Store


@dataclass(frozen=True)
class Summary:
    """The table of a kind's rows."""

    kind: str
    title: str
    heads: list[str]
    lines: list[list[str]]


def summaries(store: Store) -> list[Summary]:
    """The tables of the kinds that the campaign has rows of."""
    found = []
    for kind in sorted(set(store.header.kinds.values())):
        rows = store.table(kind).to_pylist()
        if rows:
            found.append(_summary(kind, store, rows))
    return found


def failed(store: Store) -> list[dict[str, Any]]:
    """The rows of tasks that ended in an error: group, case, seed, error, name."""
    names = ["group", "case", "seed", "error", "name"]
    rows = [row for kind in KINDS for row in store.table(kind).select(names).to_pylist()]
    return [row for row in rows if row["error"] is not None]


def _summary(kind: str, store: Store, rows: list[dict[str, Any]]) -> Summary:
    lines = []
    for group in (group for group, its in store.header.kinds.items() if its == kind):
        own = [row for row in rows if row["group"] == group]
        there = {row["case"] for row in own}
        cases = [case for case in store.header.cases[group] if case in there]
        if len(cases) > 1:
            lines.append((group, "all", own))
        lines += [(group, case, [row for row in own if row["case"] == case]) for case in cases]
    told = [(group, case, its, [row for row in its if row["error"] is None]) for group, case, its in lines]
    numbers = [KINDS[kind].told(whole) if whole else {} for *_, whole in told]
    heads = list(dict.fromkeys(head for one in numbers for head in one))
    return Summary(
        kind,
        KINDS[kind].title,
        ["group", "case", "tasks", "errors", *heads],
        [
            [group, case, str(len(its)), str(len(its) - len(whole)), *(str(one.get(head, "–")) for head in heads)]
            for (group, case, its, whole), one in zip(told, numbers)
        ],
    )
