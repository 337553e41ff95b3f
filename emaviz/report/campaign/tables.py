"""What the rows say together."""

from __future__ import annotations

from ema_model.campaign.summary import summaries
from emaviz.report.campaign.subject import Rows
from emaviz.report.markup import paragraph, table
from emaviz.report.section import Figures, Section


class Tables(Section[Rows]):
    """A table a kind of task."""

    title = "Results"
    anchor = "results"
    place = 20

    def body(self, subject: Rows, figures: Figures) -> str:
        """Left out where there are no rows."""
        parts = []
        for one in summaries(subject.store):
            parts += [paragraph(one.title), table(one.heads, one.lines, text_columns=2)]
        return "".join(parts)
