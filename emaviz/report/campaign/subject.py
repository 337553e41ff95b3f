"""What a campaign's report is about: its rows, read once."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from ema_model.campaign.store import Store


class Rows:
    """All rows of a campaign, by kind."""

    def __init__(self, store: Store) -> None:
        self.store = store

    @cached_property
    def by_kind(self) -> dict[str, list[dict[str, Any]]]:
        """With how each came about."""
        return {kind: self.store.table(kind, how=True).to_pylist() for kind in set(self.store.header.kinds.values())}

    def answers(self, kind: str) -> list[dict[str, Any]]:
        """The rows of a kind that are no errors."""
        return [row for row in self.by_kind.get(kind, []) if row["error"] is None]

    def grouped(self, kind: str) -> dict[str, list[dict[str, Any]]]:
        """The same by group."""
        groups = dict.fromkeys(row["group"] for row in self.answers(kind))
        return {group: [row for row in self.answers(kind) if row["group"] == group] for group in groups}
