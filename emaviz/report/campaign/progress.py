"""How far the campaign is, and with what it was made."""

from __future__ import annotations

from emaviz.report.campaign.subject import Rows
from emaviz.report.markup import paragraph, table
from emaviz.report.section import Figures, Section
from emaviz.text.campaign import made_with


class Progress(Section[Rows]):
    """A line a group."""

    title = "Tasks"
    anchor = "tasks"
    place = 10

    def body(self, subject: Rows, figures: Figures) -> str:
        """Always there."""
        lines = [
            [group, one["kind"], one["rows"], one["tasks"], one["errors"]]
            for group, one in subject.store.progress().items()
        ]
        heads = ["Group", "does", "rows", "of", "errors"]
        return paragraph(f"Made with {made_with(subject.store)}.") + table(heads, lines, text_columns=2)
